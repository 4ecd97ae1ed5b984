"""The trials of a run: each an optimiser, its record and its state; and the loop over all."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.evolution.draws import SeededVector
from tetra_drake.evolution.entries import (
    evaluation_entry,
    trial_folder,
)
from tetra_drake.evolution.executors import (
    EvaluationPool,
    MakeExecutor,
    evaluate_all,
    process_executor,
)
from tetra_drake.evolution.manifest import Manifest
from tetra_drake.evolution.run_record import RunRecord, TrialRecord
from tetra_drake.optimizers import optimizer_of
from tetra_drake.optimizers.base import (
    Evaluate,
    Evaluation,
    MakeOptimizer,
    Optimizer,
)
from tetra_drake.robot.gait import ParameterSpace, Vector
from tetra_drake.scenario.units import INCH

_SHOW_PERIOD = 1.0  # s

LEAST_BASE = 1.0
"""in: a gain in percent of a shorter distance says nothing."""


@dataclass
class TrialStatus:
    """State of a trial, live or recorded. Distances are the fittest gait's; NaN before there is
    any."""

    number: int
    evaluations_at_most: int = 0
    """0 where only the record is known."""
    iteration: int = -1
    """The last complete one; 0 is the initial population."""
    evaluations: int = 0
    failures: int = 0
    wall_time: float = 0.0
    """Total of the evaluations, in s."""
    best_fitness: float = -math.inf
    best_distance_in: float = math.nan
    mean_fitness: float = math.nan
    """Mean fitness of the population; NaN if the optimiser reports none."""
    initial_best_distance_in: float = math.nan
    initial_mean_fitness: float = math.nan
    stop: str | None = None
    """Why the trial ended; None while it goes on."""

    @property
    def gain_in(self) -> float:
        """Rise of the best distance, in inches."""
        return self.best_distance_in - self.initial_best_distance_in

    @property
    def gain_percent(self) -> float:
        """The gain in % of the best initial distance; NaN where that is too short to compare with,
        below LEAST_BASE."""
        initial = self.initial_best_distance_in
        return 100.0 * self.gain_in / initial if initial >= LEAST_BASE else math.nan

    def count(self, evaluations: int, *, failures: int, wall_time: float) -> None:
        """Adds evaluations."""
        self.evaluations += evaluations
        self.failures += failures
        self.wall_time += wall_time

    def complete(self, line: Mapping[str, Any], *, best_distance_in: float) -> None:
        """Takes over a line of iterations.jsonl, and the distance of its best evaluation."""
        self.iteration = int(line["iteration"])
        best = _number(line["best_fitness"])
        self.best_fitness = best if math.isfinite(best) else -math.inf
        self.best_distance_in = best_distance_in
        self.mean_fitness = _number(line.get("mean_fitness"))
        self.stop = line["stop"] if isinstance(line["stop"], str) else None
        if self.iteration == 0:
            self.initial_mean_fitness = self.mean_fitness
            self.initial_best_distance_in = best_distance_in


class Trial:
    """Gives evaluations, taken in any order, to the optimiser in the order asked. What the record
    holds already it goes through at once."""

    def __init__(
        self, number: int, *, manifest: Manifest, optimizer: Optimizer, folder: Path
    ) -> None:
        self.status = TrialStatus(number, optimizer.evaluations_at_most)
        self.unevaluated: dict[int, Vector] = {}
        """Vectors to evaluate before the optimiser can go on, by number; empty at the end."""
        self.recalled: tuple[int, Vector | SeededVector, Evaluation] | None = None
        """Number, task and evaluation of the first recorded gait with a fitness."""
        self._manifest = manifest
        self._optimizer = optimizer
        self._record = TrialRecord(folder)
        self._results: dict[int, Evaluation] = {}
        """Evaluations of this iteration."""
        self._best: tuple[int, Vector, Evaluation] | None = None
        self._saved_best: int | None = None
        self._course = self._iterate()
        next(self._course, None)

    @property
    def tasks(self) -> dict[int, Vector | SeededVector]:
        """Tasks for the vectors of `unevaluated`."""
        return {index: self._task(vector) for index, vector in self.unevaluated.items()}

    def _task(self, vector: Vector) -> Vector | SeededVector:
        iteration = self.status.iteration + 1
        return self._manifest.task(vector, trial=self.status.number, iteration=iteration)

    def take(self, index: int, evaluation: Evaluation) -> bool:
        """Takes an evaluation; True if that was the last of its iteration."""
        vector = self.unevaluated.pop(index)
        self._add(index, evaluation)
        if self.unevaluated:
            entry = evaluation_entry(index, self.status.iteration + 1, vector, evaluation)
            self._record.keep(entry)
            return False
        next(self._course, None)
        return True

    def _iterate(self) -> Iterator[None]:
        """Goes from iteration to iteration; yields to wait for evaluations."""
        while self.status.stop is None:
            batch = dict(enumerate(self._optimizer.ask(), start=self.status.evaluations))
            self._results = {}
            for index, vector in batch.items():
                recorded = self._record.recall(index, vector)
                if recorded is None:
                    self.unevaluated[index] = vector
                else:
                    self._add(index, recorded)
                    if self.recalled is None and recorded.failure is None:
                        self.recalled = index, self._task(vector), recorded
            if self.unevaluated:
                self._save_best()
                yield
            self._complete(batch)
        self._record.finish(self.status.evaluations)
        self._save_best()

    def _add(self, index: int, evaluation: Evaluation) -> None:
        self._results[index] = evaluation
        failed = evaluation.failure is not None
        self.status.count(1, failures=failed, wall_time=evaluation.wall_time)

    def _save_best(self) -> None:
        if self._best is not None and self._best[0] != self._saved_best:
            index, vector, _ = self._best
            gait = self._manifest.gait(vector, trial=self.status.number, index=index)
            self._record.save_best(gait, self._manifest.scenario)
            self._saved_best = index

    def _complete(self, batch: Mapping[int, Vector]) -> None:
        """Tells the optimiser the results of an iteration, and records it."""
        outcome = self._optimizer.tell([self._results[index] for index in batch])
        number, entries = self.status.iteration + 1, []
        for index, vector in batch.items():
            evaluation = self._results[index]
            if evaluation.fitness > (self._best[2].fitness if self._best else -math.inf):
                self._best = index, vector, evaluation
            entries.append(evaluation_entry(index, number, vector, evaluation))
        for entry, place in zip(entries, outcome.placed or (), strict=outcome.placed is not None):
            entry["placed"] = place
        line = {
            "iteration": number,
            "evaluations": self.status.evaluations,
            "best_fitness": self._best[2].fitness if self._best else None,
            "best_evaluation": self._best[0] if self._best else None,
            "stop": outcome.stop,
            **outcome.report,
        }
        self._record.complete(entries, line)
        distance = self._best[2].metrics.get("distance", math.nan) if self._best else math.nan
        self.status.complete(line, best_distance_in=distance / INCH)


def open_trials(record: RunRecord, *, optimizer: MakeOptimizer | None = None) -> list[Trial]:
    """All trials of a record, each as far as it is recorded; by default with the scenario's
    optimiser. Trials share nothing: one more trial changes no other."""
    scenario, seed = record.manifest.scenario, record.manifest.seed
    make = optimizer or optimizer_of(scenario.optimizer)
    space = ParameterSpace.of(scenario)
    trials = []
    for number, trial_seed in enumerate(
        np.random.SeedSequence(seed).spawn(scenario.evolution.trials)
    ):
        generator = np.random.default_rng(trial_seed)
        trial = Trial(
            number,
            manifest=record.manifest,
            optimizer=make(space, scenario.evolution, generator),
            folder=trial_folder(record.directory, number),
        )
        trials.append(trial)
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
                for index, task in trial.tasks.items():
                    pool.submit((trial, index), task)
            done = pool.wait(_SHOW_PERIOD)
            waiting = [trial for (trial, index), result in done if trial.take(index, result)]
            show(statuses)
    return statuses


def check_fitness(
    trials: Sequence[Trial], directory: Path, *, evaluate: Evaluate, executor: MakeExecutor
) -> None:
    """Evaluates the first recorded gait that has a fitness once more; InputError if its fitness is
    another now, so that no record ever holds two objectives."""
    trial = next((trial for trial in trials if trial.recalled), None)
    if trial is None or trial.recalled is None:
        return
    index, task, recorded = trial.recalled
    ((_, again),) = evaluate_all(evaluate, [task], workers=1, executor=executor)
    if again.fitness != recorded.fitness:
        outcome = again.failure or f"fitness {again.fitness!r}"
        problem = (
            f"trial {trial.status.number}, evaluation {index} has fitness {recorded.fitness!r}, "
            f"and evaluated again {outcome}; resume the run with the objective, the versions of "
            "the packages and the kind of processor it was begun with"
        )
        raise InputError(directory, "objective", problem)


def _number(value: Any) -> float:
    return math.nan if value is None else float(value)
