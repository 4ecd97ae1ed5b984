"""A run's record on disk: how it is begun, written, checked and resumed.

    manifest.json, scenario.yaml    what defines the run; see evolution.manifest
    .lock                           locked while a process is at work on the run
    trial_00/ ...                   see evolution.entries

Evaluations become final lines iteration by iteration, so the record does not depend on
which of them was ready first. A run is resumed by repeating it from the start with recorded
fitnesses in place of simulations; every vector and every line must come out as recorded. So it goes
on with the same versions of the packages and on the same kind of processor only.
"""

from __future__ import annotations

import contextlib
import fcntl
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, NoReturn

from tetra_drake.errors import InputError
from tetra_drake.evolution.entries import (
    BEST_GAIT,
    EVALUATIONS,
    IN_PROGRESS,
    ITERATIONS,
    read_entries,
    recorded_evaluation,
)
from tetra_drake.evolution.json_lines import append_lines, repair_torn_line
from tetra_drake.evolution.manifest import (
    MANIFEST,
    SCENARIO,
    Manifest,
    Method,
    read_manifest,
    write_manifest,
)
from tetra_drake.files import check_folder, make_folder
from tetra_drake.machine import versions
from tetra_drake.optimizers.base import Evaluation
from tetra_drake.robot.gait import Gait, Vector, save_gait
from tetra_drake.scenario.schema import Scenario

LOCK = ".lock"

_Lines = Sequence[dict[str, Any]]


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
        now = versions(scenario.engine.packages)
        manifest = Manifest(scenario, seed, now, method or Method.of(scenario))
        check_folder(directory)
        _refuse_a_used(directory)
        make_folder(directory)
        with contextlib.ExitStack() as undo:
            lock = undo.enter_context(_lock(directory))
            _refuse_a_used(directory)  # Another process may have been faster.
            write_manifest(directory, manifest)
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
            for key, value in manifest.scenario.differences(scenario):
                problem = f"the run has {value}; it is resumed with its own scenario"
                raise InputError(directory, key, problem)
        if method is not None:
            manifest.method.check_same(method, directory)
        return cls(directory, manifest, _lock(directory))

    @staticmethod
    def remove(directory: Path) -> None:
        """Removes a run with all that its directory holds, if there is such a directory.

        Raises InputError if it holds no run, or if a process is at work on it.
        """
        if directory.exists():
            read_manifest(directory)
            with _lock(directory):
                shutil.rmtree(directory)

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
        for name in (EVALUATIONS, ITERATIONS, IN_PROGRESS):
            repair_torn_line(folder / name)
        self._folder = folder
        self._evaluations = read_entries(folder / EVALUATIONS)
        self._iterations = read_entries(folder / ITERATIONS)
        self._recorded: dict[int, tuple[str, int, dict[str, Any]]] = {}
        """File, row and entry of each evaluation, by its index."""
        for row, entry in enumerate(read_entries(folder / IN_PROGRESS)):
            self._recorded[entry["index"]] = IN_PROGRESS, row, entry
        for row, entry in enumerate(self._evaluations):
            self._recorded[row] = EVALUATIONS, row, entry

    def recall(self, index: int, vector: Vector) -> Evaluation | None:
        """The recorded evaluation of this index, None if there is none; InputError if it is of
        another vector."""
        if index not in self._recorded:
            return None
        name, row, entry = self._recorded[index]
        if entry["genome"] != vector.tolist():
            self._refuse(name, row, _NOT_REPEATED.format("the genome"))
        return recorded_evaluation(entry)

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
        missing = []
        for row, entry in enumerate(entries, start=first):
            if row >= len(recorded):
                missing.append(entry)
                continue
            for key in recorded[row] | entry:
                if recorded[row].get(key) != entry.get(key):
                    self._refuse(name, row, _NOT_REPEATED.format(key))
        if missing:
            append_lines(self._folder / name, missing)

    def _refuse(self, name: str, row: int, problem: str) -> NoReturn:
        raise InputError(self._folder / name, f"line {row + 1}", problem)


def _refuse_a_used(directory: Path) -> None:
    """Raises InputError if more is there than a run killed in its first moment leaves."""
    if (directory / MANIFEST).exists():
        problem = "holds a run already; to go on with it, use --resume (in Python, resume=True)"
        raise InputError(directory, "", problem)
    ours = (LOCK, SCENARIO, ".manifest.", ".scenario.")
    if directory.is_dir() and not all(f.name.startswith(ours) for f in directory.iterdir()):
        raise InputError(directory, "", "is not empty, expected a new directory")


def _lock(directory: Path) -> BinaryIO:
    """The run's locked file, which the system releases whenever this process ends; InputError if
    another process has locked it."""
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
