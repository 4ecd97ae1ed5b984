"""A run's record on disk: its files, their checks, and how a run is resumed.

    manifest.json             seed, versions, method (evaluator, objective, optimiser), SHA-256 of
    scenario.yaml             the scenario in full
    .lock                     locked while a process is at work on the run
    trial_00/
      evaluations.jsonl       one line per evaluation, in the order asked; metrics in SI
      iterations.jsonl        one line per iteration: best fitness, the optimiser's report
      in_progress.jsonl       during an iteration: those of its evaluations that are done
      best_gait.json          the fittest gait so far, a gait file
      reevaluations.jsonl     gaits evaluated once more on the Drake diagram

Evaluations become final lines iteration by iteration, so the record does not depend on
which of them was ready first. A run is resumed by repeating it from the start with recorded
fitnesses in place of simulations; every vector and every line must come out as recorded. Only an
optimiser that can follow takes over vectors that, on another processor, come out differently.
"""

from __future__ import annotations

import contextlib
import dataclasses
import fcntl
import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import yaml

from tetra_drake.errors import InputError
from tetra_drake.evolution.json_lines import append_lines, read_lines, repair_torn_line
from tetra_drake.evolution.method import Method, Part
from tetra_drake.evolution.optimizers.base import Evaluation
from tetra_drake.files import check_folder, json_number, write_whole
from tetra_drake.results.result import versions
from tetra_drake.robot.gait import Gait, Vector, save_gait
from tetra_drake.scenario.load import differences, dump_scenario, load_scenario
from tetra_drake.scenario.optimizers import SteadyState
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.units import INCH

_Lines = Sequence[dict[str, Any]]

SCHEMA, FIRST_SCHEMA = 2, 1
MANIFEST, SCENARIO, LOCK = "manifest.json", "scenario.yaml", ".lock"
EVALUATIONS, ITERATIONS = "evaluations.jsonl", "iterations.jsonl"
IN_PROGRESS, BEST_GAIT = "in_progress.jsonl", "best_gait.json"
REEVALUATIONS = "reevaluations.jsonl"

_ITERATION_KEYS = {
    "iteration": int,
    "evaluations": int,
    "best_fitness": float | int | None,
    "best_evaluation": int | None,
    "stop": str | None,
}
_EVALUATION_KEYS = {
    "index": int,
    "iteration": int,
    "genome": list | None,
    "metrics": dict,
    "fitness": float | int | None,
    "failure": str | None,
    "wall_time_s": float | int,
    "engine": str,
    "draws": dict | None,
}
_OPTIONAL = {"draws": None}
"""What a line may lack: there are draws among disturbances only."""
_FIRST_METRICS = {
    "distance_in": "distance",
    "steady_distance_in": "steady_distance",
    "heading_error_in": "twist",
    "direction_in": "lead",
    "lateral_drift_in": "lateral_drift",
}
"""Metrics of schema 1, in inches, by their names today."""


def trial_folder(directory: Path, number: int) -> Path:
    """The folder of a trial."""
    return directory / f"trial_{number:02d}"


@dataclass(frozen=True)
class Manifest:
    """What defines a run."""

    scenario: Scenario
    seed: int
    versions: Mapping[str, str]
    method: Method
    thinned: bool = False
    """Whether most genomes were left out, as in the runs recorded beside the package."""

    @property
    def longest_trial(self) -> str:
        """How long a trial is that does not end early, in words."""
        settings, kind = self.scenario.evolution, type(self.scenario.optimizer)
        if kind is SteadyState or self.method.optimizer != Part(kind.__name__):
            return f"{settings.max_iterations} iterations, population {settings.population}"
        return f"{settings.budget} evaluations"


def read_manifest(directory: Path) -> Manifest:
    """The manifest of a run directory; InputError if there is none or it is damaged."""
    path, scenario_file = directory / MANIFEST, directory / SCENARIO
    try:
        raw = json.loads(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError) as error:
        raise InputError(directory, "", f"holds no {MANIFEST}, so it is not a run") from error
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(path, "", f"cannot be read: {error}") from error
    schema = raw.get("schema") if isinstance(raw, dict) else None
    if schema not in (SCHEMA, FIRST_SCHEMA):
        raise InputError(path, "schema", f"found {schema!r}, expected {FIRST_SCHEMA} or {SCHEMA}")
    for key, kind in (("seed", int), ("versions", dict)):
        if not isinstance(raw.get(key), kind):
            raise InputError(path, key, "is missing or damaged")
    scenario = load_scenario(scenario_file)
    text = scenario_file.read_text(encoding="utf-8")
    if schema == FIRST_SCHEMA:
        unchanged, method = raw.get("scenario") == yaml.safe_load(text), Method.of(scenario)
    else:
        unchanged = raw.get("scenario_sha256") == _sha256(text)
        method = Method.from_json(raw, path)
    if not unchanged:
        raise InputError(scenario_file, "", f"is not what {MANIFEST} says: it was changed")
    return Manifest(scenario, raw["seed"], raw["versions"], method, raw.get("thinned", False))


@dataclass(frozen=True)
class RunRecord:
    """An open run directory, locked against other processes until closed."""

    directory: Path
    manifest: Manifest
    _lock: BinaryIO

    @classmethod
    def create(
        cls, directory: Path, *, scenario: Scenario, seed: int, method: Method | None = None
    ) -> RunRecord:
        """Begins a run in a directory that does not exist or is empty."""
        now = versions(scenario.simulation.engine)
        manifest = Manifest(scenario, seed, now, method or Method.of(scenario))
        check_folder(directory)
        _refuse_a_used(directory)
        directory.mkdir(parents=True, exist_ok=True)
        with contextlib.ExitStack() as undo:
            lock = undo.enter_context(_lock(directory))
            _refuse_a_used(directory)  # Another process may have been faster.
            for leftover in (*directory.glob(".manifest.*"), *directory.glob(".scenario.*")):
                leftover.unlink()
            _write_manifest(directory, manifest)
            undo.pop_all()
        return cls(directory, manifest, lock)

    @classmethod
    def resume(
        cls,
        directory: Path,
        *,
        scenario: Scenario | None = None,
        seed: int | None = None,
        method: Method | None = None,
    ) -> RunRecord:
        """Opens a run to go on with it. What is given must be the run's."""
        manifest = read_manifest(directory)
        if manifest.thinned:
            raise InputError(directory, "", "is thinned: it lacks genomes that resuming needs")
        if seed not in (None, manifest.seed):
            raise InputError(directory, "seed", f"the run has seed {manifest.seed}, not {seed}")
        if scenario is not None:
            for key, value in differences(manifest.scenario, scenario):
                problem = f"the run has {value}; it is resumed with its own scenario"
                raise InputError(directory, key, problem)
        if method is not None:
            manifest.method.check_same(method, directory)
        return cls(directory, manifest, _lock(directory))

    def __enter__(self) -> RunRecord:
        return self

    def __exit__(self, *_: object) -> None:
        self._lock.close()


class TrialRecord:
    """The files of one trial. What is recorded already is checked instead of written."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(exist_ok=True)
        self._folder = folder
        for leftover in folder.glob(f".{Path(BEST_GAIT).stem}.*"):
            leftover.unlink()
        for name in (EVALUATIONS, ITERATIONS, IN_PROGRESS):
            repair_torn_line(folder / name)
        self._evaluations = read_entries(folder / EVALUATIONS)
        for row, entry in enumerate(self._evaluations):
            if entry["index"] != row:
                self._refuse(EVALUATIONS, row, f"index is {entry['index']}, expected {row}")
        self._iterations = read_entries(folder / ITERATIONS)
        in_progress = read_entries(folder / IN_PROGRESS)
        self._in_progress = {entry["index"]: (i, entry) for i, entry in enumerate(in_progress)}
        self._follows = False

    def vector(self, index: int, vector: Vector) -> Vector:
        """The recorded vector of this index in place of another one, as a following optimiser takes
        it; then, what the optimiser reports is no longer compared. `vector` itself if it is the
        recorded one, or none is."""
        _, _, entry = self._find(index)
        genome = vector.tolist() if entry is None else entry["genome"]
        if genome == vector.tolist() or [*map(type, genome)] != [float] * len(vector):
            return vector
        self._follows = True
        return np.array(genome)

    def recall(self, index: int, vector: Vector) -> Evaluation | None:
        """The recorded evaluation of this index, None if there is none; InputError if it is of
        another vector."""
        name, row, entry = self._find(index)
        if entry is None:
            return None
        if entry["genome"] != vector.tolist():
            self._refuse(name, row, "the genome is not the one that scenario and seed lead to")
        fitness = -math.inf if entry["fitness"] is None else entry["fitness"]
        rest = [entry[key] for key in ("metrics", "failure", "wall_time_s", "engine")]
        return dataclasses.replace(Evaluation(fitness, *rest), draws=entry.get("draws"))

    def _find(self, index: int) -> tuple[str, int, dict[str, Any] | None]:
        """File, row and entry of an evaluation."""
        if index < len(self._evaluations):
            return EVALUATIONS, index, self._evaluations[index]
        return IN_PROGRESS, *self._in_progress.get(index, (0, None))

    def keep(self, entry: dict[str, Any]) -> None:
        """Saves an evaluation whose iteration is not complete yet."""
        append_lines(self._folder / IN_PROGRESS, [entry])

    def complete(self, evaluations: _Lines, iteration: dict[str, Any]) -> None:
        """Writes an iteration's lines, or checks those that are there."""
        # In this order: a kill in between leaves nothing that repeating the run cannot complete.
        self._write(EVALUATIONS, self._evaluations, evaluations, first=evaluations[0]["index"])
        self._write(ITERATIONS, self._iterations, [iteration], first=iteration["iteration"])
        if evaluations[-1]["index"] >= len(self._evaluations):
            (self._folder / IN_PROGRESS).unlink(missing_ok=True)

    def save_best(self, gait: Gait, scenario: Scenario) -> None:
        """Writes the best gait."""
        save_gait(gait, self._folder / BEST_GAIT, scenario)

    def finish(self, evaluations: int) -> None:
        """Checks that the record ends where the trial does."""
        if len(self._evaluations) > evaluations:
            self._refuse(EVALUATIONS, evaluations, "the trial ends before this evaluation")
        (self._folder / IN_PROGRESS).unlink(missing_ok=True)

    def _write(self, name: str, recorded: _Lines, entries: _Lines, *, first: int) -> None:
        for row, (there, entry) in enumerate(zip(recorded[first:], entries, strict=False), first):
            keys = _ITERATION_KEYS if self._follows and name == ITERATIONS else there | entry
            key = next((key for key in keys if there.get(key) != entry.get(key)), None)
            if key is not None:
                self._refuse(name, row, f"{key} is not what scenario and seed lead to")
        if missing := entries[max(0, len(recorded) - first) :]:
            append_lines(self._folder / name, missing)

    def _refuse(self, name: str, row: int, problem: str) -> None:
        raise InputError(self._folder / name, f"line {row + 1}", f"is damaged: {problem}")


def evaluation_entry(
    index: int, iteration: int, vector: Vector, evaluation: Evaluation
) -> dict[str, Any]:
    """An evaluation as a line of the record; the fitness of a failure is null."""
    draws = {} if evaluation.draws is None else {"draws": dict(evaluation.draws)}
    return {
        "index": index,
        "iteration": iteration,
        "genome": vector.tolist(),
        "metrics": dict(evaluation.metrics),
        "fitness": json_number(evaluation.fitness),
        "failure": evaluation.failure,
        "wall_time_s": round(evaluation.wall_time, 4),
        "engine": evaluation.engine,
        **draws,
    }


def read_entries(path: Path) -> list[dict[str, Any]]:
    """The lines of a file of evaluations or iterations in today's form, whatever their schema;
    InputError, naming file and line, where one is damaged."""
    keys = _ITERATION_KEYS if path.name == ITERATIONS else _EVALUATION_KEYS
    entries = read_lines(path)
    for line, entry in enumerate(entries, start=1):
        for key, kind in keys.items():
            if not isinstance(entry.get(key, _OPTIONAL.get(key, NotImplemented)), kind):
                raise InputError(path, f"line {line}", f"is damaged: {key} is missing or invalid")
        entry.pop("best_distance_in", None)
        if "distance_in" in entry.get("metrics", {}):
            inches = entry["metrics"]
            entry["metrics"] = {_FIRST_METRICS[name]: _from_inches(inches[name]) for name in inches}
    return entries


def _from_inches(value: float) -> float:
    """The length in m that gives this number of inches to the last digit, where there is one."""
    near = value * INCH
    nearest = (near, math.nextafter(near, -math.inf), math.nextafter(near, math.inf))
    return next((length for length in nearest if length / INCH == value), near)


def _write_manifest(directory: Path, manifest: Manifest) -> None:
    # The manifest comes last: it makes the directory a run.
    text = dump_scenario(manifest.scenario)
    write_whole(directory / SCENARIO, text)
    content = {
        "schema": SCHEMA,
        "seed": manifest.seed,
        "versions": dict(manifest.versions),
        "scenario_sha256": _sha256(text),
        **dataclasses.asdict(manifest.method),
    }
    write_whole(directory / MANIFEST, json.dumps(content, indent=1) + "\n")


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _refuse_a_used(directory: Path) -> None:
    """Raises InputError if more is there than a run killed in its first moment leaves."""
    if (directory / MANIFEST).exists():
        problem = "holds a run already; to go on with it, use --resume (in Python, resume=True)"
        raise InputError(directory, "", problem)
    ours = (LOCK, SCENARIO, ".manifest.", ".scenario.")
    if directory.is_dir() and not all(f.name.startswith(ours) for f in directory.iterdir()):
        raise InputError(directory, "", "is not empty, expected a new directory")


def _lock(directory: Path) -> BinaryIO:
    """The run's locked file, which the system releases whenever this process ends."""
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
