"""The trials of a run: each an optimiser, its record and its state; and the loop over all."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.evolution.draws import SeededVector
from tetra_drake.evolution.entries import evaluation_entry
from tetra_drake.evolution.executors import (
    EvaluationPool,
    MakeExecutor,
    evaluate_all,
    process_executor,
)
from tetra_drake.evolution.run_record import RunRecord, TrialRecord
from tetra_drake.optimizers import optimizer_of
from tetra_drake.optimizers.base import Evaluate, Evaluation, MakeOptimizer, Optimizer
from tetra_drake.robot.gait import ParameterSpace, Vector
from tetra_drake.scenario.units import INCH

_SHOW_PERIOD = 1.0  # s

ALL_DONE = "all evaluations done"
"""Why a trial ends whose optimiser does not stop earlier."""


@dataclass
class TrialStatus:
    """State of a trial, live or recorded. Distances are the fittest gait's; NaN before there is
    any."""

    number: int
    evaluations_at_most: int
    """Evaluations of a trial that does not end early."""
    iteration: int = -1
    """The last complete one; 0 is the initial population."""
    evaluations: int = 0
    failures: int = 0
    wall_time: float = 0.0
    """Total of the evaluations, in s."""
    best_fitness: float = -math.inf
    best_distance_in: float = math.nan
    stop: str | None = None
    """Why the trial ended; None while it goes on."""

    def complete(self, line: Mapping[str, Any], *, best_distance_in: float) -> None:
        """Takes over a line of iterations.jsonl, and the distance of its best evaluation."""
        self.iteration = line["iteration"]
        self.stop = line["stop"] if isinstance(line["stop"], str) else None
        best = line["best_fitness"]
        # NaN stands for null in a table.
        self.best_fitness = -math.inf if best is None or math.isnan(best) else best
        self.best_distance_in = best_distance_in


@dataclass(frozen=True)
class Evaluated:
    """A vector and its evaluation, as a line of the record numbers them."""

    index: int
    iteration: int
    vector: Vector
    evaluation: Evaluation

    def entry(self) -> dict[str, Any]:
        """The line of the record."""
        return evaluation_entry(self.index, self.iteration, self.vector, self.evaluation)


class Trial:
    """Gives evaluations, taken in any order, to the optimiser in the order asked, until
    `evolution.evaluations` are done or the optimiser stops. What the record holds already it goes
    through at once."""

    def __init__(self, number: int, *, run: RunRecord, optimizer: Optimizer) -> None:
        self._manifest = run.manifest
        self.status = TrialStatus(number, self._manifest.scenario.evolution.evaluations)
        self.unevaluated: dict[int, Vector] = {}
        """Vectors to evaluate before the optimiser can go on, by index; empty at the end."""
        self.recalled: Evaluated | None = None
        """The first recorded vector with a fitness."""
        self._optimizer = optimizer
        self._record = TrialRecord(run, number)
        self._results: dict[int, Evaluated] = {}
        """The evaluated vectors of this iteration, by index."""
        self._best: Evaluated | None = None
        self._saved: Evaluated | None = None
        """The one whose gait is in the record as the best."""
        self._advance()

    def task(self, vector: Vector, *, iteration: int | None = None) -> Vector | SeededVector:
        """Task that evaluates a vector, by default one of the iteration under way."""
        if iteration is None:
            iteration = self.status.iteration + 1
        return self._manifest.task(vector, trial=self.status.number, iteration=iteration)

    def take(self, index: int, evaluation: Evaluation) -> bool:
        """Takes an evaluation; True if that was the last of its iteration."""
        self._add(index, self.unevaluated.pop(index), evaluation)
        if self.unevaluated:
            self._record.keep(self._results[index].entry())
            return False
        self._complete()
        self._advance()
        return True

    def _advance(self) -> None:
        """Goes on to the next vectors that are not recorded, or to the end."""
        while self.status.stop is None:
            self._ask()
            if self.unevaluated:
                self._save_best()
                return
            self._complete()
        self._record.finish(self.status.evaluations)
        self._save_best()

    def _ask(self) -> None:
        """Begins an iteration: what is recorded of it is recalled, the rest is unevaluated."""
        self._results = {}
        first = self.status.evaluations
        batch = self._optimizer.ask()[: self.status.evaluations_at_most - first]
        for index, vector in enumerate(batch, start=first):
            evaluation = self._record.recall(index, vector)
            if evaluation is None:
                self.unevaluated[index] = vector
                continue
            self._add(index, vector, evaluation)
            if self.recalled is None and evaluation.failure is None:
                self.recalled = self._results[index]

    def _add(self, index: int, vector: Vector, evaluation: Evaluation) -> None:
        status = self.status
        self._results[index] = Evaluated(index, status.iteration + 1, vector, evaluation)
        status.evaluations += 1
        status.failures += evaluation.failure is not None
        status.wall_time += evaluation.wall_time

    def _complete(self) -> None:
        """Tells the optimiser the results of an iteration, and records it."""
        results = [self._results[index] for index in sorted(self._results)]
        outcome = self._optimizer.tell([result.evaluation for result in results])
        for result in results:
            fitness = self._best.evaluation.fitness if self._best else -math.inf
            if result.evaluation.fitness > fitness:
                self._best = result
        entries = [result.entry() for result in results]
        if outcome.placed is not None:
            for entry, place in zip(entries, outcome.placed, strict=True):
                entry["placed"] = place
        best, status = self._best, self.status
        all_done = status.evaluations == status.evaluations_at_most
        line = {
            "iteration": status.iteration + 1,
            "evaluations": status.evaluations,
            "best_fitness": best.evaluation.fitness if best else None,
            "best_evaluation": best.index if best else None,
            "stop": ALL_DONE if all_done else outcome.stop,
            **outcome.report,
        }
        self._record.complete(entries, line)
        distance = best.evaluation.metrics.get("distance", math.nan) if best else math.nan
        status.complete(line, best_distance_in=distance / INCH)

    def _save_best(self) -> None:
        if self._best is not None and self._best is not self._saved:
            trial, index = self.status.number, self._best.index
            gait = self._manifest.gait(self._best.vector, trial=trial, index=index)
            self._record.save_best(gait, self._manifest.scenario)
            self._saved = self._best


def open_trials(record: RunRecord, *, optimizer: MakeOptimizer | None = None) -> list[Trial]:
    """All trials of a record, each as far as it is recorded; by default with the scenario's
    optimiser. Trials share nothing: one more trial changes no other."""
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
    *,
    evaluate: Evaluate,
    workers: int,
    executor: MakeExecutor = process_executor,
    show: Callable[[Sequence[TrialStatus]], None] = lambda statuses: None,
) -> list[TrialStatus]:
    """Runs trials to their ends, from wherever they are.

    Their record depends on its scenario, method and seed only, not on the number of workers, the
    executor, or interruptions.
    """
    statuses = [trial.status for trial in trials]
    show(statuses)
    waiting = [trial for trial in trials if trial.unevaluated]
    if not waiting:
        return statuses
    with EvaluationPool[tuple[Trial, int]](evaluate, workers=workers, executor=executor) as pool:
        while waiting or pool.busy:
            for trial in waiting:
                for index, vector in trial.unevaluated.items():
                    pool.submit((trial, index), trial.task(vector))
            done = pool.wait(_SHOW_PERIOD)
            waiting = [trial for (trial, index), result in done if trial.take(index, result)]
            show(statuses)
    return statuses


def check_fitness(
    trials: Sequence[Trial], directory: Path, *, evaluate: Evaluate, executor: MakeExecutor
) -> None:
    """Evaluates the first recorded gait that has a fitness once more; InputError if its fitness is
    another now, so that no record ever holds two objectives."""
    for trial in trials:
        recorded = trial.recalled
        if recorded is None:
            continue
        task = trial.task(recorded.vector, iteration=recorded.iteration)
        ((_, again),) = evaluate_all(evaluate, [task], workers=1, executor=executor)
        fitness = recorded.evaluation.fitness
        if again.fitness == fitness:
            return
        outcome = again.failure or f"fitness {again.fitness!r}"
        problem = (
            f"trial {trial.status.number}, evaluation {recorded.index} has fitness {fitness!r}, "
            f"and evaluated again {outcome}; resume the run with the objective, the versions of "
            "the packages and the kind of processor it was begun with"
        )
        raise InputError(directory, "objective", problem)
