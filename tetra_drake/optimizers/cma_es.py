"""CMA-ES with restarts, through pycma (Hansen, arXiv 1604.00772; IPOP: Auger and Hansen, CEC 2005).

A parameter with a lower limit (floor) is replaced by the square root of its distance to the floor
(see Ranges.from_roots). So every point of pycma is valid, and a best point at the floor can be
found.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from tetra_drake.optimizers.base import Evaluation, Iteration
from tetra_drake.optimizers.generational import MIDDLE, Box, Generational, Matrix, Ranges
from tetra_drake.robot.parameter_space import Vector
from tetra_drake.scenario import optimizer_kinds as kinds

TRYOUT = 1000
"""Number of evaluations of each search before the best search is selected. Earlier the fitness says
little about the end: on the thesis's scenario, the fitness of a search after 3,000 evaluations has
a correlation of 0.2 to 0.6 with its fitness after 350, and of 0.7 to 0.9 after 1,000."""

PATIENCE = 700
"""Number of evaluations after which a search that does not rise has stalled."""

RISE = 0.01
"""Share of its whole rise by which the best fitness of a search must rise in PATIENCE."""

SIGMA = 0.3
"""Initial standard deviation, as a share of each parameter's range in random gaits. Near a floor
the standard deviation of the parameter itself is smaller."""

TOLERANCE = 0.05
"""Threshold of convergence: all standard deviations below this share of the ranges."""

GROWTH = 2.0
"""Factor on the population at each restart (IPOP)."""


_one_thread: Any = threadpool_limits.wrap(limits=1, user_api="blas")
"""Decorator that limits linear algebra to one thread. With many parameters, last digits depend on
the number of threads."""


class CmaEsOptimizer(Generational[kinds.CmaEs]):
    """Several searches by CMA-ES, one after another. Each runs for TRYOUT (1,000) evaluations; then
    the search with the best gait continues. When all have stalled, a new search begins.

    A search starts at the mean of the best quarter of a random sample of its own. Without a sample,
    the first starts in the middle of the ranges, the others at random points.

    A failure counts as worse than every success. A search learns nothing from a batch of failures.

    The report also has the number of the search (`start`), its restarts (`restart`), and `sigma`:
    the root mean square of the standard deviations, in units of the ranges.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        affordable = max(1, self.evolution.evaluations // (2 * TRYOUT))
        self._starts = min(self.settings.starts, affordable)
        self._searches: list[Search] = []
        self._current: Search | None = None
        """The search whose points are being evaluated; None for points of a random sample."""

    ask = _one_thread(Generational.ask)

    @_one_thread
    def tell(self, evaluations: Sequence[Evaluation]) -> Iteration:
        """Takes the evaluations of the batch that ask() returned last, in the same order. Returns
        the report on it. The search learns nothing from a batch that the trial's end cut short."""
        iteration = super().tell(evaluations)
        fitnesses = np.array([evaluation.fitness for evaluation in evaluations], dtype=float)
        has_walked = np.isfinite(fitnesses)
        if not has_walked.any() or len(fitnesses) < len(self._points):
            return iteration

        least = np.min(fitnesses[has_walked])
        fitnesses[~has_walked] = least - abs(least) - 1.0
        if self._current is not None:
            self._current.learn(self._points, fitnesses)
        else:
            ranked = self._points[np.argsort(-fitnesses, kind="stable")]
            self._begin(ranked[: max(1, len(ranked) // 4)].mean(axis=0))
        return iteration

    def _draw(self) -> Matrix:
        rising = [search for search in self._searches if not search.has_stalled]
        on_trial = [search for search in rising if search.evaluations < TRYOUT]
        if on_trial:
            self._current = on_trial[0]
        elif rising and len(self._searches) >= self._starts:
            self._current = max(rising, key=lambda search: search.best)
        elif self.settings.sample:
            self._current = None
            self._report = {"start": None, "restart": 0, "sigma": None}
            return self._ranges.random(self.settings.sample, self.generator)
        elif self._searches:
            self._current = self._begin(self._ranges.random(1, self.generator)[0])
        else:
            self._current = self._begin(np.full(self._ranges.size, MIDDLE))

        search = self._current
        points, start = search.draw(), self._searches.index(search)
        self._report = {"start": start, "restart": search.restarts, "sigma": search.sigma}
        return points

    def _begin(self, start: Vector) -> Search:
        search = Search(self.settings.population, self._ranges, self.generator, start)
        self._searches.append(search)
        return search


class Search:
    """A search by CMA-ES for the point of greatest fitness. When it has converged, it restarts at
    its best point with twice the population.

    Args:
        population: size of the first population; None for pycma's default.
        ranges: the search space. It converts points to roots, the numbers that pycma varies.
        generator: source of the random numbers.
        start: the first point (size,).
    """

    def __init__(
        self,
        population: int | None,
        ranges: Ranges | Box,
        generator: np.random.Generator,
        start: Vector,
    ) -> None:
        self._ranges, self._generator = ranges, generator
        self._population = population or 4 + int(3.0 * math.log(max(2, ranges.size)))
        self.evaluations = self.restarts = 0
        self.best = -math.inf
        """Fitness of the best point."""
        self.best_point = start
        self.sigma = SIGMA
        """Standard deviation of the parameters (root mean square) in the last population."""
        self.has_stalled = False
        """True if the best fitness has hardly risen in the last PATIENCE evaluations."""
        self._rises: list[tuple[int, float]] = []
        """Number of evaluations and best fitness after each batch."""
        self._drawn: Matrix = np.empty((0, 0))
        """Roots of the last population. pycma needs two dimensions, so a single parameter gets an
        unused second one."""
        self._strategy: Any = None
        """pycma's search; None before each start."""

    def draw(self) -> Matrix:
        """Draws the next population: points (population, size) of the search space, one per row."""
        import cma

        if self._strategy is None:
            best = self._ranges.roots(self.best_point)
            options = {
                "popsize": self._population,
                "tolx": TOLERANCE,
                "randn": lambda *shape: self._generator.standard_normal(shape),
                "seed": math.nan,  # does not seed numpy's global generator
                "verbose": -10,  # no output, and no file of options
            }
            start = np.pad(best, (0, max(0, 2 - len(best))))
            self._strategy = cma.CMAEvolutionStrategy(start, SIGMA, options)
        self._drawn = np.array(self._strategy.ask())
        self.sigma = float(np.sqrt(np.mean(self._strategy.stds**2)))
        return self._ranges.from_roots(self._drawn[:, : self._ranges.size])

    def learn(self, points: Matrix, fitnesses: Vector) -> None:
        """Takes the points (population, size) that draw() returned last and their fitnesses
        (population,); greater is better. CMA-ES adapts to them."""
        self.evaluations += len(points)
        best = int(np.argmax(fitnesses))
        if fitnesses[best] > self.best:
            self.best, self.best_point = float(fitnesses[best]), points[best].copy()
        self._rises.append((self.evaluations, self.best))
        earlier = [best for count, best in self._rises if count <= self.evaluations - PATIENCE]
        self.has_stalled = bool(
            earlier and self.best - earlier[-1] <= RISE * (self.best - earlier[0])
        )

        told, size = self._drawn, self._ranges.size
        told[:, :size] = np.copysign(self._ranges.roots(points), told[:, :size])
        self._strategy.tell(list(told), (-fitnesses).tolist(), check_points=False)
        if self._strategy.stop():
            self.restarts += 1
            self._population = round(GROWTH * self._population)
            self._strategy = None
