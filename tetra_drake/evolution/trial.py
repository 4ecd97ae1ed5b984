"""One trial: an optimiser, its record, and what is known of its progress."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from tetra_drake.evolution.genome import gait_of
from tetra_drake.evolution.optimizers.base import Evaluation, Genome, Iteration, Optimizer
from tetra_drake.evolution.record import TrialRecord, evaluation_entry


@dataclass
class TrialStatus:
    """Where a trial stands. Distances in inches; NaN before there is any."""

    number: int
    evaluations_at_most: int
    iteration: int = -1
    """The last complete one; 0 is the initial population."""
    evaluations: int = 0
    recalled: int = 0
    """Evaluations taken from the record instead of made."""
    failures: int = 0
    initial_mean_fitness: float = math.nan
    mean_fitness: float = math.nan
    best_fitness: float = -math.inf
    best_distance_in: float = math.nan
    """Of the fittest gait."""
    initial_best_distance_in: float = math.nan
    """Of the fittest gait of the initial population."""
    wall_time: float = 0.0
    """Total of the evaluations, in s."""
    stop: str | None = None
    """Why the trial ended; None while it goes on."""


@dataclass(frozen=True)
class Assignment:
    """A genome to evaluate: number `index` of its trial."""

    trial: int
    index: int


class Trial:
    """Takes evaluations in any order and gives them to the optimiser in the order asked.

    On a record that is not empty it goes through the recorded part at once.
    """

    def __init__(
        self, *, number: int, name: str, optimizer: Optimizer, record: TrialRecord
    ) -> None:
        self.status = TrialStatus(number=number, evaluations_at_most=optimizer.evaluations_at_most)
        self._name = name
        self._optimizer = optimizer
        self._record = record
        self._first = 0
        """Index of the first genome of the batch."""
        self._batch: list[Genome] = []
        self._results: dict[int, Evaluation] = {}
        self._best: tuple[int, Genome] | None = None
        self._saved_best: int | None = None
        self._ask()
        self._catch_up()

    @property
    def finished(self) -> bool:
        """Whether the optimiser has ended the trial."""
        return self.status.stop is not None

    def unevaluated(self) -> list[tuple[Assignment, Genome]]:
        """What has to be evaluated before the optimiser can go on."""
        return [
            (Assignment(self.status.number, index), genome)
            for index, genome in self._numbered()
            if index not in self._results
        ]

    def take(self, index: int, evaluation: Evaluation) -> bool:
        """Takes an evaluation; True if that was the last of its batch."""
        self._results[index] = evaluation
        self._count(evaluation)
        if len(self._results) < len(self._batch):
            genome = self._batch[index - self._first]
            self._record.keep(index, self.status.iteration + 1, genome, evaluation)
            return False
        self._tell()
        self._catch_up()
        return True

    def _numbered(self) -> list[tuple[int, Genome]]:
        return list(enumerate(self._batch, start=self._first))

    def _ask(self) -> None:
        self._first += len(self._batch)
        self._batch = self._optimizer.ask()
        self._results = {}
        for index, genome in self._numbered():
            evaluation = self._record.recall(index, genome)
            if evaluation is not None:
                self._results[index] = evaluation
                self._count(evaluation)
                self.status.recalled += 1

    def _catch_up(self) -> None:
        """Goes on as far as evaluations are known, then sees to the best gait's file."""
        while not self.finished and len(self._results) == len(self._batch):
            self._tell()
        if self._best is not None and self._best[0] != self._saved_best:
            index, genome = self._best
            self._record.save_best(gait_of(genome, name=f"{self._name}, evaluation {index}"))
            self._saved_best = index

    def _tell(self) -> None:
        evaluations = [self._results[index] for index, _ in self._numbered()]
        iteration = self._optimizer.tell([evaluation.fitness for evaluation in evaluations])
        self._note(evaluations, iteration)
        entries = [
            evaluation_entry(index, self.status.iteration, genome, self._results[index])
            | {"placed": placed}
            for (index, genome), placed in zip(self._numbered(), iteration.placed, strict=True)
        ]
        self._record.complete(entries, self._iteration_entry())
        if self.finished:
            self._record.finish(self.status.evaluations)
        else:
            self._ask()

    def _count(self, evaluation: Evaluation) -> None:
        self.status.evaluations += 1
        self.status.failures += evaluation.failure is not None
        self.status.wall_time += evaluation.wall_time

    def _note(self, evaluations: list[Evaluation], iteration: Iteration) -> None:
        status = self.status
        status.iteration += 1
        status.mean_fitness = iteration.mean_fitness
        status.stop = iteration.stop
        for (index, genome), evaluation in zip(self._numbered(), evaluations, strict=True):
            if evaluation.fitness > status.best_fitness:
                status.best_fitness = evaluation.fitness
                status.best_distance_in = evaluation.distance_in
                self._best = index, genome
        if status.iteration == 0:
            status.initial_mean_fitness = status.mean_fitness
            status.initial_best_distance_in = status.best_distance_in

    def _iteration_entry(self) -> dict[str, Any]:
        status = self.status
        return {
            "iteration": status.iteration,
            "evaluations": status.evaluations,
            "mean_fitness": _finite_or_none(status.mean_fitness),
            "best_fitness": _finite_or_none(status.best_fitness),
            "best_distance_in": _finite_or_none(status.best_distance_in),
            "best_evaluation": None if self._best is None else self._best[0],
            "stop": status.stop,
        }


def _finite_or_none(value: float) -> float | None:
    return value if math.isfinite(value) else None
