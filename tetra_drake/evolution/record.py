"""A run's record on disk: what is written when, and how it is taken up again.

    manifest.json             scenario in full, seed, versions
    scenario.yaml             the same scenario, for `--scenario`
    .lock                     locked while a process is at work on the run
    trial_00/
      evaluations.jsonl       a line an evaluation, in the order asked
      iterations.jsonl        a line an iteration: mean and best fitness, best distance
      in_progress.jsonl       while an iteration lasts: what of it is evaluated already
      best_gait.json          the fittest gait so far, a gait file
      reevaluations.jsonl     gaits evaluated once more on the Drake diagram (see reevaluation.py)

Evaluations become final lines iteration by iteration, so the record does not depend on
which of them was ready first. A record is resumed by going through the whole run again with
recorded fitnesses in place of simulations; every genome and every line must come out as
recorded.
"""

from __future__ import annotations

import fcntl
import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import yaml

from tetra_drake.errors import InputError
from tetra_drake.evolution.json_lines import append_lines, read_lines, repair_torn_line
from tetra_drake.evolution.optimizers.base import Evaluation, Genome
from tetra_drake.files import write_whole
from tetra_drake.results.result import versions
from tetra_drake.robot.gait import Gait, save_gait
from tetra_drake.scenario.load import dump_scenario, load_scenario
from tetra_drake.scenario.schema import Scenario

SCHEMA = 1
MANIFEST, SCENARIO, LOCK = "manifest.json", "scenario.yaml", ".lock"
EVALUATIONS, ITERATIONS = "evaluations.jsonl", "iterations.jsonl"
IN_PROGRESS, BEST_GAIT = "in_progress.jsonl", "best_gait.json"
REEVALUATIONS = "reevaluations.jsonl"

_EVALUATION_KEYS = {
    "index": (int,),
    "iteration": (int,),
    "genome": (list,),
    "metrics": (dict,),
    "fitness": (int, float, type(None)),
    "failure": (str, type(None)),
    "wall_time_s": (int, float),
    "engine": (str,),
}
_ITERATION_KEYS = {
    "iteration": (int,),
    "evaluations": (int,),
    "mean_fitness": (int, float, type(None)),
    "best_fitness": (int, float, type(None)),
    "best_distance_in": (int, float, type(None)),
    "best_evaluation": (int, type(None)),
    "stop": (str, type(None)),
}


def trial_folder(directory: Path, number: int) -> Path:
    """Where a run keeps a trial."""
    return directory / f"trial_{number:02d}"


@dataclass(frozen=True)
class Manifest:
    """What defines a run."""

    scenario: Scenario
    seed: int
    versions: Mapping[str, str]


def read_manifest(directory: Path) -> Manifest:
    """The manifest of a run directory; InputError if there is none or it makes no sense."""
    path = directory / MANIFEST
    try:
        raw = json.loads(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError) as error:
        raise InputError(directory, "", f"holds no {MANIFEST}, so is no run") from error
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(path, "", f"cannot be read: {error}") from error
    if not isinstance(raw, dict):
        raise InputError(path, "", "expected a JSON object")
    for key, kind in (("scenario", dict), ("seed", int), ("versions", dict)):
        if not isinstance(raw.get(key), kind):
            raise InputError(path, key, "is missing or damaged")
    if raw.get("schema") != SCHEMA:
        raise InputError(path, "schema", f"found {raw.get('schema')!r}, expected {SCHEMA}")
    scenario = load_scenario(directory / SCENARIO)
    difference = _first_difference(raw["scenario"], _tree(scenario))
    if difference:
        raise InputError(directory / SCENARIO, difference.key, f"is not as in {MANIFEST}")
    return Manifest(scenario=scenario, seed=raw["seed"], versions=raw["versions"])


class RunRecord:
    """An open run directory, locked against other processes until closed."""

    def __init__(self, directory: Path, manifest: Manifest, lock: int) -> None:
        self.directory = directory
        self.scenario = manifest.scenario
        self.seed = manifest.seed
        self.versions_then = manifest.versions
        self._lock = lock

    @classmethod
    def create(cls, directory: Path, *, scenario: Scenario, seed: int) -> RunRecord:
        """Begins a run in a directory that does not exist or is empty."""
        if directory.exists() and not directory.is_dir():
            raise InputError(directory, "", "is a file, expected a run directory")
        if directory.is_dir() and (directory / MANIFEST).exists():
            raise InputError(directory, "", "holds a run already; --resume goes on with it")
        if directory.is_dir() and not _is_untouched(directory):
            raise InputError(directory, "", "is not empty, expected a new directory")
        try:
            directory.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(directory, "", f"cannot be made: {error.strerror}") from error
        lock = _lock(directory)
        try:
            if (directory / MANIFEST).exists():  # Another process was faster.
                raise InputError(directory, "", "holds a run already; --resume goes on with it")
            for leftover in (*directory.glob(".manifest.*"), *directory.glob(".scenario.*")):
                leftover.unlink()
            manifest = Manifest(scenario=scenario, seed=seed, versions=versions())
            _write_manifest(directory, manifest)
        except BaseException:
            os.close(lock)
            raise
        return cls(directory, manifest, lock)

    @classmethod
    def resume(
        cls, directory: Path, *, scenario: Scenario | None = None, seed: int | None = None
    ) -> RunRecord:
        """Opens a run to go on with it. Scenario and seed, where given, must be the run's."""
        if not directory.is_dir():
            raise InputError(directory, "", "no such run directory, nothing to resume")
        manifest = read_manifest(directory)
        if seed is not None and seed != manifest.seed:
            problem = f"the run has seed {manifest.seed}, not {seed}; leave the seed out to resume"
            raise InputError(directory, "seed", problem)
        if scenario is not None:
            difference = _first_difference(_tree(manifest.scenario), _tree(scenario))
            if difference:
                problem = f"the run has {difference.first!r}, not {difference.second!r}"
                raise InputError(
                    directory, difference.key, f"{problem}; a run is resumed with its own scenario"
                )
        return cls(directory, manifest, _lock(directory))

    def open_trial(self, number: int) -> TrialRecord:
        """The record of one trial."""
        return TrialRecord(trial_folder(self.directory, number))

    def __enter__(self) -> RunRecord:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        os.close(self._lock)


class TrialRecord:
    """The files of one trial. What is recorded already is checked instead of written."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(exist_ok=True)
        self._folder = folder
        for leftover in folder.glob(f".{Path(BEST_GAIT).stem}.*"):
            leftover.unlink()
        for name in (EVALUATIONS, ITERATIONS, IN_PROGRESS):
            repair_torn_line(folder / name)
        self._evaluations = read_lines(folder / EVALUATIONS)
        for index, entry in enumerate(self._evaluations):
            check_evaluation(entry, self._folder / EVALUATIONS, index + 1)
            if entry["index"] != index:
                self._refuse(EVALUATIONS, index, f"index is {entry['index']}, expected {index}")
        self._iterations = read_lines(folder / ITERATIONS)
        self._in_progress: dict[int, tuple[int, dict[str, Any]]] = {}
        for row, entry in enumerate(read_lines(folder / IN_PROGRESS)):
            check_evaluation(entry, self._folder / IN_PROGRESS, row + 1)
            self._in_progress[entry["index"]] = row, entry

    @property
    def recorded(self) -> int:
        """How many evaluations the record held when it was opened."""
        return len(self._evaluations)

    def recall(self, index: int, genome: Genome) -> Evaluation | None:
        """The recorded evaluation of this index, None if there is none.

        Raises InputError if it is of another genome.
        """
        if index < len(self._evaluations):
            name, row, entry = EVALUATIONS, index, self._evaluations[index]
        elif index in self._in_progress:
            name, (row, entry) = IN_PROGRESS, self._in_progress[index]
        else:
            return None
        if entry["genome"] != genome.tolist():
            self._refuse(name, row, "the genome is not the one that scenario and seed lead to")
        fitness = entry["fitness"]
        return Evaluation(
            fitness=-math.inf if fitness is None else fitness,
            metrics=entry["metrics"],
            failure=entry["failure"],
            wall_time=entry["wall_time_s"],
            engine=entry["engine"],
        )

    def keep(self, index: int, iteration: int, genome: Genome, evaluation: Evaluation) -> None:
        """Saves an evaluation whose iteration is not complete yet."""
        entry = evaluation_entry(index, iteration, genome, evaluation)
        append_lines(self._folder / IN_PROGRESS, [entry])

    def complete(self, evaluations: Sequence[dict[str, Any]], iteration: dict[str, Any]) -> None:
        """Writes an iteration's lines, or checks those that are there.

        In this order: a kill in between leaves nothing that going through the run again
        would not complete.
        """
        self._write(EVALUATIONS, self._evaluations, evaluations, first=evaluations[0]["index"])
        self._write(ITERATIONS, self._iterations, [iteration], first=iteration["iteration"])
        if evaluations[-1]["index"] >= len(self._evaluations):
            (self._folder / IN_PROGRESS).unlink(missing_ok=True)

    def save_best(self, gait: Gait) -> None:
        """Writes the best gait."""
        save_gait(gait, self._folder / BEST_GAIT)

    def finish(self, evaluations: int) -> None:
        """Checks that the record ends where the trial does."""
        if len(self._evaluations) > evaluations:
            self._refuse(EVALUATIONS, evaluations, "the trial ends before this evaluation")
        (self._folder / IN_PROGRESS).unlink(missing_ok=True)

    def _write(
        self,
        name: str,
        recorded: Sequence[dict[str, Any]],
        entries: Sequence[dict[str, Any]],
        *,
        first: int,
    ) -> None:
        for row, entry in enumerate(entries, start=first):
            if row < len(recorded) and recorded[row] != entry:
                wrong = [key for key in entry if recorded[row].get(key) != entry[key]]
                key = wrong[0] if wrong else "a key too many"
                self._refuse(name, row, f"{key} is not what scenario and seed lead to")
        missing = entries[max(0, len(recorded) - first) :]
        if missing:
            append_lines(self._folder / name, missing)

    def _refuse(self, name: str, row: int, problem: str) -> None:
        raise InputError(self._folder / name, f"line {row + 1}", f"is damaged: {problem}")


def evaluation_entry(
    index: int, iteration: int, genome: Genome, evaluation: Evaluation
) -> dict[str, Any]:
    """An evaluation as a line of the record; the fitness of a failure is null."""
    return {
        "index": index,
        "iteration": iteration,
        "genome": genome.tolist(),
        "metrics": dict(evaluation.metrics),
        "fitness": evaluation.fitness if math.isfinite(evaluation.fitness) else None,
        "failure": evaluation.failure,
        "wall_time_s": round(evaluation.wall_time, 4),
        "engine": evaluation.engine,
    }


def check_evaluation(entry: Mapping[str, Any], path: Path, line: int) -> None:
    """Raises InputError, naming file and line, where an entry is no evaluation."""
    _check_keys(_EVALUATION_KEYS, entry, path, line)


def check_iteration(entry: Mapping[str, Any], path: Path, line: int) -> None:
    """Raises InputError, naming file and line, where an entry is no iteration."""
    _check_keys(_ITERATION_KEYS, entry, path, line)


def _check_keys(
    keys: Mapping[str, tuple[type, ...]], entry: Mapping[str, Any], path: Path, line: int
) -> None:
    for key, kinds in keys.items():
        if key not in entry or not isinstance(entry[key], kinds):
            raise InputError(path, f"line {line}", f"is damaged: {key} is missing or no good")


def _write_manifest(directory: Path, manifest: Manifest) -> None:
    # The manifest comes last: it makes the directory a run.
    write_whole(directory / SCENARIO, dump_scenario(manifest.scenario))
    content = {
        "schema": SCHEMA,
        "seed": manifest.seed,
        "versions": dict(manifest.versions),
        "scenario": _tree(manifest.scenario),
    }
    write_whole(directory / MANIFEST, json.dumps(content, indent=1) + "\n")


def _tree(scenario: Scenario) -> dict[str, Any]:
    tree: dict[str, Any] = yaml.safe_load(dump_scenario(scenario))
    return tree


def _is_untouched(directory: Path) -> bool:
    """Whether nothing is there but what a run killed in its first moment leaves."""
    ours = (LOCK, SCENARIO, ".manifest.", ".scenario.")
    return all(entry.name.startswith(ours) for entry in directory.iterdir())


def _lock(directory: Path) -> int:
    """Takes the run's lock, which the system lets go of whenever this process ends."""
    try:
        lock = os.open(directory / LOCK, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        raise InputError(directory, "", f"cannot be written to: {error.strerror}") from error
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(lock)
        taken = isinstance(error, BlockingIOError)
        problem = "another process is at work on this run" if taken else "cannot be locked"
        raise InputError(directory, "", problem) from error
    return lock


@dataclass(frozen=True)
class _Difference:
    key: str
    first: Any
    second: Any


def _first_difference(
    first: Mapping[str, Any], second: Mapping[str, Any], prefix: str = ""
) -> _Difference | None:
    for key in [*first, *(key for key in second if key not in first)]:
        ours, theirs = first.get(key), second.get(key)
        if isinstance(ours, dict) and isinstance(theirs, dict):
            difference = _first_difference(ours, theirs, f"{prefix}{key}.")
            if difference:
                return difference
        elif ours != theirs:
            return _Difference(f"{prefix}{key}", ours, theirs)
    return None
