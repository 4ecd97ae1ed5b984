"""CMA-ES with restarts, through pycma (Hansen, arXiv 1604.00772; IPOP: Auger and Hansen, CEC 2005).

Below a floor the search space is mirrored, so that no vector is thrown away there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tetra_drake.evolution.optimizers.generational import Generational, Matrix
from tetra_drake.robot.gait import ParameterSpace, Vector
from tetra_drake.scenario import optimizers as kinds
from tetra_drake.scenario.schema import EvolutionScenario

MIDDLE = 0.5


class CmaEs(Generational):
    """First the random sample, then runs of CMA-ES: the first one from the best of the sample,
    each further one from the next best. Reports besides the number of restarts, and sigma, the
    standard deviation of the parameters in units of their ranges (root mean square)."""

    def __init__(
        self,
        space: ParameterSpace,
        settings: EvolutionScenario,
        generator: np.random.Generator,
        own: kinds.CmaEs | None = None,
    ) -> None:
        super().__init__(space, settings, generator)
        self._own = own or kinds.CmaEs()
        self._population = self._own.population or 4 + int(
            3.0 * math.log(max(2, self._ranges.size))
        )
        self._restart = -1
        self._starts: list[Vector] = []
        """Best first."""
        self._raw: list[Vector] = []
        """What pycma has drawn: the points before mirroring."""
        self._strategy: Any = None
        """None during the sample."""
        if not self._own.sample:
            self._starts = [np.full(self._ranges.size, MIDDLE)]
            self._begin()

    def follow(self, vectors: Sequence[Vector]) -> None:
        """Takes these vectors in place of those asked for, as if none had been mirrored."""
        super().follow(vectors)
        self._raw[: len(vectors)] = map(self._padded, self._points[: len(vectors)])

    def _draw(self) -> Matrix:
        if self._strategy is None:
            return self._random(self._own.sample)
        self._raw = self._strategy.ask()
        return self._ranges.mirrored(np.array(self._raw)[:, : self._ranges.size])

    def _learn(self, fitnesses: Vector) -> None:
        if self._strategy is None:
            self._starts = list(self._points[np.argsort(-fitnesses, kind="stable")])
            self._begin()
            return
        self._strategy.tell(self._raw, (-fitnesses).tolist(), check_points=False)
        if self._strategy.stop():
            self._population = round(self._own.growth * self._population)
            self._begin()

    def _state(self) -> Mapping[str, Any]:
        if self._strategy is None:
            return {"restart": 0, "sigma": None}
        sigma = float(np.sqrt(np.mean(self._strategy.stds**2)))
        return {"restart": self._restart, "sigma": sigma}

    def _begin(self) -> None:
        """Begins a run of CMA-ES."""
        import cma

        start = self._starts.pop(0) if self._starts else self._random(1)[0]
        self._restart += 1
        options = {
            "popsize": self._population,
            "tolx": self._own.tolerance,
            "randn": lambda *shape: self._generator.standard_normal(shape),
            "seed": math.nan,  # leaves the generator of numpy alone
            "verbose": -10,  # and reads no file of signals
        }
        self._strategy = cma.CMAEvolutionStrategy(self._padded(start), self._own.sigma, options)

    def _padded(self, point: Vector) -> Vector:
        """With a second number, which does nothing, if there is only one: pycma needs two."""
        return np.pad(point, (0, max(0, 2 - len(point))))
