"""A run's record on disk: its files, their checks, and how a run is resumed.

    manifest.json             seed, versions, method (objective, optimiser), SHA-256 of
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
fitnesses in place of simulations; every vector and every line must come out as recorded. So it goes
on with the same versions of the packages and on the same kind of processor only.
"""

from __future__ import annotations

import contextlib
import dataclasses
import fcntl
import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, NoReturn

from tetra_drake.errors import InputError
from tetra_drake.evolution.json_lines import REMEDY, append_lines, read_lines, repair_torn_line
from tetra_drake.evolution.method import Method
from tetra_drake.files import check_folder, json_number, make_folder, read_text, write_whole
from tetra_drake.machine import versions
from tetra_drake.optimizers.base import Evaluation
from tetra_drake.robot.gait import Gait, Vector, save_gait
from tetra_drake.scenario.load import differences, dump_scenario, load_scenario
from tetra_drake.scenario.optimizer_kinds import SteadyState
from tetra_drake.scenario.schema import Scenario

_Lines = Sequence[dict[str, Any]]

SCHEMA = 3
MANIFEST, SCENARIO, LOCK = "manifest.json", "scenario.yaml", ".lock"
EVALUATIONS, ITERATIONS = "evaluations.jsonl", "iterations.jsonl"
IN_PROGRESS, BEST_GAIT = "in_progress.jsonl", "best_gait.json"
REEVALUATIONS, ELITES = "reevaluations.jsonl", "elites.jsonl"


def _is_count(value: Any) -> bool:
    return type(value) is int and 0 <= value < 2**63


def _is_number(value: Any) -> bool:
    return type(value) in (int, float) and abs(value) < 1e300


def _are_numbers(value: Any) -> bool:
    return isinstance(value, list) and all(_is_number(item) for item in value)


def _are_metrics(value: Any) -> bool:
    return isinstance(value, dict) and all(_is_metric(*item) for item in value.items())


def _is_metric(name: str, value: Any) -> bool:
    if name == "lifted_shares":
        return _are_numbers(value)
    return _is_number(value) or (value is None and name != "distance")


def _are_draws(value: Any) -> bool:
    return isinstance(value, dict) and all(
        _are_numbers(value.get(key)) and value[key] for key in _DRAWS
    )


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


def _or_none(check: Callable[[Any], bool]) -> Callable[[Any], bool]:
    return lambda value: value is None or check(value)


_DRAWS = ("fitness", "distance")
_ITERATION: dict[str, Callable[[Any], bool]] = {
    "iteration": _is_count,
    "evaluations": _is_count,
    "best_fitness": _or_none(_is_number),
    "best_evaluation": _or_none(_is_count),
    "stop": _or_none(_is_text),
}
_EVALUATION: dict[str, Callable[[Any], bool]] = {
    "index": _is_count,
    "iteration": _is_count,
    "genome": _or_none(_are_numbers),
    "metrics": _are_metrics,
    "fitness": _or_none(_is_number),
    "failure": _or_none(_is_text),
    "wall_time_s": _is_number,
    "engine": _is_text,
}
_ELITE: dict[str, Callable[[Any], bool]] = {
    "trial": _is_count,
    "index": _is_count,
    "kept": _is_number,
    "mean_distance": _or_none(_is_number),
}
_OPTIONAL: dict[str, Callable[[Any], bool]] = {
    "draws": _are_draws,
    "placed": _or_none(_is_count),
    "mean_fitness": _or_none(_is_number),
}
"""What a line may have besides: draws where there are disturbances, the others by optimiser."""
_WANTED = {ITERATIONS: _ITERATION, ELITES: _ELITE}
_NUMBERED = {EVALUATIONS: "index", ITERATIONS: "iteration"}
"""What counts the lines of a file."""
_MANIFEST: dict[str, Callable[[Any], bool]] = {
    "seed": lambda value: type(value) is int and value >= 0,
    "versions": lambda value: isinstance(value, dict),
    "thinned": lambda value: value in (None, False, True),
}


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
        if kind is SteadyState or self.method.optimizer != kind.__name__:
            return f"{settings.max_iterations} iterations, population {settings.population}"
        return f"{settings.budget} evaluations"


def read_manifest(directory: Path) -> Manifest:
    """The manifest of a run directory; InputError if there is none or it is damaged."""
    path, scenario_file = directory / MANIFEST, directory / SCENARIO
    if not path.exists():
        raise InputError(directory, "", f"holds no {MANIFEST}, so it is not a run")
    text = read_text(path, "manifest of a run")
    try:
        raw = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(path, "", f"cannot be read: {error}") from error
    schema = raw.get("schema") if isinstance(raw, dict) else None
    if schema != SCHEMA:
        raise InputError(path, "schema", f"found {schema!r}, expected {SCHEMA}")
    for key, holds in _MANIFEST.items():
        if not holds(raw.get(key)):
            raise InputError(path, key, "is missing or damaged")
    scenario = load_scenario(scenario_file)
    if raw.get("scenario_sha256") != _sha256(read_text(scenario_file, "scenario file")):
        raise InputError(scenario_file, "", f"is not what {MANIFEST} says: it was changed")
    method = Method.from_json(raw, path)
    return Manifest(scenario, raw["seed"], raw["versions"], method, raw.get("thinned") is True)


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
        make_folder(directory)
        with contextlib.ExitStack() as undo:
            lock = undo.enter_context(_lock(directory))
            _refuse_a_used(directory)  # Another process may have been faster.
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


_NOT_REPEATED = (
    "{} is not what scenario and seed lead to here; resume the run with the versions of the "
    "packages and on the kind of processor it was begun with"
)


class TrialRecord:
    """The files of one trial. What is recorded already is checked instead of written."""

    def __init__(self, folder: Path) -> None:
        make_folder(folder)
        self._folder = folder
        for name in (EVALUATIONS, ITERATIONS, IN_PROGRESS):
            repair_torn_line(folder / name)
        self._evaluations = read_entries(folder / EVALUATIONS, checksums=True)
        self._iterations = read_entries(folder / ITERATIONS, checksums=True)
        in_progress = read_entries(folder / IN_PROGRESS, checksums=True)
        self._in_progress = {entry["index"]: (i, entry) for i, entry in enumerate(in_progress)}

    def recall(self, index: int, vector: Vector) -> Evaluation | None:
        """The recorded evaluation of this index, None if there is none; InputError if it is of
        another vector."""
        name, row, entry = self._find(index)
        if entry is None:
            return None
        if entry["genome"] != vector.tolist():
            self._refuse(name, row, _NOT_REPEATED.format("the genome"))
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
            key = next((key for key in there | entry if there.get(key) != entry.get(key)), None)
            if key is not None:
                self._refuse(name, row, _NOT_REPEATED.format(key))
        if missing := entries[max(0, len(recorded) - first) :]:
            append_lines(self._folder / name, missing)

    def _refuse(self, name: str, row: int, problem: str) -> None:
        raise InputError(self._folder / name, f"line {row + 1}", problem)


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


def first_with_fitness(directory: Path, trials: int) -> tuple[int, dict[str, Any]] | None:
    """Trial and entry of the first recorded evaluation that has a fitness; None without any."""
    for trial in range(trials):
        for name in (EVALUATIONS, IN_PROGRESS):
            for entry in read_entries(trial_folder(directory, trial) / name):
                if entry["fitness"] is not None and entry["genome"] is not None:
                    return trial, entry
    return None


def read_entries(path: Path, *, checksums: bool = False) -> list[dict[str, Any]]:
    """The lines of a file of a record; InputError, naming file and line, where one is damaged; with
    `checksums`, also where it lacks that."""
    wanted = _WANTED.get(path.name, _EVALUATION)
    entries, counter = read_lines(path, checksums=checksums), _NUMBERED.get(path.name)
    for row, entry in enumerate(entries):
        checks = wanted | {key: check for key, check in _OPTIONAL.items() if key in entry}
        for key, check in checks.items():
            if key not in entry or not check(entry[key]):
                _refuse(path, row, f"{key} is missing or invalid")
        if counter and entry[counter] != row:
            _refuse(path, row, f"{counter} is {entry[counter]}, expected {row}")
    return entries


def _refuse(path: Path, row: int, problem: str) -> NoReturn:
    raise InputError(path, f"line {row + 1}", f"is damaged: {problem}; {REMEDY}")


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
