"""Random search, the baseline of all others."""

from tetra_drake.optimizers.generational import Generational, Matrix
from tetra_drake.scenario import optimizer_kinds as kinds

GAITS = 50
"""Gaits of an iteration."""


class RandomSearch(Generational[kinds.RandomSearch]):
    """Draws random gaits."""

    def _draw(self) -> Matrix:
        return self._random(GAITS)
