"""One trial: an optimiser, its record, and its state."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from tetra_drake.evolution.optimizers.base import Evaluation, Iteration, Optimizer
from tetra_drake.evolution.record import TrialRecord, evaluation_entry
from tetra_drake.robot.gait import ParameterSpace, Vector
from tetra_drake.scenario.units import INCH


@dataclass
class TrialStatus:
    """State of a trial, live or read back from its record. Distances in inches, those of the
    fittest gait; NaN before there is any."""

    number: int
    evaluations_at_most: int = 0
    """0 where only the record is known."""
    iteration: int = -1
    """The last complete one; 0 is the initial population."""
    evaluations: int = 0
    recalled: int = 0
    """Evaluations taken from the record instead of made."""
    failures: int = 0
    wall_time: float = 0.0
    """Total of the evaluations, in s."""
    best_fitness: float = -math.inf
    best_distance_in: float = math.nan
    initial_best_distance_in: float = math.nan
    """After iteration 0."""
    report: Mapping[str, Any] = field(default_factory=dict)
    """The optimiser's, of the last iteration."""
    initial_report: Mapping[str, Any] = field(default_factory=dict)
    stop: str | None = None
    """Why the trial ended; None while it goes on."""

    @property
    def mean_fitness(self) -> float:
        """Mean fitness of the population; NaN where the optimiser reports none."""
        return _number(self.report.get("mean_fitness"))

    @property
    def initial_mean_fitness(self) -> float:
        """Mean fitness of the initial population; NaN where the optimiser reports none."""
        return _number(self.initial_report.get("mean_fitness"))

    @property
    def improvement_percent(self) -> float:
        """Rise of the best distance, in %; NaN where the best initial gait did not walk forward."""
        initial = self.initial_best_distance_in
        return 100.0 * (self.best_distance_in / initial - 1.0) if initial > 0.0 else math.nan

    def count(self, *, evaluations: int, failures: int, wall_time: float) -> None:
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
        self.report = {key: value for key, value in line.items() if key not in LINE_KEYS}
        self.stop = line["stop"] if isinstance(line["stop"], str) else None
        if self.iteration == 0:
            self.initial_report, self.initial_best_distance_in = self.report, best_distance_in


LINE_KEYS = ("iteration", "evaluations", "best_fitness", "best_evaluation", "stop")
"""Keys of a line of iterations.jsonl besides the optimiser's report."""


@dataclass(frozen=True)
class Assignment:
    """Number `index` of the evaluations of a trial."""

    trial: int
    index: int


@dataclass(frozen=True)
class _Best:
    index: int
    vector: Vector
    evaluation: Evaluation


class Trial:
    """Takes evaluations in any order and gives them to the optimiser in the order asked.

    What the record holds already it goes through at once.
    """

    def __init__(
        self,
        *,
        number: int,
        name: str,
        space: ParameterSpace,
        optimizer: Optimizer,
        record: TrialRecord,
    ) -> None:
        self.status = TrialStatus(number=number, evaluations_at_most=optimizer.evaluations_at_most)
        self._name = name
        self._space = space
        self._optimizer = optimizer
        self._record = record
        self._first = 0
        """Index of the first vector of the batch."""
        self._batch: list[Vector] = []
        self._results: dict[int, Evaluation] = {}
        self._best: _Best | None = None
        self._saved_best: int | None = None
        self._ask()
        self._catch_up()

    @property
    def finished(self) -> bool:
        """Whether the optimiser has ended the trial."""
        return self.status.stop is not None

    def unevaluated(self) -> list[tuple[Assignment, Vector]]:
        """What has to be evaluated before the optimiser can go on."""
        return [
            (Assignment(self.status.number, index), vector)
            for index, vector in self._numbered()
            if index not in self._results
        ]

    def take(self, index: int, evaluation: Evaluation) -> bool:
        """Takes an evaluation; True if that was the last of its batch."""
        self._results[index] = evaluation
        self._count(evaluation)
        if len(self._results) < len(self._batch):
            vector = self._batch[index - self._first]
            self._record.keep(index, self.status.iteration + 1, vector, evaluation)
            return False
        self._tell()
        self._catch_up()
        return True

    def _numbered(self) -> list[tuple[int, Vector]]:
        return list(enumerate(self._batch, start=self._first))

    def _ask(self) -> None:
        self._first += len(self._batch)
        self._batch = self._optimizer.ask()
        self._results = {}
        for index, vector in self._numbered():
            evaluation = self._record.recall(index, vector)
            if evaluation is not None:
                self._results[index] = evaluation
                self._count(evaluation)
                self.status.recalled += 1

    def _catch_up(self) -> None:
        """Goes on as far as evaluations are known, then saves the best gait if it is new."""
        while not self.finished and len(self._results) == len(self._batch):
            self._tell()
        if self._best is not None and self._best.index != self._saved_best:
            name = f"{self._name}, evaluation {self._best.index}"
            self._record.save_best(self._space.gait(self._best.vector, name=name))
            self._saved_best = self._best.index

    def _count(self, evaluation: Evaluation) -> None:
        failed = evaluation.failure is not None
        self.status.count(evaluations=1, failures=failed, wall_time=evaluation.wall_time)

    def _tell(self) -> None:
        evaluations = [self._results[index] for index, _ in self._numbered()]
        iteration = self._optimizer.tell(evaluations)
        for (index, vector), evaluation in zip(self._numbered(), evaluations, strict=True):
            if evaluation.fitness > (self._best.evaluation.fitness if self._best else -math.inf):
                self._best = _Best(index, vector, evaluation)
        line = self._line(iteration)
        metrics = self._best.evaluation.metrics if self._best else {}
        distance = metrics.get("distance", math.nan)
        self.status.complete(line, best_distance_in=distance / INCH)
        self._record.complete(self._entries(iteration), line)
        if self.finished:
            self._record.finish(self.status.evaluations)
        else:
            self._ask()

    def _entries(self, iteration: Iteration) -> list[dict[str, Any]]:
        entries = [
            evaluation_entry(index, self.status.iteration, vector, self._results[index])
            for index, vector in self._numbered()
        ]
        if iteration.placed is None:
            return entries
        return [
            entry | {"placed": place}
            for entry, place in zip(entries, iteration.placed, strict=True)
        ]

    def _line(self, iteration: Iteration) -> dict[str, Any]:
        best = self._best
        line = {
            "iteration": self.status.iteration + 1,
            "evaluations": self.status.evaluations,
            "best_fitness": best.evaluation.fitness if best else None,
            "best_evaluation": best.index if best else None,
            "stop": iteration.stop,
        }
        return line | dict(iteration.report)


def _number(value: Any) -> float:
    return math.nan if value is None else float(value)
