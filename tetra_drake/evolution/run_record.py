"""Record of a run on disk: begins, writes, checks and resumes it.

    manifest.json, scenario.yaml    definition of the run; see evolution.manifest
    .lock                           locked while a process works on the run
    trial_00/ ...                   see evolution.entries

Evaluations are written to evaluations.jsonl iteration by iteration, so their order does not depend
on which simulation was finished first. A run is resumed by repeating it from the start, with
recorded fitnesses in place of simulations. Every vector and every line must be as recorded.
Therefore resuming needs the same versions of the packages and the same kind of processor.
"""

from __future__ import annotations

import contextlib
import fcntl
import shutil
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, BinaryIO

from tetra_drake.errors import InputError
from tetra_drake.evolution.entries import (
    EVALUATIONS,
    IN_PROGRESS,
    ITERATIONS,
    RecordFile,
    evaluation_entry,
    recorded_evaluation,
)
from tetra_drake.evolution.manifest import (
    MANIFEST,
    Manifest,
    Method,
    read_manifest,
    write_manifest,
)
from tetra_drake.files import check_file, check_folder, make_folder
from tetra_drake.laws.height_files import RECORDED
from tetra_drake.optimizers.base import Evaluation, Task
from tetra_drake.robot.gait import Vector
from tetra_drake.scenario.load import SCENARIO
from tetra_drake.scenario.scenario import Scenario

LOCK = ".lock"

_ASIDE = ".replaced"
"""Folder that holds the old run while it is replaced."""

_Lines = Sequence[dict[str, Any]]


class RunRecord(contextlib.AbstractContextManager["RunRecord"]):
    """A run directory, locked against other processes until the end of its `with` block. A new run
    is locked from begin() on."""

    def __init__(self, directory: Path, manifest: Manifest, lock: BinaryIO | None = None) -> None:
        """See create() and resume()."""
        self.directory = directory
        self.manifest = manifest
        self.begun = False
        """True if the manifest is written."""
        self._lock = lock

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
        run, unless a process is working on it. begin() writes the first file."""
        method = method or Method.of(scenario)
        manifest = Manifest.of(scenario, seed, method, reevaluate=reevaluate)
        check_folder(directory)
        if not overwrite or _is_empty(directory):
            _check_empty(directory)
            return cls(directory, manifest)
        read_manifest(directory)
        return cls(directory, manifest, _locked(directory))

    @classmethod
    def resume(
        cls,
        directory: Path,
        *,
        scenario: Scenario | None = None,
        seed: int | None = None,
        method: Method | None = None,
    ) -> RunRecord:
        """Opens a run to continue it. A given scenario, seed or method must be equal to the
        run's."""
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
        record = cls(directory, manifest, _locked(directory))
        record.begun = True
        return record

    def begin(self) -> None:
        """Writes the manifest, if it is not written yet. Deletes the run that is overwritten, which
        comes back if the manifest cannot be written."""
        if self.begun:
            return
        if self._lock is None:
            make_folder(self.directory)
            self._lock = _locked(self.directory)
            _check_empty(self.directory)  # another process may have been faster
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
            for file in aside.iterdir():
                file.replace(self.directory / file.name)
            raise
        finally:
            shutil.rmtree(aside)
        self.begun = True

    def __exit__(self, *_: object) -> None:
        if self._lock is not None:
            self._lock.close()


_NOT_REPEATED = (
    "{} is not what scenario and seed lead to here; resume the run with the versions of the "
    "packages and on the kind of processor it was begun with"
)


class TrialRecord:
    """The files of one trial. Lines that are recorded already are checked, not written again."""

    def __init__(self, run: RunRecord, number: int) -> None:
        self._run = run
        self._files: dict[str, RecordFile] = {}
        self._lines: dict[str, _Lines] = {}
        """Recorded lines of each file."""
        for name in (EVALUATIONS, ITERATIONS, IN_PROGRESS):
            file = RecordFile.of(run.directory, run.manifest.run, name, trial=number)
            if run.begun:
                file.repair()
            self._files[name] = file
            self._lines[name] = file.read() if run.begun else ()
        self._recorded: dict[int, tuple[str, int]] = {}
        """File and row of each recorded evaluation, by its index."""
        for name in (IN_PROGRESS, EVALUATIONS):
            for row, entry in enumerate(self._lines[name]):
                self._recorded[entry["index"]] = name, row

    def recall(self, index: int, vector: Vector) -> Evaluation | None:
        """The recorded evaluation with this index, or None. Raises InputError if it was recorded
        for another vector."""
        if index not in self._recorded:
            return None
        name, row = self._recorded[index]
        entry = self._lines[name][row]
        if entry["genome"] != vector.tolist():
            self._files[name].refuse(row, _NOT_REPEATED.format("the genome"))
        return recorded_evaluation(entry)

    def keep(self, task: Task, evaluation: Evaluation) -> None:
        """Saves an evaluation of an incomplete iteration."""
        self._append(IN_PROGRESS, [evaluation_entry(task, evaluation)])

    def complete(
        self,
        results: Iterable[tuple[Task, Evaluation]],
        iteration: dict[str, Any],
        *,
        placed: Sequence[int | None] | None,
    ) -> None:
        """Writes the lines of an iteration; lines that are recorded already are checked. For
        `placed` see optimizers.base.Iteration."""
        evaluations = [evaluation_entry(*result) for result in results]
        if placed is not None:
            for entry, member in zip(evaluations, placed, strict=True):
                entry["placed"] = member
        # The order matters: after a kill in between, a resumed run completes the files.
        self._write(EVALUATIONS, evaluations, first=evaluations[0]["index"])
        self._write(ITERATIONS, [iteration], first=iteration["iteration"])
        if evaluations[-1]["index"] >= len(self._lines[EVALUATIONS]):
            self._files[IN_PROGRESS].path.unlink(missing_ok=True)

    def finish(self, evaluations: int) -> None:
        """Checks that the record has no evaluations beyond the end of the trial."""
        if len(self._lines[EVALUATIONS]) > evaluations:
            self._files[EVALUATIONS].refuse(evaluations, "the trial ends before this evaluation")
        self._files[IN_PROGRESS].path.unlink(missing_ok=True)

    def _write(self, name: str, entries: _Lines, *, first: int) -> None:
        recorded = self._lines[name][first:]
        for row, (ours, entry) in enumerate(zip(recorded, entries, strict=False), start=first):
            for key in ours | entry:
                if ours.get(key) != entry.get(key):
                    self._files[name].refuse(row, _NOT_REPEATED.format(key))
        if missing := entries[len(recorded) :]:
            self._append(name, missing)

    def _append(self, name: str, entries: _Lines) -> None:
        self._run.begin()
        self._files[name].append(entries)


def _is_empty(directory: Path) -> bool:
    """True if a directory is empty, or has only the files of a process killed in begin()."""
    ours = (LOCK, SCENARIO, _ASIDE, ".manifest.", ".scenario.", ".heights-")
    names = [file.name for file in directory.iterdir()] if directory.is_dir() else []
    return all(name.startswith(ours) or RECORDED.fullmatch(name) for name in names)


def _check_empty(directory: Path) -> None:
    """Raises InputError if a directory holds a run or anything else."""
    if (directory / MANIFEST).exists():
        problem = "holds a run already; to go on with it, use --resume (in Python, resume=True)"
        raise InputError(directory, "", problem)
    if not _is_empty(directory):
        raise InputError(directory, "", "is not empty, expected a new directory")


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
