"""One trial: an optimiser, its record, and its state."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tetra_drake.evolution.optimizers.base import Evaluation, Optimizer
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
    report: Mapping[str, Any] = field(default_factory=dict)
    """The optimiser's, of the last iteration."""
    initial_best_distance_in: float = math.nan
    initial_report: Mapping[str, Any] = field(default_factory=dict)
    """Both of iteration 0."""
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


class Trial:
    """Takes evaluations in any order and gives them to the optimiser in the order asked.

    What the record holds already it goes through at once.
    """

    def __init__(
        self, number: int, name: str, *, space: ParameterSpace, optimizer: Optimizer, folder: Path
    ) -> None:
        self.status = TrialStatus(number, optimizer.evaluations_at_most)
        self._name = name
        self._space = space
        self._optimizer = optimizer
        self._record = TrialRecord(folder)
        self._batch: dict[int, Vector] = {}
        """By the numbers of their evaluations, in the order asked."""
        self._results: dict[int, Evaluation] = {}
        self._best: tuple[int, Vector, Evaluation] | None = None
        self._saved_best: int | None = None
        self._ask(first=0)
        self._catch_up()

    @property
    def finished(self) -> bool:
        """Whether the optimiser has ended the trial."""
        return self.status.stop is not None

    def unevaluated(self) -> dict[int, Vector]:
        """What has to be evaluated before the optimiser can go on, by number."""
        return {i: vector for i, vector in self._batch.items() if i not in self._results}

    def take(self, index: int, evaluation: Evaluation) -> bool:
        """Takes an evaluation; True if that was the last of its batch."""
        self._add(index, evaluation)
        if self.unevaluated():
            iteration = self.status.iteration + 1
            self._record.keep(evaluation_entry(index, iteration, self._batch[index], evaluation))
            return False
        self._tell()
        self._catch_up()
        return True

    def _ask(self, *, first: int) -> None:
        self._batch = dict(enumerate(self._optimizer.ask(), start=first))
        self._results = {}
        for index, vector in self._batch.items():
            evaluation = self._record.recall(index, vector)
            if evaluation is not None:
                self._add(index, evaluation)
                self.status.recalled += 1

    def _add(self, index: int, evaluation: Evaluation) -> None:
        self._results[index] = evaluation
        failed = evaluation.failure is not None
        self.status.count(evaluations=1, failures=failed, wall_time=evaluation.wall_time)

    def _catch_up(self) -> None:
        """Goes on as far as evaluations are known, then saves the best gait if it is new."""
        while not self.finished and not self.unevaluated():
            self._tell()
        if self._best is not None and self._best[0] != self._saved_best:
            index, vector, _ = self._best
            name = f"{self._name}, evaluation {index}"
            self._record.save_best(self._space.gait(vector, name=name))
            self._saved_best = index

    def _tell(self) -> None:
        iteration = self._optimizer.tell([self._results[index] for index in self._batch])
        for index, vector in self._batch.items():
            evaluation = self._results[index]
            if evaluation.fitness > (self._best[2].fitness if self._best else -math.inf):
                self._best = index, vector, evaluation
        line = {
            "iteration": self.status.iteration + 1,
            "evaluations": self.status.evaluations,
            "best_fitness": self._best[2].fitness if self._best else None,
            "best_evaluation": self._best[0] if self._best else None,
            "stop": iteration.stop,
            **iteration.report,
        }
        distance = self._best[2].metrics.get("distance", math.nan) if self._best else math.nan
        self.status.complete(line, best_distance_in=distance / INCH)
        entries = [
            evaluation_entry(index, self.status.iteration, vector, self._results[index])
            for index, vector in self._batch.items()
        ]
        if iteration.placed is not None:
            for entry, place in zip(entries, iteration.placed, strict=True):
                entry["placed"] = place
        self._record.complete(entries, line)
        if self.finished:
            self._record.finish(self.status.evaluations)
        else:
            self._ask(first=self.status.evaluations)


def _number(value: Any) -> float:
    return math.nan if value is None else float(value)
