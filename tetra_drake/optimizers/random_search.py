"""Random search, the baseline of all others."""

import numpy as np

from tetra_drake.optimizers.generational import Generational, Matrix
from tetra_drake.robot.gait import ParameterSpace
from tetra_drake.scenario import optimizer_kinds as kinds
from tetra_drake.scenario.settings import EvolutionSection


class RandomSearch(Generational):
    """Draws random gaits."""

    def __init__(
        self,
        space: ParameterSpace,
        evolution: EvolutionSection,
        generator: np.random.Generator,
        settings: kinds.RandomSearch | None = None,
    ) -> None:
        super().__init__(space, evolution, generator)
        self._population = (settings or kinds.RandomSearch()).population

    def _draw(self) -> Matrix:
        return self._random(self._population)
