"""Random search: the baseline for the other optimisers."""

from tetra_drake.optimizers.generational import Generational, Matrix
from tetra_drake.scenario import optimizer_kinds as kinds

GAITS = 50
"""Number of gaits per iteration."""


class RandomSearchOptimizer(Generational[kinds.RandomSearch]):
    """An optimiser that only draws random gaits."""

    def _draw(self) -> Matrix:
        return self._random(GAITS)
