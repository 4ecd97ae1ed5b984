"""The thesis's steady-state evolutionary algorithm (section 2.3, listing A.3)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tetra_drake.evolution.genome import (
    couple_tau_b,
    mutation_limits,
    random_genome,
)
from tetra_drake.evolution.optimizers.base import Genome, Iteration
from tetra_drake.evolution.optimizers.operators import (
    cross_over,
    draw_mutation,
    find_place,
    has_levelled_off,
    mean_fitness,
    mutate,
    select_parent,
)
from tetra_drake.scenario.schema import Scenario

CHILDREN = 2


class SteadyState:
    """An Optimizer: first the random population, then two children an iteration.

    Both children of an iteration come from the same two parents and the same mutation
    numbers, before either is placed; that is why they can be evaluated at once.
    """

    def __init__(self, scenario: Scenario, generator: np.random.Generator) -> None:
        self._scenario = scenario
        self._settings = scenario.evolution
        self._limits = mutation_limits(scenario)
        self._couples_tau_b = not scenario.evolution.independent_tau_b
        self._generator = generator
        self._asked: list[Genome] = []
        self._genomes: list[Genome] = []
        self._fitnesses = np.empty(0)
        self._means: list[float] = []

    @property
    def evaluations_at_most(self) -> int:
        """How many evaluations a trial has if it is not stopped early."""
        return self._settings.population + CHILDREN * self._settings.max_iterations

    def ask(self) -> list[Genome]:
        """The initial population, then two children at a time."""
        if not self._genomes:
            count = self._settings.population
            self._asked = [random_genome(self._scenario, self._generator) for _ in range(count)]
        else:
            self._asked = list(self._breed())
        return [genome.copy() for genome in self._asked]

    def tell(self, fitnesses: Sequence[float]) -> Iteration:
        """Takes in the initial population, or places the children one after the other."""
        if len(fitnesses) != len(self._asked):
            raise ValueError(f"told {len(fitnesses)} fitnesses for {len(self._asked)} genomes")
        placed: tuple[int | None, ...]
        if not self._genomes:
            self._genomes = self._asked
            self._fitnesses = np.array(fitnesses, dtype=float)
            placed = tuple(range(len(fitnesses)))
        else:
            children = zip(self._asked, fitnesses, strict=True)
            placed = tuple(self._place(genome, fitness) for genome, fitness in children)
        self._means.append(mean_fitness(self._fitnesses))
        return Iteration(mean_fitness=self._means[-1], placed=placed, stop=self._stop())

    def _breed(self) -> tuple[Genome, Genome]:
        settings, generator = self._settings, self._generator
        parents = [
            self._genomes[
                select_parent(self._fitnesses, tournament=settings.tournament, generator=generator)
            ]
            for _ in range(2)
        ]
        crossed = cross_over(
            *parents, probability=settings.crossover_probability, generator=generator
        )
        mutation = draw_mutation(
            self._limits.reach, probability=settings.mutation_probability, generator=generator
        )
        first, second = (
            mutate(child, mutation=mutation, floors=self._limits.floors) for child in crossed
        )
        if self._couples_tau_b:
            return couple_tau_b(first), couple_tau_b(second)
        return first, second

    def _place(self, genome: Genome, fitness: float) -> int | None:
        place = find_place(
            self._fitnesses,
            fitness,
            tournament=self._settings.tournament,
            generator=self._generator,
        )
        if place is not None:
            self._genomes[place] = genome
            self._fitnesses[place] = fitness
        return place

    def _stop(self) -> str | None:
        settings = self._settings
        if len(self._means) - 1 >= settings.max_iterations:
            return "all iterations done"
        if has_levelled_off(
            self._means,
            rise=settings.stop_rise,
            window=settings.stop_window,
            after=settings.stop_after,
        ):
            return "mean fitness levelled off"
        return None
