"""Trials of a run: each has an optimiser, a record and a state. Also the loop over all trials.

Evaluations are recorded iteration by iteration, so their order does not depend on which simulation
was finished first. A run is resumed by repeating it from the start, with recorded fitnesses in
place of simulations. Every vector and every line must be as recorded. Therefore resuming needs the
same versions of the packages and the same kind of processor.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from tetra_drake.errors import InputError
from tetra_drake.evolution.entries import (
    BEST_GAIT,
    EVALUATIONS,
    IN_PROGRESS,
    ITERATIONS,
    EvaluationLine,
    IterationLine,
    Line,
    RecordFile,
    first_problem,
    trial_folder,
)
from tetra_drake.evolution.evaluators import Submit, evaluate_all, finished
from tetra_drake.evolution.manifest import RunRecord
from tetra_drake.optimizers import optimizer_of
from tetra_drake.optimizers.base import Evaluation, MakeOptimizer, Optimizer, Task
from tetra_drake.robot.gait import ParameterSpace, Vector, save_gait
from tetra_drake.settings.units import INCHES, Units

_SHOW_PERIOD = 1.0  # s

ALL_DONE = "all evaluations done"
"""Reason for the end of a trial whose optimiser did not stop earlier."""

_NOT_REPEATED = (
    "{} is not what scenario and seed lead to here; resume the run with the versions of the "
    "packages and on the kind of processor it was begun with"
)


@dataclass
class TrialStatus:
    """State of a trial, running or recorded."""

    number: int
    evaluations_at_most: int
    """Number of evaluations if the trial does not end early."""
    iteration: int = -1
    """The last complete iteration; 0 is the initial population, -1 is none."""
    evaluations: int = 0
    failures: int = 0
    wall_time: float = 0.0
    """Sum of the wall times of all evaluations, in s."""
    best_fitness: float = -math.inf
    best_distance: float = math.nan
    """Distance (m) of the fittest gait; NaN if no gait has a fitness yet."""
    units: Units = INCHES
    """Units of the shown distance."""
    stop: str | None = None
    """Reason for the trial's end; None during the trial."""


_Evaluated = tuple[Task, Evaluation]


class TrialRecord:
    """Files of a trial. Lines that are recorded already are checked, not written again."""

    def __init__(self, run: RunRecord, number: int) -> None:
        self._run = run
        self._files: dict[str, RecordFile] = {}
        self._lines: dict[str, list[Any]] = {}
        """Recorded lines of each file."""
        for name in (EVALUATIONS, ITERATIONS, IN_PROGRESS):
            file = RecordFile.of(run.directory, run.manifest.run, name, trial=number)
            if run.begun:
                file.repair()
            self._files[name] = file
            self._lines[name] = file.read() if run.begun else []
        self._recorded: dict[int, tuple[str, int]] = {}
        """File and row of each recorded evaluation, by its index."""
        for name in (IN_PROGRESS, EVALUATIONS):
            for row, line in enumerate(self._lines[name]):
                self._recorded[line.index] = name, row

    def recall(self, index: int, vector: Vector) -> Evaluation | None:
        """The recorded evaluation with this index, or None. Raises InputError if it was recorded
        for another vector."""
        if index not in self._recorded:
            return None
        name, row = self._recorded[index]
        line: EvaluationLine = self._lines[name][row]
        if line.genome != vector.tolist():
            self._files[name].refuse(row, _NOT_REPEATED.format("the genome"))
        return line.evaluation()

    def keep(self, task: Task, evaluation: Evaluation) -> None:
        """Saves an evaluation of an incomplete iteration."""
        self._run.begin()
        self._files[IN_PROGRESS].append([EvaluationLine.of(task, evaluation)])

    def complete(
        self,
        results: Sequence[_Evaluated],
        iteration: Mapping[str, Any],
        *,
        placed: Sequence[int | None] | None,
    ) -> None:
        """Writes the lines of an iteration; lines that are recorded already are checked. For
        `placed` see optimizers.base.Iteration. Raises InputError if an optimiser from Python
        reports what cannot be recorded."""
        more: list[dict[str, Any]] = [{} for _ in results]
        if placed is not None:
            more = [{"placed": member} for member in placed]
        try:
            evaluations = [
                EvaluationLine.of(task, evaluation, **keys)
                for (task, evaluation), keys in zip(results, more, strict=True)
            ]
            last = IterationLine.model_validate(iteration)
        except ValidationError as error:
            raise InputError("optimizer", *first_problem(error)) from error
        # The order matters: after a kill in between, a resumed run completes the files.
        self._write(EVALUATIONS, evaluations, first=evaluations[0].index)
        self._write(ITERATIONS, [last], first=last.iteration)
        if evaluations[-1].index >= len(self._lines[EVALUATIONS]):
            self._files[IN_PROGRESS].path.unlink(missing_ok=True)

    def finish(self, evaluations: int) -> None:
        """Checks that the record has no evaluations beyond the end of the trial."""
        if len(self._lines[EVALUATIONS]) > evaluations:
            self._files[EVALUATIONS].refuse(evaluations, "the trial ends before this evaluation")
        self._files[IN_PROGRESS].path.unlink(missing_ok=True)

    def _write(self, name: str, lines: Sequence[Line], *, first: int) -> None:
        recorded = self._lines[name][first:]
        for row, (theirs, ours) in enumerate(zip(recorded, lines, strict=False), start=first):
            then, now = theirs.content(), ours.content()
            for key in then | now:
                if then.get(key) != now.get(key):
                    self._files[name].refuse(row, _NOT_REPEATED.format(key))
        if missing := lines[len(recorded) :]:
            self._run.begin()
            self._files[name].append(missing)


class Trial:
    """One optimisation of a run, with its record.

    Evaluations arrive in any order; the optimiser gets them in the order of its vectors. The trial
    ends after `evolution.evaluations` evaluations, or when the optimiser stops. The constructor
    repeats the recorded iterations, without simulation.
    """

    def __init__(self, number: int, *, run: RunRecord, optimizer: Optimizer) -> None:
        self._manifest = run.manifest
        self._best_gait = trial_folder(run.directory, number) / BEST_GAIT
        scenario = self._manifest.scenario
        self.status = TrialStatus(number, scenario.evolution.evaluations, units=scenario.units)
        self.unevaluated: dict[int, Task] = {}
        """Tasks that the current iteration waits for, by index; empty at the end of the trial."""
        self.recalled: _Evaluated | None = None
        """The first recorded task with a fitness."""
        self._optimizer = optimizer
        self._record = TrialRecord(run, number)
        self._results: dict[int, _Evaluated] = {}
        """Evaluated tasks of the current iteration, by index."""
        self._best: _Evaluated | None = None
        self._saved: _Evaluated | None = None
        """The task and evaluation that best_gait.json holds."""
        self._advance()

    def take(self, task: Task, evaluation: Evaluation) -> bool:
        """Takes an evaluation. Returns True if it completes the iteration."""
        del self.unevaluated[task.index]
        self._add(task, evaluation)
        if self.unevaluated:
            self._record.keep(task, evaluation)
            return False
        self._complete()
        self._advance()
        return True

    def _advance(self) -> None:
        """Runs recorded iterations, up to the first unrecorded vectors or the trial's end."""
        while self.status.stop is None:
            self._results = {}
            first, trial = self.status.evaluations, self.status.number
            iteration = self.status.iteration + 1
            batch = self._optimizer.ask()[: self.status.evaluations_at_most - first]
            for index, vector in enumerate(batch, start=first):
                task = self._manifest.task(vector, trial=trial, index=index, iteration=iteration)
                evaluation = self._record.recall(index, vector)
                if evaluation is None:
                    self.unevaluated[index] = task
                    continue
                self._add(task, evaluation)
                if self.recalled is None and evaluation.failure is None:
                    self.recalled = task, evaluation
            if self.unevaluated:
                break
            self._complete()
        else:
            self._record.finish(self.status.evaluations)
        if self._best is not None and self._best is not self._saved:
            task, _ = self._saved = self._best
            gait = self._manifest.gait(task.vector, trial=task.trial, index=task.index)
            save_gait(gait, self._best_gait, self._manifest.scenario)

    def _add(self, task: Task, evaluation: Evaluation) -> None:
        status = self.status
        self._results[task.index] = task, evaluation
        status.evaluations += 1
        status.failures += evaluation.failure is not None
        status.wall_time += evaluation.wall_time

    def _complete(self) -> None:
        """Ends an iteration: tells the optimiser its evaluations, and records it."""
        results, status = [self._results[index] for index in sorted(self._results)], self.status
        outcome = self._optimizer.tell([evaluation for _, evaluation in results])
        for task, evaluation in results:
            if evaluation.fitness > status.best_fitness:
                self._best = task, evaluation
                status.best_fitness = evaluation.fitness
                status.best_distance = evaluation.metrics.get("distance", math.nan)
        all_done = status.evaluations == status.evaluations_at_most
        line = {
            "iteration": status.iteration + 1,
            "evaluations": status.evaluations,
            "best_fitness": None if self._best is None else status.best_fitness,
            "best_evaluation": None if self._best is None else self._best[0].index,
            "stop": ALL_DONE if all_done else outcome.stop,
            **outcome.report,
        }
        self._record.complete(results, line, placed=outcome.placed)
        status.iteration, status.stop = line["iteration"], line["stop"]


def open_trials(record: RunRecord, *, optimizer: MakeOptimizer | None = None) -> list[Trial]:
    """All trials of a record, each at the end of its recorded part.

    The default optimiser is the scenario's. Trials are independent: their number does not change
    their results.
    """
    scenario = record.manifest.scenario
    make = optimizer or optimizer_of(scenario.optimizer)
    space = ParameterSpace.of(scenario)
    seeds = np.random.SeedSequence(record.manifest.seed).spawn(scenario.evolution.trials)
    trials = []
    for number, seed in enumerate(seeds):
        made = make(space, scenario.evolution, np.random.default_rng(seed))
        trials.append(Trial(number, run=record, optimizer=made))
    return trials


def run_trials(
    trials: Sequence[Trial],
    submit: Submit,
    *,
    show: Callable[[Sequence[TrialStatus]], None] = lambda statuses: None,
) -> list[TrialStatus]:
    """Runs all trials to their ends.

    The record depends only on scenario, method and seed. It does not depend on the evaluator or on
    interruptions.
    """
    statuses = [trial.status for trial in trials]
    show(statuses)
    tasks = [task for trial in trials for task in trial.unevaluated.values()]
    running = {submit(task): task for task in tasks}
    while running:
        for task, evaluation in finished(running, _SHOW_PERIOD):
            trial = trials[task.trial]
            if trial.take(task, evaluation):
                running |= {submit(new): new for new in trial.unevaluated.values()}
        show(statuses)
    return statuses


def check_fitness(trials: Sequence[Trial], directory: Path, submit: Submit) -> None:
    """Evaluates the first recorded gait with a fitness again. Raises InputError if its fitness
    differs, so that a record never mixes two objectives."""
    recalled = [trial.recalled for trial in trials if trial.recalled is not None]
    if not recalled:
        return
    task, recorded = recalled[0]
    ((_, again),) = evaluate_all(submit, [task])
    if again.fitness != recorded.fitness:
        outcome = again.failure or f"fitness {again.fitness!r}"
        found = f"{task} has fitness {recorded.fitness!r}, and evaluated again {outcome}"
        same = "the objective, the versions of the packages and the kind of processor"
        problem = f"{found}; resume the run with {same} it was begun with"
        raise InputError(directory, "objective", problem)
