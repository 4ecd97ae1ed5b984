"""CMA-ES with restarts, through pycma (Hansen, arXiv 1604.00772; IPOP: Auger and Hansen, CEC 2005).

pycma searches the roots of the distances to floors (see Ranges.from_roots), so that no vector is
thrown away, and nothing keeps it from a best vector at a floor.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from tetra_drake.evolution.optimizers.generational import (
    MIDDLE,
    Generational,
    Matrix,
    Ranges,
)
from tetra_drake.robot.gait import ParameterSpace, Vector
from tetra_drake.scenario import optimizers as kinds
from tetra_drake.scenario.schema import EvolutionScenario


class CmaEs(Generational):
    """Several searches by CMA-ES, each for some evaluations; the one with the best point goes on.

    Where they end is decided early and differs much more between searches than within one. Trying
    them out takes half of the evaluations at most. Reports besides the number of the search
    (`start`), its restarts, and sigma, the standard deviation of its parameters in units of their
    ranges (root mean square).
    """

    def __init__(
        self,
        space: ParameterSpace,
        settings: EvolutionScenario,
        generator: np.random.Generator,
        own: kinds.CmaEs | None = None,
    ) -> None:
        super().__init__(space, settings, generator)
        self._own = own = own or kinds.CmaEs()
        starts = min(own.starts, max(1, settings.budget // (2 * own.tryout)))
        self._searches = [_Search(own, self._ranges, generator) for _ in range(starts)]
        self._current = self._searches[0]

    def _draw(self) -> Matrix:
        untried = (each for each in self._searches if each.evaluations < self._own.tryout)
        self._current = next(untried, None) or max(self._searches, key=lambda each: each.best)
        if self._current.begun:
            return self._current.draw()
        return self._random(self._own.sample)

    def _learn(self, fitnesses: Vector) -> None:
        self._current.learn(self._points, fitnesses)

    def _state(self) -> Mapping[str, Any]:
        start = self._searches.index(self._current)
        return {"start": start, "restart": self._current.restarts, "sigma": self._current.sigma}


class _Search:
    """CMA-ES from the mean of the best quarter of a random sample or, without one, from the middle;
    where it has converged, anew around its best point, with a larger population."""

    def __init__(self, own: kinds.CmaEs, ranges: Ranges, generator: np.random.Generator) -> None:
        self._own, self._ranges, self._generator = own, ranges, generator
        self._population = own.population or 4 + int(3.0 * math.log(max(2, ranges.size)))
        self.evaluations = self.restarts = 0
        self.best = -math.inf
        """Fitness of the best point."""
        self._best = np.full(ranges.size, MIDDLE)
        self._drawn: Matrix = np.empty((0, 0))
        """The roots drawn last, with a second one where there is a single parameter only, as pycma
        knows no single dimension."""
        self._strategy: Any = None
        """None during the sample."""
        if not own.sample:
            self._begin(self._best)

    @property
    def begun(self) -> bool:
        """Whether the sample is done."""
        return self._strategy is not None

    @property
    def sigma(self) -> float | None:
        """Standard deviation of the parameters (root mean square); None during the sample."""
        return float(np.sqrt(np.mean(self._strategy.stds**2))) if self.begun else None

    def draw(self) -> Matrix:
        """Points of the distribution."""
        self._drawn = np.array(self._strategy.ask())
        return self._ranges.from_roots(self._drawn[:, : self._ranges.size])

    def learn(self, points: Matrix, fitnesses: Vector) -> None:
        """Takes the points evaluated for it and their fitnesses."""
        self.evaluations += len(points)
        order = np.argsort(-fitnesses, kind="stable")
        if fitnesses[order[0]] > self.best:
            self.best, self._best = float(fitnesses[order[0]]), points[order[0]].copy()
        if not self.begun:
            self._begin(points[order[: max(1, len(order) // 4)]].mean(axis=0))
            return
        told, size = self._drawn, self._ranges.size
        told[:, :size] = np.copysign(self._ranges.roots(points), told[:, :size])
        self._strategy.tell(list(told), (-fitnesses).tolist(), check_points=False)
        if self._strategy.stop():
            self.restarts += 1
            self._population = round(self._own.growth * self._population)
            self._begin(self._best)

    def _begin(self, start: Vector) -> None:
        import cma

        options = {
            "popsize": self._population,
            "tolx": self._own.tolerance,
            "randn": lambda *shape: self._generator.standard_normal(shape),
            "seed": math.nan,  # leaves the generator of numpy alone
            "verbose": -10,  # and reads no file of signals
        }
        roots = np.pad(self._ranges.roots(start), (0, max(0, 2 - len(start))))
        self._strategy = cma.CMAEvolutionStrategy(roots, self._own.sigma, options)
