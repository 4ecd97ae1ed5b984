"""Trials of a run: each has an optimiser, a record and a state. Also the loop over all trials.

Evaluations are recorded iteration by iteration, so their order does not depend on which simulation
was finished first. A run is resumed by repeating it from the start, with recorded fitnesses in
place of simulations. Every vector and every line must be as recorded. Therefore resuming needs the
same versions of the packages and the same kind of processor.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from tetra_drake.errors import InputError
from tetra_drake.evolution.entries import (
    BEST_GAIT,
    BEST_SCENARIO,
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
from tetra_drake.files import write_whole
from tetra_drake.optimizers import optimizer_of
from tetra_drake.optimizers.base import Evaluation, MakeOptimizer, Optimizer, Task
from tetra_drake.robot.gait_file import save_gait
from tetra_drake.robot.parameter_space import ParameterSpace, with_body
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


class RepeatedFile:
    """A file of a trial's record. When a run is resumed, its optimiser is repeated from the start:
    lines that the file already has are compared with the repeated ones, and only new lines are
    written."""

    def __init__(self, run: RunRecord, trial: int, name: str) -> None:
        self._run = run
        self.file = RecordFile.of(run.directory, run.manifest.run, name, trial=trial)
        self.lines: list[Any] = []
        """Lines that were recorded before."""
        if run.begun:
            self.file.repair()
            self.lines = list(self.file.read())

    def write(self, lines: Sequence[Line], *, first: int) -> None:
        """Records `lines`; the first of them is line `first` of the file, counted from 0. Lines
        that the file held when it was opened are only compared; the others are appended. Raises
        InputError if a compared line differs."""
        recorded = self.lines[first:]
        for row, (theirs, ours) in enumerate(zip(recorded, lines, strict=False), start=first):
            then, now = theirs.content(), ours.content()
            for key in then | now:
                if then.get(key) != now.get(key):
                    self.file.refuse(row, _NOT_REPEATED.format(key))
        if missing := lines[len(recorded) :]:
            self._run.begin()
            self.file.append(missing)


_Evaluated = tuple[Task, Evaluation]


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
        """The first recorded task with a fitness, and its evaluation; None if there is none."""
        self._optimizer = optimizer
        self._evaluations = RepeatedFile(run, number, EVALUATIONS)
        self._iterations = RepeatedFile(run, number, ITERATIONS)
        self._in_progress = RepeatedFile(run, number, IN_PROGRESS)
        self._recorded: dict[int, tuple[RecordFile, int, EvaluationLine]] = {}
        """File, number and line of each recorded evaluation, by its index."""
        for repeated in (self._in_progress, self._evaluations):
            for row, line in enumerate(repeated.lines):
                self._recorded[line.index] = repeated.file, row, line
        self._results: dict[int, _Evaluated] = {}
        """Evaluated tasks of the current iteration, by index."""
        self._best: _Evaluated | None = None
        self._saved: _Evaluated | None = None
        """The task and evaluation that best_gait.json holds."""
        self._advance()

    def take(self, task: Task, evaluation: Evaluation) -> bool:
        """Takes the evaluation of a task. Returns True if it completes the iteration; then
        `unevaluated` has the tasks of the next iteration."""
        del self.unevaluated[task.index]
        self._add(task, evaluation)
        if self.unevaluated:
            lines = self._in_progress.lines
            self._in_progress.write([EvaluationLine.of(task, evaluation)], first=len(lines))
            return False
        self._complete()
        self._advance()
        return True

    def _advance(self) -> None:
        """Goes through iterations whose evaluations are all on record: the optimiser gets the
        recorded evaluations, and nothing is simulated. Ends at the first iteration that needs
        simulations (`unevaluated` has its tasks) or at the trial's end. Then saves the best
        gait."""
        status = self.status
        while status.stop is None:
            self._results = {}
            first = status.evaluations
            batch = self._optimizer.ask()[: status.evaluations_at_most - first]
            for index, vector in enumerate(batch, start=first):
                task = self._manifest.task(
                    vector, trial=status.number, index=index, iteration=status.iteration + 1
                )
                if index not in self._recorded:
                    self.unevaluated[index] = task
                    continue
                file, row, line = self._recorded[index]
                if line.genome != vector.tolist():
                    file.refuse(row, _NOT_REPEATED.format("the genome"))
                evaluation = line.evaluation()
                self._add(task, evaluation)
                if self.recalled is None and evaluation.failure is None:
                    self.recalled = task, evaluation
            if self.unevaluated:
                break
            self._complete()
        else:
            if len(self._evaluations.lines) > status.evaluations:
                problem = "the trial ends before this evaluation"
                self._evaluations.file.refuse(status.evaluations, problem)
            self._in_progress.file.path.unlink(missing_ok=True)

        if self._best is not None and self._best is not self._saved:
            task, _ = self._saved = self._best
            gait = self._manifest.gait(task.vector, trial=task.trial, index=task.index)
            save_gait(gait, self._best_gait, self._manifest.scenario)
            if gait.body:
                found, _ = with_body(self._manifest.scenario, gait)
                write_whole(self._best_gait.with_name(BEST_SCENARIO), found.to_yaml())

    def _add(self, task: Task, evaluation: Evaluation) -> None:
        status = self.status
        self._results[task.index] = task, evaluation
        status.evaluations += 1
        status.failures += evaluation.failure is not None
        status.wall_time += evaluation.wall_time

    def _complete(self) -> None:
        """Ends an iteration: passes its evaluations to the optimiser, and writes the lines of the
        iteration to the record. Raises InputError if the report of a user's own optimiser cannot be
        written as JSON."""
        results, status = [self._results[index] for index in sorted(self._results)], self.status
        outcome = self._optimizer.tell([evaluation for _, evaluation in results])
        for task, evaluation in results:
            if evaluation.fitness > status.best_fitness:
                self._best = task, evaluation
                status.best_fitness = evaluation.fitness
                status.best_distance = evaluation.metrics.get("distance", math.nan)

        all_done = status.evaluations == status.evaluations_at_most
        content = {
            "iteration": status.iteration + 1,
            "evaluations": status.evaluations,
            "best_fitness": None if self._best is None else status.best_fitness,
            "best_evaluation": None if self._best is None else self._best[0].index,
            "stop": ALL_DONE if all_done else outcome.stop,
            **outcome.report,
        }
        placed: list[dict[str, Any]] = [{} for _ in results]
        if outcome.placed is not None:
            placed = [{"placed": member} for member in outcome.placed]
        try:
            iteration = IterationLine.model_validate(content)
            evaluations = [
                EvaluationLine.of(task, evaluation, **key)
                for (task, evaluation), key in zip(results, placed, strict=True)
            ]
        except ValidationError as error:
            raise InputError("optimizer", *first_problem(error)) from error

        # The order matters: after a kill in between, a resumed run completes the files.
        self._evaluations.write(evaluations, first=evaluations[0].index)
        self._iterations.write([iteration], first=iteration.iteration)
        if evaluations[-1].index >= len(self._evaluations.lines):
            self._in_progress.file.path.unlink(missing_ok=True)
        status.iteration, status.stop = iteration.iteration, iteration.stop


def open_trials(record: RunRecord, *, optimizer: MakeOptimizer | None = None) -> list[Trial]:
    """All trials of a record, each at the end of its recorded part.

    The default optimiser is the scenario's. Trials are independent: the results of a trial do not
    depend on how many trials there are.
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
    """Runs all trials to their ends and returns their final states.

    `submit` begins an evaluation. `show` gets all states whenever evaluations end, and about once
    per second. The record depends only on scenario, method (objective and optimiser) and seed. It
    does not depend on the evaluator or on interruptions.
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
    """Evaluates one recorded gait of a resumed run again: the first that has a fitness. Raises
    InputError, naming `directory`, if its fitness differs, so that a record never mixes two
    objectives."""
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
