"""CMA-ES with restarts, through pycma (Hansen, arXiv 1604.00772; IPOP: Auger and Hansen, CEC 2005).

Below a floor the search space is mirrored, so that no vector is thrown away there; pycma is told
the mirror images.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from tetra_drake.evolution.optimizers.generational import Generational, Matrix
from tetra_drake.robot.gait import ParameterSpace, Vector
from tetra_drake.scenario import optimizers as kinds
from tetra_drake.scenario.schema import EvolutionScenario

MIDDLE = 0.5


class CmaEs(Generational):
    """First a random sample, then CMA-ES from the mean of its best quarter; where it has converged,
    anew around the best point so far, with a larger population. Reports besides the number of
    restarts, and sigma, the standard deviation of the parameters in units of their ranges (root
    mean square)."""

    def __init__(
        self,
        space: ParameterSpace,
        settings: EvolutionScenario,
        generator: np.random.Generator,
        own: kinds.CmaEs | None = None,
    ) -> None:
        super().__init__(space, settings, generator)
        self._own = own = own or kinds.CmaEs()
        self._size = self._ranges.size
        self._population = own.population or 4 + int(3.0 * math.log(max(2, self._size)))
        self._restarts = 0
        self._best = -math.inf, np.full(self._size, MIDDLE)
        """Fitness and point."""
        self._spare: Matrix = np.empty((0, 0))
        """Coordinates of pycma's that no parameter has."""
        self._strategy: Any = None
        """None during the sample."""
        if not own.sample:
            self._begin(self._best[1])

    def _draw(self) -> Matrix:
        if self._strategy is None:
            return self._random(self._own.sample)
        drawn = np.array(self._strategy.ask())
        self._spare = drawn[:, self._size :]
        return self._ranges.mirrored(drawn[:, : self._size])

    def _learn(self, fitnesses: Vector) -> None:
        order = np.argsort(-fitnesses, kind="stable")
        if fitnesses[order[0]] > self._best[0]:
            self._best = float(fitnesses[order[0]]), self._points[order[0]].copy()
        if self._strategy is None:
            self._begin(self._points[order[: max(1, len(order) // 4)]].mean(axis=0))
            return
        told = np.hstack([self._points, self._spare])
        self._strategy.tell(list(told), (-fitnesses).tolist(), check_points=False)
        if self._strategy.stop():
            self._restarts += 1
            self._population = round(self._own.growth * self._population)
            self._begin(self._best[1])

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

    def _state(self) -> Mapping[str, Any]:
        sigma = None
        if self._strategy is not None:
            sigma = float(np.sqrt(np.mean(self._strategy.stds**2)))
        return {"restart": self._restarts, "sigma": sigma}
