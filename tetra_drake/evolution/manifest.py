"""Manifest of a run: its definition, on disk and in memory.

    manifest.json    name of the run, seed, versions, objective, optimiser, SHA-256 of these and of
                     scenario.yaml
    scenario.yaml    the scenario with all settings; its height file, if any, beside it

The name of a run is a digest of this definition. Each line of the record has the name.

Objective and optimiser are recorded by name only. A run with an objective or optimiser from Python
cannot be resumed by the command line. When a run is resumed, its record proves that they are
unchanged: the optimiser must ask for the recorded vectors, and a recorded gait must get its
recorded fitness (see trials.check_fitness).
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import types
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import Field

from tetra_drake.errors import InputError
from tetra_drake.files import read_json, read_text, write_whole
from tetra_drake.machine import versions
from tetra_drake.optimizers.base import Task
from tetra_drake.robot.gait import Gait, ParameterSpace, Vector
from tetra_drake.scenario.load import SCENARIO, dump_scenario, load_scenario, save_scenario
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.settings.section import Section

SCHEMA = 4
MANIFEST = "manifest.json"

_NAME = 12
"""Number of characters of a run's name."""

FITNESS = "fitness"
"""The name of the scenario's objective."""


@dataclass(frozen=True)
class Method:
    """Names of a run's objective and optimiser. A name with a dot is an object from Python, with
    its module."""

    objective: str
    optimizer: str

    @classmethod
    def of(
        cls, scenario: Scenario, *, objective: object = None, optimizer: object = None
    ) -> Method:
        """The method of a run. By default objective and optimiser are the scenario's."""
        name = FITNESS if objective is None else _name(objective)
        return cls(name, _name(scenario.optimizer if optimizer is None else optimizer))

    def __str__(self) -> str:
        return f"optimiser {self.optimizer}, objective {self.objective}"

    @property
    def given_from_python(self) -> list[str]:
        """Which of "objective" and "optimizer" come from Python, not from the scenario."""
        return [part for part, name in vars(self).items() if "." in name]

    def check_same(self, other: Method, source: object) -> None:
        """Raises InputError, with "objective" or "optimizer" as key, if `other` differs."""
        for part, ours in vars(self).items():
            theirs = getattr(other, part)
            if ours == theirs:
                continue
            problem = f"the run was made with {ours}, not {theirs}"
            if part in self.given_from_python:
                call = f"tetra_drake.evolve(None, {str(source)!r}, resume=True, {part}=...)"
                problem += f"; resume it from Python: {call}"
            raise InputError(source, part, problem)


@dataclass(frozen=True)
class Manifest:
    """Definition of a run: scenario, seed, versions and method."""

    scenario: Scenario
    seed: int
    versions: Mapping[str, str]
    method: Method
    run: str
    """Name of the run in the lines of its record."""
    thinned: bool = False
    """True if most genomes were removed to save space, as in the folder runs/."""
    reevaluate: bool = True
    """False if the run was begun without simulations after the evolution; see evolve()."""

    @classmethod
    def of(
        cls, scenario: Scenario, seed: int, method: Method, *, reevaluate: bool = True
    ) -> Manifest:
        """The manifest of a new run, with the versions that are installed."""
        now = versions(scenario.engine.packages)
        parts = (dump_scenario(scenario), seed, now, vars(method))
        name = _sha256(json.dumps(parts))[:_NAME]
        return cls(scenario, seed, now, method, name, reevaluate=reevaluate)

    @property
    def other_versions(self) -> list[str]:
        """Recorded versions that are not installed here, such as "numpy 1.26"."""
        now = versions(self.scenario.engine.packages)
        recorded = {name: self.versions.get(name) for name in now}
        return [f"{name} {then}" for name, then in recorded.items() if then != now[name]]

    def gait(self, vector: Vector, *, trial: int, index: int) -> Gait:
        """The gait of a recorded evaluation."""
        name = f"{self.scenario.name}, seed {self.seed}, trial {trial}, evaluation {index}"
        gait = ParameterSpace.of(self.scenario).gait(vector, name=name)
        return dataclasses.replace(gait, scenario=self.scenario.name)

    def task(self, vector: Vector, *, trial: int, index: int, iteration: int) -> Task:
        """Task to evaluate a vector. With disturbances it has the seed of the draws."""
        draws = self.scenario.disturbances is not None
        seed = (self.seed, trial, iteration) if draws else None
        return Task(vector, trial, index, iteration, seed)


def read_manifest(directory: Path) -> Manifest:
    """Reads the manifest of a run; raises InputError if it is missing or damaged."""
    path = directory / MANIFEST
    if not os.path.exists(path):
        raise InputError(directory, "", f"holds no {MANIFEST}, so it is not a run")
    file = _File.from_tree(read_json(path, "manifest of a run"), path)
    scenario_file = directory / SCENARIO
    scenario = load_scenario(scenario_file)
    if file.scenario_sha256 != _sha256(read_text(scenario_file, "scenario file")):
        raise InputError(scenario_file, "", f"is not what {MANIFEST} says: it was changed")
    method = Method(file.objective, file.optimizer)
    manifest = Manifest(
        scenario, file.seed, file.versions, method, file.run, file.thinned, file.reevaluate
    )
    if file.sha256 != _digest(manifest):
        raise InputError(path, "sha256", "does not fit the other keys: they were changed")
    return manifest


def write_manifest(directory: Path, manifest: Manifest) -> None:
    """Writes scenario.yaml and then manifest.json, which makes the directory a run."""
    text = save_scenario(directory, manifest.scenario)
    content = {
        "schema": SCHEMA,
        "run": manifest.run,
        "seed": manifest.seed,
        "versions": dict(manifest.versions),
        "scenario_sha256": _sha256(text),
        **vars(manifest.method),
        "sha256": _digest(manifest),
    }
    if not manifest.reevaluate:
        content["reevaluate"] = False
    write_whole(directory / MANIFEST, json.dumps(content, indent=1) + "\n")


class _File(Section):
    """The content of manifest.json."""

    version: int = Field(alias="schema", ge=SCHEMA, le=SCHEMA)
    run: str
    seed: int = Field(ge=0)
    versions: dict[str, str]
    scenario_sha256: str
    objective: str
    optimizer: str
    sha256: str
    """SHA-256 of run, seed, versions, objective and optimiser."""
    thinned: bool = False
    reevaluate: bool = True


def _digest(manifest: Manifest) -> str:
    """SHA-256 of a manifest without its scenario, which has a digest of its own."""
    parts = (manifest.run, manifest.seed, dict(manifest.versions), vars(manifest.method))
    return _sha256(json.dumps(parts, sort_keys=True))


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _name(given: object) -> str:
    """Name of a function, class or instance. Outside this package it includes the module, and the
    fields of a dataclass."""
    kind: Any = given if isinstance(given, (type, types.FunctionType)) else type(given)
    module = kind.__module__ or "__main__"  # code run by exec() has no module
    if module.startswith("tetra_drake."):
        return str(kind.__qualname__)
    name = f"{module}.{kind.__qualname__}"
    if not dataclasses.is_dataclass(given) or isinstance(given, type):
        return name
    fields = {field.name: getattr(given, field.name) for field in dataclasses.fields(given)}
    return f"{name} {json.dumps(fields, default=lambda value: type(value).__name__)}"
