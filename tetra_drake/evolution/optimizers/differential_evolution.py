"""Differential evolution that adapts itself: L-SHADE (Tanabe and Fukunaga, CEC 2014)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from tetra_drake.evolution.optimizers.generational import Generational, Matrix
from tetra_drake.robot.gait import ParameterSpace, Vector
from tetra_drake.scenario import optimizers as kinds
from tetra_drake.scenario.schema import EvolutionScenario

MEMORIES, LEAST, SPREAD = 6, 4, 0.1


class DifferentialEvolution(Generational):
    """First the random population, then one trial vector for each member, which it replaces if it
    is fitter: current-to-pbest/1 with an archive of replaced members and binomial crossover.
    Reports besides scale and crossover, the means of what F and CR are drawn around."""

    def __init__(
        self,
        space: ParameterSpace,
        settings: EvolutionScenario,
        generator: np.random.Generator,
        own: kinds.DifferentialEvolution | None = None,
    ) -> None:
        super().__init__(space, settings, generator)
        self._own = own or kinds.DifferentialEvolution()
        self._members: Matrix = np.empty((0, self._ranges.size))
        """By fitness, the best first."""
        self._fitnesses = np.empty(0)
        self._archive = self._members
        self._memory = np.full((MEMORIES, 2), 0.5)
        """What F and CR are drawn around; row `_oldest` is overwritten next."""
        self._oldest = 0
        self._drawn = np.empty((0, 2))
        """F and CR of the points."""

    def _draw(self) -> Matrix:
        return self._breed() if len(self._members) else self._random(self._own.population)

    def _breed(self) -> Matrix:
        """A trial vector for each member x: x + F (best - x) + F (r1 - r2), crossed with x."""
        members, generator = self._members, self._generator
        count, size = members.shape
        around = self._memory[generator.integers(MEMORIES, size=count)]
        scale = around[:, 0] + SPREAD * np.tan(np.pi * (generator.random(count) - 0.5))  # Cauchy
        while (scale <= 0.0).any():
            again = around[:, 0] + SPREAD * np.tan(np.pi * (generator.random(count) - 0.5))
            scale = np.where(scale <= 0.0, again, scale)
        crossover = np.clip(generator.normal(around[:, 1], SPREAD), 0.0, 1.0)
        self._drawn = np.column_stack([np.minimum(scale, 1.0), crossover])
        best = members[generator.integers(max(2, round(self._own.greed * count)), size=count)]
        # All differ: x, r1 of the members, r2 of members and archive.
        every, own = np.vstack([members, self._archive]), np.arange(count)
        first = generator.integers(count - 1, size=count)
        first += first >= own
        second = generator.integers(len(every) - 2, size=count)
        second += second >= np.minimum(own, first)
        second += second >= np.maximum(own, first)
        moved = members + self._drawn[:, :1] * (best - members + every[first] - every[second])
        floors = np.broadcast_to(self._ranges.floors, moved.shape)
        moved = np.where(moved < floors, 0.5 * (floors + members), moved)
        crossed = generator.random((count, size)) < self._drawn[:, 1:]
        crossed[own, generator.integers(size, size=count)] = True
        return np.where(crossed, moved, members)

    def _learn(self, fitnesses: Vector) -> None:
        if not len(self._members):
            self._members, self._fitnesses = self._points, fitnesses
        else:
            better = fitnesses > self._fitnesses
            if better.any():
                self._remember(self._drawn[better], (fitnesses - self._fitnesses)[better])
            self._archive = np.vstack([self._archive, self._members[better]])
            self._members = np.where(better[:, None], self._points, self._members)
            self._fitnesses = np.maximum(self._fitnesses, fitnesses)
        largest, budget = self._own.population, self._settings.budget
        count = round(LEAST + (largest - LEAST) * self._left / budget)
        order = np.argsort(-self._fitnesses, kind="stable")[:count]
        self._members, self._fitnesses = self._members[order], self._fitnesses[order]
        kept = self._generator.permutation(len(self._archive))[: len(order)]
        self._archive = self._archive[kept]

    def _remember(self, drawn: Matrix, rises: Vector) -> None:
        """Lehmer means of F and CR, weighted by how much fitter they made a member."""
        sums = rises @ drawn
        means = np.divide(rises @ drawn**2, sums, out=np.zeros(2), where=sums > 0.0)
        self._memory[self._oldest] = means
        self._oldest = (self._oldest + 1) % MEMORIES

    def _state(self) -> Mapping[str, Any]:
        scale, crossover = self._memory.mean(axis=0).tolist()
        return {"scale": scale, "crossover": crossover}
