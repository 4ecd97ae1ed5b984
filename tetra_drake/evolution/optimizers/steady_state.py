"""The thesis's steady-state evolutionary algorithm (section 2.3, listing A.3)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from tetra_drake.evolution.optimizers.base import Evaluation, Iteration
from tetra_drake.evolution.optimizers.operators import (
    cross_over,
    draw_mutation,
    find_place,
    has_levelled_off,
    mean_fitness,
    mutate,
    select_parent,
)
from tetra_drake.robot.gait import ParameterSpace, Vector
from tetra_drake.scenario.schema import EvolutionScenario

CHILDREN = 2


class SteadyState:
    """An Optimizer: first the random population, then two children per iteration.

    Both children come from the same two parents and the same mutation numbers, before either is
    placed, so they can be evaluated at once. Reports mean_fitness, over members without failure.
    """

    def __init__(
        self, space: ParameterSpace, settings: EvolutionScenario, generator: np.random.Generator
    ) -> None:
        self._space = space
        self._settings = settings
        self._generator = generator
        self._asked: list[Vector] = []
        self._population: list[Vector] = []
        self._fitnesses = np.empty(0)
        self._means: list[float] = []

    @property
    def evaluations_at_most(self) -> int:
        """Number of evaluations of a trial that is not stopped early."""
        return self._settings.population + CHILDREN * self._settings.max_iterations

    def ask(self) -> list[Vector]:
        """The initial population, then two children at a time."""
        if not self._population:
            count = self._settings.population
            self._asked = [self._space.random(self._generator) for _ in range(count)]
        else:
            self._asked = self._breed()
        return [vector.copy() for vector in self._asked]

    def tell(self, evaluations: Sequence[Evaluation]) -> Iteration:
        """Takes the initial population, or places the children one after the other."""
        fitnesses = [evaluation.fitness for evaluation in evaluations]
        if not self._population:
            self._population = self._asked
            self._fitnesses = np.array(fitnesses, dtype=float)
            placed: tuple[int | None, ...] = tuple(range(len(fitnesses)))
        else:
            placed = tuple(map(self._place, self._asked, fitnesses))
        mean = mean_fitness(self._fitnesses)
        self._means.append(mean)
        report = {"mean_fitness": mean if math.isfinite(mean) else None}
        return Iteration(report=report, placed=placed, stop=self._stop())

    def _breed(self) -> list[Vector]:
        settings, generator, space = self._settings, self._generator, self._space
        first, second = (
            select_parent(self._fitnesses, tournament=settings.tournament, generator=generator)
            for _ in range(2)
        )
        crossed = cross_over(
            self._population[first],
            self._population[second],
            probability=settings.crossover_probability,
            generator=generator,
        )
        mutation = draw_mutation(
            space.steps, probability=settings.mutation_probability, generator=generator
        )
        return [space.repair(mutate(c, mutation=mutation, floors=space.floors)) for c in crossed]

    def _place(self, vector: Vector, fitness: float) -> int | None:
        tournament, generator = self._settings.tournament, self._generator
        place = find_place(self._fitnesses, fitness, tournament=tournament, generator=generator)
        if place is not None:
            self._population[place] = vector
            self._fitnesses[place] = fitness
        return place

    def _stop(self) -> str | None:
        settings = self._settings
        if len(self._means) - 1 >= settings.max_iterations:
            return "all iterations done"
        levelled_off = has_levelled_off(
            self._means,
            rise=settings.stop_rise,
            window=settings.stop_window,
            after=settings.stop_after,
        )
        return "mean fitness levelled off" if levelled_off else None
