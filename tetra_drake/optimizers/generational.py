"""Random search, and the common parts of optimisers that learn from whole batches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np
import numpy.typing as npt

from tetra_drake.files import json_number
from tetra_drake.optimizers.base import Evaluation, Iteration, mean_fitness
from tetra_drake.robot.gait import TAU_B, ParameterSpace, Vector
from tetra_drake.scenario.common_sections import EvolutionSection

Matrix = npt.NDArray[np.float64]

GAITS = 50
"""Number of gaits in an iteration of random search."""

MIDDLE = 0.5
"""Middle of a range, in units of the range."""


class Ranges:
    """Scale of the varying parameters: 0 and 1 are the bounds of random gaits.

    A search may leave these bounds. Only floors (lower limits) are respected.
    """

    def __init__(self, space: ParameterSpace) -> None:
        self._space = space
        self._free = space.high > space.low
        self._free[TAU_B] &= not space.couples_tau_b
        self._width = (space.high - space.low)[self._free]
        self.size = len(self._width)
        self.floors = (space.floors - space.low)[self._free] / self._width

    def random(self, count: int, generator: np.random.Generator) -> Matrix:
        """Scaled points of random gaits."""
        vectors = np.array([self._space.random(generator) for _ in range(count)])
        return (vectors - self._space.low)[:, self._free] / self._width

    def vector(self, point: Vector) -> Vector:
        """The parameter vector of a scaled point. Values below a floor are raised to it."""
        vector = self._space.low.copy()
        vector[self._free] += point * self._width
        return self._space.repair(np.maximum(vector, self._space.floors))

    def from_roots(self, roots: Matrix) -> Matrix:
        """Converts roots to points: floor + root^2 / (4 (MIDDLE - floor)). A parameter without a
        floor is its own root.

        Every root is a valid point. Fitness is a smooth function of the root even at the floor. In
        the middle of the range, point and root change at the same rate.
        """
        points = self.floors + roots**2 / (4.0 * (MIDDLE - self.floors))
        return np.where(np.isfinite(self.floors), points, roots)

    def roots(self, points: Matrix) -> Matrix:
        """Converts points to roots; the inverse of from_roots(), without negative roots."""
        roots = 2.0 * np.sqrt((MIDDLE - self.floors) * (points - self.floors))
        return np.where(np.isfinite(self.floors), roots, points)


SettingsT = TypeVar("SettingsT")


@dataclass(eq=False)
class Generational(Generic[SettingsT]):
    """Random search. Subclasses draw points in another way, and learn from a whole batch at once.

    A failure counts as worse than every success. A batch of failures teaches nothing. The report
    has mean_fitness over the successes.
    """

    space: ParameterSpace
    evolution: EvolutionSection
    generator: np.random.Generator
    settings: SettingsT
    """The kind of optimiser in the scenario."""

    def __post_init__(self) -> None:
        self._ranges = Ranges(self.space)
        self._points: Matrix = np.empty((0, self._ranges.size))
        """Points that were drawn last."""

    def ask(self) -> list[Vector]:
        """The next batch."""
        self._points = self._draw()
        return [self._ranges.vector(point) for point in self._points]

    def tell(self, evaluations: Sequence[Evaluation]) -> Iteration:
        """Takes the evaluations of a batch."""
        fitnesses = np.array([evaluation.fitness for evaluation in evaluations])
        is_finite = np.isfinite(fitnesses)
        mean = json_number(mean_fitness(fitnesses))
        report = {"mean_fitness": mean, "population": len(self._points), **self._state()}
        if is_finite.any() and len(evaluations) == len(self._points):
            least = np.min(fitnesses[is_finite])
            self._learn(np.where(is_finite, fitnesses, least - abs(least) - 1.0))
        return Iteration(report)

    def _draw(self) -> Matrix:
        """Draws the points of the next batch."""
        return self._ranges.random(GAITS, self.generator)

    def _learn(self, fitnesses: Vector) -> None:
        """Learns from the fitnesses of the points of the last batch. All are finite."""

    def _state(self) -> Mapping[str, Any]:
        """Numbers about the search, for the report."""
        return {}
