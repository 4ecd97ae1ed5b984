"""Random search, the baseline of all others."""

from __future__ import annotations

from tetra_drake.evolution.optimizers.generational import Generational
from tetra_drake.robot.gait import Vector


class RandomSearch(Generational):
    """Draws random gaits, as many at a time as the population of the thesis's algorithm."""

    def _draw(self) -> list[Vector]:
        count = self._settings.population
        return [self._space.random(self._generator) for _ in range(count)]
