"""CMA-ES with restarts, through pycma (Hansen, arXiv 1604.00772; IPOP: Auger and Hansen, CEC 2005).

Below a floor the search space is mirrored, so that no vector is thrown away there; pycma is told
the mirror images.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from tetra_drake.evolution.optimizers.generational import Generational, Matrix, Ranges
from tetra_drake.robot.gait import ParameterSpace, Vector
from tetra_drake.scenario import optimizers as kinds
from tetra_drake.scenario.schema import EvolutionScenario

MIDDLE = 0.5


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
            return self._ranges.mirrored(self._current.draw())
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
        self._own, self._generator, self._size = own, generator, ranges.size
        self._population = own.population or 4 + int(3.0 * math.log(max(2, self._size)))
        self.evaluations = self.restarts = 0
        self.best = -math.inf
        """Fitness of the best point."""
        self._best = np.full(self._size, MIDDLE)
        self._spare: Matrix = np.empty((0, 0))
        """Coordinates of pycma's that no parameter has."""
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
        """Points of the normal distribution, also below floors."""
        drawn = np.array(self._strategy.ask())
        self._spare = drawn[:, self._size :]
        return drawn[:, : self._size]

    def learn(self, points: Matrix, fitnesses: Vector) -> None:
        """Takes the points evaluated for it and their fitnesses."""
        self.evaluations += len(points)
        order = np.argsort(-fitnesses, kind="stable")
        if fitnesses[order[0]] > self.best:
            self.best, self._best = float(fitnesses[order[0]]), points[order[0]].copy()
        if not self.begun:
            self._begin(points[order[: max(1, len(order) // 4)]].mean(axis=0))
            return
        told = np.hstack([points, self._spare])
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
        padded = np.pad(start, (0, max(0, 2 - self._size)))  # as pycma knows no single dimension
        self._strategy = cma.CMAEvolutionStrategy(padded, self._own.sigma, options)
