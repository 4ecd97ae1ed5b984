"""CMA-ES with restarts, through pycma (Hansen, arXiv 1604.00772; IPOP: Auger and Hansen, CEC 2005).

Below a floor the search space is mirrored, so that no vector is thrown away there.
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
    """First the random sample, then runs of CMA-ES: the first one from the best of the sample,
    each further one from the next best. Reports besides sigma, the standard deviation of the
    parameters in units of their ranges (root mean square), population, and number of restarts."""

    def __init__(
        self,
        space: ParameterSpace,
        settings: EvolutionScenario,
        generator: np.random.Generator,
        own: kinds.CmaEs | None = None,
    ) -> None:
        super().__init__(space, settings, generator)
        self._own = own or kinds.CmaEs()
        self._ranges = Ranges(space)
        self._size = max(2, self._ranges.size)  # pycma knows no fewer dimensions
        self._population = self._own.population or 4 + int(3.0 * math.log(self._size))
        self._restart = -1
        self._starts: list[Vector] = []
        """Best first."""
        self._points: Matrix = np.empty((0, self._size))
        """Those asked for."""
        self._strategy: Any = None
        """None during the sample."""
        if not self._own.sample:
            self._starts = [np.full(self._size, MIDDLE)]
            self._begin()

    def _draw(self) -> list[Vector]:
        if self._strategy is None:
            self._points = np.array([self._random() for _ in range(self._own.sample)])
        else:
            self._points = np.array(self._strategy.ask())
        return [self._vector(point) for point in self._points]

    def _learn(self, fitnesses: Vector) -> None:
        if self._strategy is None:
            self._starts = list(self._points[np.argsort(-fitnesses, kind="stable")])
            self._begin()
            return
        self._strategy.tell(list(self._points), (-fitnesses).tolist())
        if self._strategy.stop():
            self._population = round(self._own.growth * self._population)
            self._begin()

    def _state(self) -> Mapping[str, Any]:
        sigma = None
        if self._strategy is not None:
            sigma = float(np.sqrt(np.mean(self._strategy.stds**2)))
        return {"sigma": sigma, "population": len(self._points), "restart": max(0, self._restart)}

    def _begin(self) -> None:
        """Begins a run of CMA-ES."""
        import cma

        start = self._starts.pop(0) if self._starts else self._random()
        self._restart += 1
        options = {
            "popsize": self._population,
            "randn": lambda *shape: self._generator.standard_normal(shape),
            "seed": math.nan,  # leaves the generator of numpy alone
            "verbose": -10,  # and reads no file of signals
        }
        self._strategy = cma.CMAEvolutionStrategy(start, self._own.sigma, options)

    def _random(self) -> Vector:
        point = self._ranges.point(self._space.random(self._generator))
        return np.pad(point, (0, self._size - len(point)))

    def _vector(self, point: Vector) -> Vector:
        floors, point = self._ranges.floors, point[: self._ranges.size]
        return self._ranges.vector(np.where(point < floors, 2.0 * floors - point, point))
