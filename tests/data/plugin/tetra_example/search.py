"""An optimiser: it keeps the best gait and looks around it."""

import math

from pydantic import Field

from tetra_drake.optimizers.base import Iteration
from tetra_drake.scenario.optimizer_kinds import OptimizerSettings


class HillClimb(OptimizerSettings):
    """Search that changes the best gait at random."""

    module = __name__

    step: float = Field(default=0.1, gt=0)
    """Standard deviation of the changes, as a share of the ranges of random gaits."""


class HillClimbOptimizer:
    def __init__(self, space, evolution, generator, *, settings):
        self.space, self.generator, self.settings = space, generator, settings
        self.best, self.fitness = space.random(generator), -math.inf
        self.tried = self.best

    def ask(self):
        step = self.settings.step * (self.space.high - self.space.low)
        if math.isfinite(self.fitness):
            change = step * self.generator.normal(size=step.size)
            self.tried = self.space.repair(abs(self.best + change))
        return [self.tried]

    def tell(self, evaluations):
        if evaluations[0].fitness >= self.fitness:
            self.best, self.fitness = self.tried, evaluations[0].fitness
        return Iteration({"mean_fitness": evaluations[0].fitness, "population": 1})
