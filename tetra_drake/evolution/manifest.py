"""A run on disk: its definition, its lock, and how it is begun and resumed.

    manifest.json    name of the run, seed, versions, objective, optimiser, SHA-256 of these and of
                     scenario.yaml
    scenario.yaml    the scenario with all settings; its height file, if any, beside it
    .lock            locked while a process works on the run
    trial_00/ ...    see evolution.entries

The name of a run is a digest of this definition. Each line of the record has the name.

Objective and optimiser are recorded by name only. A run with an objective or optimiser from Python
cannot be resumed by the command line. When a run is resumed, its record proves that they are
unchanged: the optimiser must ask for the recorded vectors, and a recorded gait must get its
recorded fitness (see trials.check_fitness).
"""

from __future__ import annotations

import contextlib
import dataclasses
import fcntl
import hashlib
import json
import os
import shutil
import types
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from pydantic import Field

from tetra_drake.errors import InputError
from tetra_drake.files import (
    check_file,
    check_folder,
    make_folder,
    read_json,
    read_text,
    write_whole,
)
from tetra_drake.laws.height_field import RECORDED
from tetra_drake.machine import versions
from tetra_drake.optimizers.base import Task
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.parameter_space import ParameterSpace, Vector
from tetra_drake.scenario.load import SCENARIO, dump_scenario, load_scenario, save_scenario
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.settings.plugins import check_plugins, plugins_of
from tetra_drake.settings.section import Section
from tetra_drake.settings.units import chosen_units, shown_in

SCHEMA = 4
MANIFEST, LOCK = "manifest.json", ".lock"

_ASIDE = ".replaced"
"""Folder that holds the old run while it is replaced."""

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
        return cls(name, scenario.optimizer.tag if optimizer is None else _name(optimizer))

    def __str__(self) -> str:
        return f"optimiser {self.optimizer}, objective {self.objective}"

    @property
    def given_from_python(self) -> list[str]:
        """What the caller of evolve() passed as a Python object of another package, so that the
        command line cannot repeat the run: "objective", "optimizer", both or none of them."""
        return [part for part, name in vars(self).items() if "." in name]


def _name(given: object) -> str:
    """Name of a function, class or instance. Outside this package it includes the module and, for
    an instance of a dataclass, the values of its fields."""
    kind: Any = given if isinstance(given, (type, types.FunctionType)) else type(given)
    module = kind.__module__ or "__main__"  # code run by exec() has no module
    if module.startswith("tetra_drake."):
        return str(kind.__qualname__)
    name = f"{module}.{kind.__qualname__}"
    if not dataclasses.is_dataclass(given) or isinstance(given, type):
        return name
    fields = {field.name: getattr(given, field.name) for field in dataclasses.fields(given)}
    return f"{name} {json.dumps(fields, default=lambda value: type(value).__name__)}"


@dataclass(frozen=True)
class Manifest:
    """Definition of a run: scenario, seed, versions of the packages, and method."""

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
    units: str = ""
    """Name of the units that were chosen when the run was begun; "" for the scenario's own."""

    def in_its_units(self) -> contextlib.AbstractContextManager[None]:
        """Context manager that shows numbers in the run's units, unless others are chosen now."""
        return shown_in(chosen_units() or self.units)

    @property
    def other_versions(self) -> list[str]:
        """Recorded versions that are not installed here, such as "numpy 1.26"."""
        now = versions(self.scenario.engine.packages) | plugins_of(self.scenario)
        recorded = {name: self.versions.get(name) for name in now}
        return [f"{name} {then}" for name, then in recorded.items() if then != now[name]]

    def gait(self, vector: Vector, *, trial: int, index: int) -> Gait:
        """The gait of a parameter vector. Its name gives scenario, seed, trial and evaluation
        (`index`)."""
        name = f"{self.scenario.name}, seed {self.seed}, trial {trial}, evaluation {index}"
        gait = ParameterSpace.of(self.scenario).gait(vector, name=name)
        return dataclasses.replace(gait, scenario=self.scenario.name)

    def task(self, vector: Vector, *, trial: int, index: int, iteration: int) -> Task:
        """Task to evaluate a vector: evaluation `index` of a trial. With disturbances the task has
        the seed of their random draws, which all tasks of an iteration share."""
        draws = self.scenario.disturbances is not None
        seed = (self.seed, trial, iteration) if draws else None
        return Task(vector, trial, index, iteration, seed)

    def check_made_with(self, directory: Path, **given: Any) -> None:
        """Raises InputError, naming the run's `directory`, if the run was made with another `seed`,
        `objective` or `optimizer` than `given`; None is any."""
        for part, value in given.items():
            recorded = (vars(self) | vars(self.method))[part]
            if value not in (None, recorded):
                problem = f"the run was made with {recorded}, not {value}"
                if part in self.method.given_from_python:
                    call = f"tetra_drake.evolve(None, {str(directory)!r}, resume=True, {part}=...)"
                    problem += f"; resume it from Python: {call}"
                raise InputError(directory, part, problem)

    @property
    def digest(self) -> str:
        """SHA-256 of the manifest without its scenario, which has a digest of its own."""
        parts = (self.run, self.seed, dict(self.versions), vars(self.method))
        return _sha256(json.dumps(parts, sort_keys=True))


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


class _File(Section):
    """Content of manifest.json."""

    version: int = Field(alias="schema", ge=SCHEMA, le=SCHEMA)
    run: str
    seed: int = Field(ge=0)
    versions: dict[str, str]
    scenario_sha256: str
    objective: str
    optimizer: str
    sha256: str
    """The manifest's digest."""
    thinned: bool = False
    reevaluate: bool = True
    units: str = ""


_SAME = ("run", "seed", "versions", "thinned", "reevaluate", "units")
"""Keys of manifest.json that are fields of a Manifest."""


def read_manifest(directory: Path) -> Manifest:
    """Reads the manifest of a run. Raises InputError if it is missing or damaged, or if a plug-in
    is missing that the run used."""
    path = directory / MANIFEST
    if not os.path.exists(path):
        raise InputError(directory, "", f"holds no {MANIFEST}, so it is not a run")
    file = _File.from_tree(read_json(path, "manifest of a run"), path)
    check_plugins(file.versions, directory)
    scenario_file = directory / SCENARIO
    scenario = load_scenario(scenario_file)
    if file.scenario_sha256 != _sha256(read_text(scenario_file, "scenario file")):
        raise InputError(scenario_file, "", f"is not what {MANIFEST} says: it was changed")
    same = {name: getattr(file, name) for name in _SAME}
    manifest = Manifest(scenario, method=Method(file.objective, file.optimizer), **same)
    if file.sha256 != manifest.digest:
        raise InputError(path, "sha256", "does not fit the other keys: they were changed")
    return manifest


def write_manifest(directory: Path, manifest: Manifest) -> None:
    """Writes scenario.yaml and then manifest.json, which makes the directory a run."""
    file = _File(
        schema=SCHEMA,
        scenario_sha256=_sha256(save_scenario(directory, manifest.scenario)),
        sha256=manifest.digest,
        **vars(manifest.method),
        **{name: getattr(manifest, name) for name in _SAME},
    )
    content = file.model_dump(by_alias=True, exclude_defaults=True)
    write_whole(directory / MANIFEST, json.dumps(content, indent=1) + "\n")


@dataclass(eq=False)
class RunRecord(contextlib.AbstractContextManager["RunRecord"]):
    """A run directory, locked against other processes until the end of its `with` block. A new run
    is locked from begin() on."""

    directory: Path
    manifest: Manifest
    begun: bool = False
    """True if the manifest is written."""
    _lock: BinaryIO | None = None

    @classmethod
    def create(
        cls,
        directory: Path,
        *,
        scenario: Scenario,
        seed: int,
        method: Method | None = None,
        overwrite: bool = False,
        reevaluate: bool = True,
    ) -> RunRecord:
        """A new run in a new or empty directory. With `overwrite` the directory may hold another
        run, unless a process is working on it. begin() writes the first file. Raises InputError if
        the directory cannot be used."""
        method = method or Method.of(scenario)
        installed = versions(scenario.engine.packages) | plugins_of(scenario)
        definition = json.dumps((dump_scenario(scenario), seed, installed, vars(method)))
        name = _sha256(definition)[:_NAME]
        manifest = Manifest(
            scenario, seed, installed, method, name, reevaluate=reevaluate, units=chosen_units()
        )
        check_folder(directory)
        _recover(directory)
        problem = _why_not_new(directory)
        if not problem:
            return cls(directory, manifest)
        if not overwrite:
            raise InputError(directory, "", problem)
        read_manifest(directory)
        return cls(directory, manifest, _lock=_locked(directory))

    @classmethod
    def resume(
        cls,
        directory: Path,
        *,
        scenario: Scenario | None = None,
        seed: int | None = None,
        method: Method | None = None,
    ) -> RunRecord:
        """Opens a run to continue it. A given scenario, seed or method must be equal to the run's.
        Raises InputError if one is not, if most genomes were removed from the run (thinned), or if
        another process is working on it."""
        _recover(directory)
        manifest = read_manifest(directory)
        if manifest.thinned:
            raise InputError(directory, "", "is thinned: it lacks genomes that resuming needs")
        if scenario is not None:
            for key, value in manifest.scenario.differences(scenario):
                problem = f"the run has {value}; it is resumed with its own scenario"
                raise InputError(directory, key, problem)
        manifest.check_made_with(directory, seed=seed, **vars(method or manifest.method))
        return cls(directory, manifest, begun=True, _lock=_locked(directory))

    def begin(self) -> None:
        """Locks the directory and writes the manifest, unless that is done already. A run that is
        overwritten is deleted afterwards; if the manifest cannot be written, the old run stays."""
        if self.begun:
            return
        if self._lock is None:
            make_folder(self.directory)
            self._lock = _locked(self.directory)
            if problem := _why_not_new(self.directory):  # another process may have been faster
                raise InputError(self.directory, "", problem)

        aside = self.directory / _ASIDE
        shutil.rmtree(aside, ignore_errors=True)
        aside.mkdir()
        old = [file for file in self.directory.iterdir() if file.name not in (LOCK, _ASIDE)]
        old.sort(key=lambda file: file.name != MANIFEST)  # the manifest first: it makes a run
        try:
            for file in old:
                file.rename(aside / file.name)
            write_manifest(self.directory, self.manifest)
        except BaseException:
            _put_back(self.directory)
            raise
        finally:
            shutil.rmtree(aside)
        self.begun = True

    def __exit__(self, *_: object) -> None:
        if self._lock is not None:
            self._lock.close()


def _recover(directory: Path) -> None:
    """Puts a run back that a process was about to overwrite when it was killed."""
    if (directory / _ASIDE / MANIFEST).exists() and not (directory / MANIFEST).exists():
        with _locked(directory):
            _put_back(directory)


def _put_back(directory: Path) -> None:
    """Moves the files of a run back that begin() has moved aside, the manifest last."""
    for file in sorted((directory / _ASIDE).iterdir(), key=lambda one: one.name == MANIFEST):
        file.replace(directory / file.name)


def _why_not_new(directory: Path) -> str:
    """The reason why a directory cannot take a new run; empty if it can. Files of a process that
    was killed in begin() do not count."""
    if (directory / MANIFEST).exists():
        return "holds a run already; to go on with it, use --resume (in Python, resume=True)"
    ours = (LOCK, SCENARIO, _ASIDE, ".manifest.", ".scenario.", ".heights-")
    names = [file.name for file in directory.iterdir()] if directory.is_dir() else []
    is_new = all(name.startswith(ours) or RECORDED.fullmatch(name) for name in names)
    return "" if is_new else "is not empty, expected a new directory"


def _locked(directory: Path) -> BinaryIO:
    """The lock file of a run, locked. The system unlocks it when this process ends. Raises
    InputError if another process has the lock."""
    check_file(directory / LOCK)  # opening a pipe would wait for a reader
    with contextlib.ExitStack() as undo:
        try:
            lock = undo.enter_context((directory / LOCK).open("ab"))
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise InputError(directory, "", "another process is at work on this run") from error
        except OSError as error:
            raise InputError(directory, "", f"cannot be locked: {error.strerror}") from error
        undo.pop_all()
    return lock
