"""Trials of a run: each has an optimiser, a record and a state. Also the loop over all trials."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.evolution.entries import BEST_GAIT, trial_folder
from tetra_drake.evolution.evaluators import Evaluator, evaluate_all, finished, submitted
from tetra_drake.evolution.run_record import RunRecord, TrialRecord
from tetra_drake.optimizers import optimizer_of
from tetra_drake.optimizers.base import Evaluation, MakeOptimizer, Optimizer, Task
from tetra_drake.robot.gait import ParameterSpace, save_gait
from tetra_drake.settings.units import INCHES, Units

_SHOW_PERIOD = 1.0  # s

ALL_DONE = "all evaluations done"
"""Reason for the end of a trial whose optimiser did not stop earlier."""


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

    def complete(self, line: Mapping[str, Any], *, best_distance: float) -> None:
        """Updates the state with a line of iterations.jsonl and the distance of the best gait."""
        self.iteration = line["iteration"]
        self.stop = line["stop"] if isinstance(line["stop"], str) else None
        best = line["best_fitness"]
        # A line from a table has NaN in place of null.
        self.best_fitness = -math.inf if best is None or math.isnan(best) else best
        self.best_distance = best_distance


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
        results = [self._results[index] for index in sorted(self._results)]
        outcome = self._optimizer.tell([evaluation for _, evaluation in results])
        for task, evaluation in results:
            if evaluation.fitness > (self._best[1].fitness if self._best else -math.inf):
                self._best = task, evaluation
        status = self.status
        all_done = status.evaluations == status.evaluations_at_most
        best_fitness, best_evaluation, distance = None, None, math.nan
        if self._best is not None:
            task, evaluation = self._best
            best_fitness, best_evaluation = evaluation.fitness, task.index
            distance = evaluation.metrics.get("distance", math.nan)
        line = {
            "iteration": status.iteration + 1,
            "evaluations": status.evaluations,
            "best_fitness": best_fitness,
            "best_evaluation": best_evaluation,
            "stop": ALL_DONE if all_done else outcome.stop,
            **outcome.report,
        }
        self._record.complete(results, line, placed=outcome.placed)
        status.complete(line, best_distance=distance)


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
    evaluator: Evaluator,
    *,
    show: Callable[[Sequence[TrialStatus]], None] = lambda statuses: None,
) -> list[TrialStatus]:
    """Runs all trials to their ends.

    The record depends only on scenario, method and seed. It does not depend on the evaluator or on
    interruptions.
    """
    statuses = [trial.status for trial in trials]
    show(statuses)
    running = submitted(evaluator, [t for trial in trials for t in trial.unevaluated.values()])
    while running:
        for task, evaluation in finished(running, _SHOW_PERIOD):
            trial = trials[task.trial]
            if trial.take(task, evaluation):
                running |= submitted(evaluator, trial.unevaluated.values())
        show(statuses)
    return statuses


def check_fitness(trials: Sequence[Trial], directory: Path, evaluator: Evaluator) -> None:
    """Evaluates the first recorded gait with a fitness again. Raises InputError if its fitness
    differs, so that a record never mixes two objectives."""
    recalled = [trial.recalled for trial in trials if trial.recalled is not None]
    if not recalled:
        return
    task, recorded = recalled[0]
    ((_, again),) = evaluate_all(evaluator, [task])
    if again.fitness != recorded.fitness:
        outcome = again.failure or f"fitness {again.fitness!r}"
        found = f"{task} has fitness {recorded.fitness!r}, and evaluated again {outcome}"
        same = "the objective, the versions of the packages and the kind of processor"
        problem = f"{found}; resume the run with {same} it was begun with"
        raise InputError(directory, "objective", problem)
