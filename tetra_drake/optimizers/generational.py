"""Random search, and the base class of optimisers that learn from whole batches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np
import numpy.typing as npt

from tetra_drake.files import json_number
from tetra_drake.optimizers.base import Evaluation, Iteration, mean_fitness
from tetra_drake.robot.parameter_space import ParameterSpace, Vector
from tetra_drake.scenario.experiment_sections import EvolutionSection

Matrix = npt.NDArray[np.float64]

GAITS = 50
"""Number of gaits in an iteration of random search."""

MIDDLE = 0.5
"""Middle of a range, in units of the range."""


@dataclass(frozen=True)
class Box:
    """Search space of parameters between 0 and 1. An angle, the root, stands for each parameter.

    pycma searches the roots, in units of pi: parameter = (1 - cos(pi root)) / 2. So every root
    gives a valid parameter.
    """

    size: int

    def from_roots(self, roots: Matrix) -> Matrix:
        """Converts roots, the numbers that pycma varies, to parameters: (1 - cos(pi root)) / 2."""
        return 0.5 - 0.5 * np.cos(np.pi * roots)

    def roots(self, points: Matrix) -> Matrix:
        """Converts parameters to roots between 0 and 1; the inverse of from_roots()."""
        return np.arccos(1.0 - 2.0 * points) / np.pi


class Ranges:
    """Search space of an optimiser: the free parameters, scaled so that random gaits have values
    between 0 and 1.

    A search may leave this range. Only floors (lower limits) are respected, and both bounds of the
    numbers of a body; see Box.
    """

    def __init__(self, space: ParameterSpace) -> None:
        self._space = space
        self.free = (space.high > space.low) & ~space.is_coupled
        """True for each parameter of a gait that is free."""
        self.width = (space.high - space.low)[self.free]
        """Range of each free parameter in random gaits."""
        self.size = len(self.width)
        self.floors = (space.floors - space.low)[self.free] / self.width
        in_body = np.zeros(len(self.free), dtype=bool)
        in_body[space.body] = True
        self._in_body = in_body[self.free]
        self._box = Box(int(in_body.sum()))

    def random(self, count: int, generator: np.random.Generator) -> Matrix:
        """Points (count, size) of random gaits, one per row: their free parameters, scaled to 0 to
        1. `size` is the number of free parameters."""
        vectors = np.array([self._space.random(generator) for _ in range(count)])
        return (vectors - self._space.low)[:, self.free] / self.width

    def from_roots(self, roots: Matrix) -> Matrix:
        """Converts roots, the numbers that a search varies, to points (scaled parameters): floor +
        root^2 / (4 (0.5 - floor)). A number of a body is as in Box. Another parameter without a
        floor is its own root.

        Every root is a valid point. Fitness is a smooth function of the root even at the floor. In
        the middle of the range, point and root change at the same rate.
        """
        points = self.floors + roots**2 / (4.0 * (MIDDLE - self.floors))
        points = np.where(np.isfinite(self.floors), points, roots)
        points[..., self._in_body] = self._box.from_roots(roots[..., self._in_body])
        return points

    def roots(self, points: Matrix) -> Matrix:
        """Converts points to roots; the inverse of from_roots(), without negative roots."""
        roots = 2.0 * np.sqrt((MIDDLE - self.floors) * (points - self.floors))
        roots = np.where(np.isfinite(self.floors), roots, points)
        roots[..., self._in_body] = self._box.roots(points[..., self._in_body])
        return roots


SettingsT = TypeVar("SettingsT")


@dataclass(eq=False)
class Generational(Generic[SettingsT]):
    """Random search: each batch is a sample of random gaits. Also the base class of the optimisers
    that learn from a whole batch at a time; they override how the gaits of a batch are chosen.

    The report has mean_fitness over the gaits that did not fail.
    """

    space: ParameterSpace
    evolution: EvolutionSection
    generator: np.random.Generator
    settings: SettingsT
    """Settings of the optimiser in the scenario."""

    def __post_init__(self) -> None:
        self._ranges = Ranges(self.space)
        self._points: Matrix = np.empty((0, self._ranges.size))
        """Points of the last batch."""
        self._report: dict[str, Any] = {}
        """Further numbers about the search, for the report of the iteration."""

    def ask(self) -> list[Vector]:
        """The vectors of the next batch. Values below a floor (lower limit) are raised to it."""
        self._points = self._draw()
        vectors = np.tile(self.space.low, (len(self._points), 1))
        vectors[:, self._ranges.free] += self._points * self._ranges.width
        return [self.space.repair(np.maximum(each, self.space.floors)) for each in vectors]

    def tell(self, evaluations: Sequence[Evaluation]) -> Iteration:
        """Takes the evaluations of the batch that ask() returned last, in the same order. Returns
        the report on it: mean_fitness and `population` (size of the batch). Random search learns
        nothing from the evaluations; subclasses do."""
        mean = mean_fitness(np.array([evaluation.fitness for evaluation in evaluations]))
        counts = {"mean_fitness": json_number(mean), "population": len(self._points)}
        return Iteration(counts | self._report)

    def _draw(self) -> Matrix:
        return self._ranges.random(GAITS, self.generator)
