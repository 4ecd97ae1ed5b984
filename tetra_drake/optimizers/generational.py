"""Common parts of optimisers that draw and learn from whole batches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np
import numpy.typing as npt

from tetra_drake.optimizers.base import Evaluation, Iteration
from tetra_drake.robot.gait import TAU_B, ParameterSpace, Vector
from tetra_drake.scenario.common_sections import EvolutionSection

Matrix = npt.NDArray[np.float64]

MIDDLE = 0.5
"""Middle of a range, in units of the range."""


class Ranges:
    """The parameters that vary, in units of their ranges in random gaits: 0 is the lower bound, 1
    the upper one. Only floors limit them."""

    def __init__(self, space: ParameterSpace) -> None:
        self._space = space
        self._free = space.high > space.low
        self._free[TAU_B] &= not space.couples_tau_b
        self._width = (space.high - space.low)[self._free]
        self.size = len(self._width)
        self.floors = (space.floors - space.low)[self._free] / self._width

    def vector(self, point: Vector) -> Vector:
        """The vector of a point; what is below its floor is put there."""
        vector = self._space.low.copy()
        vector[self._free] += point * self._width
        return self._space.repair(np.maximum(vector, self._space.floors))

    def from_roots(self, roots: Matrix) -> Matrix:
        """The points floor + root^2 / (4 (MIDDLE - floor)), and the roots where there is no floor.

        All roots are allowed, and a best point at the floor is one that fitness is smooth around.
        In the middle of its range, a point moves as its root does.
        """
        points = self.floors + roots**2 / (4.0 * (MIDDLE - self.floors))
        return np.where(np.isfinite(self.floors), points, roots)

    def roots(self, points: Matrix) -> Matrix:
        """The roots of points, none negative where there is a floor."""
        roots = 2.0 * np.sqrt((MIDDLE - self.floors) * (points - self.floors))
        return np.where(np.isfinite(self.floors), roots, points)

    def point(self, vector: Vector) -> Vector:
        """The point of a vector."""
        return (vector - self._space.low)[self._free] / self._width


SettingsT = TypeVar("SettingsT")


@dataclass(eq=False)
class Generational(Generic[SettingsT]):
    """An Optimizer that learns from a whole batch at once, unless all of it has failed; a failure
    is worse than all others. Reports mean_fitness, over the evaluations without failure.
    """

    space: ParameterSpace
    evolution: EvolutionSection
    generator: np.random.Generator
    settings: SettingsT
    """The kind of optimiser in the scenario."""

    def __post_init__(self) -> None:
        self._ranges = Ranges(self.space)
        self._points: Matrix = np.empty((0, self._ranges.size))
        """Points drawn last."""

    def ask(self) -> list[Vector]:
        """The next batch."""
        self._points = self._draw()
        return [self._ranges.vector(point) for point in self._points]

    def tell(self, evaluations: Sequence[Evaluation]) -> Iteration:
        """Takes the evaluations of a batch."""
        fitnesses = np.array([evaluation.fitness for evaluation in evaluations])
        is_finite = np.isfinite(fitnesses)
        mean = float(np.mean(fitnesses[is_finite])) if is_finite.any() else None
        report = {"mean_fitness": mean, "population": len(self._points), **self._state()}
        if is_finite.any() and len(evaluations) == len(self._points):
            least = np.min(fitnesses[is_finite])
            self._learn(np.where(is_finite, fitnesses, least - abs(least) - 1.0))
        return Iteration(report)

    def _random(self, count: int) -> Matrix:
        """The points of random vectors."""
        drawn = [self.space.random(self.generator) for _ in range(count)]
        return np.array([self._ranges.point(vector) for vector in drawn])

    def _draw(self) -> Matrix:
        """The points to evaluate next."""
        raise NotImplementedError

    def _learn(self, fitnesses: Vector) -> None:
        """Takes the fitnesses of all points drawn last, all finite."""

    def _state(self) -> Mapping[str, Any]:
        """State of the search, for the report."""
        return {}
