"""Random search, the baseline of all others."""

from tetra_drake.optimizers.generational import Generational, Matrix


class RandomSearch(Generational):
    """Draws random gaits, as many at a time as the population of the thesis's algorithm."""

    def _draw(self) -> Matrix:
        return self._random(self._settings.population)
