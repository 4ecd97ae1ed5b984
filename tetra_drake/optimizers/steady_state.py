"""The thesis's steady-state evolutionary algorithm and its operators (section 2.3, listing A.3).

The comparisons are the listing's: an event of probability p happens if a number drawn from
[0, 1) is at least 1 - p.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tetra_drake.files import json_number
from tetra_drake.optimizers.base import Evaluation, Iteration
from tetra_drake.robot.gait import TAU_A, TAU_B, TAU_B_PER_TAU_A, ParameterSpace, Vector
from tetra_drake.scenario import optimizer_kinds as kinds
from tetra_drake.scenario.common_sections import EvolutionSection

CHILDREN = 2

GAIN_MUTATION = 0.2
"""Largest change of a feedback gain in one mutation."""


@dataclass(eq=False)
class SteadyState:
    """An Optimizer: first the random population, then two children per iteration.

    Both children come from the same two parents and the same mutation numbers, before either is
    placed, so they can be evaluated at once. Reports mean_fitness, over members without failure.
    """

    space: ParameterSpace
    evolution: EvolutionSection
    generator: np.random.Generator
    settings: kinds.SteadyState

    def __post_init__(self) -> None:
        self._steps = mutation_steps(self.space, self.settings)
        self._asked: list[Vector] = []
        self._population: list[Vector] = []
        self._fitnesses: Vector = np.empty(0)
        self._means: list[float] = []

    def ask(self) -> list[Vector]:
        """The initial population, then two children at a time."""
        if not self._population:
            count = self.settings.population
            self._asked = [self.space.random(self.generator) for _ in range(count)]
        else:
            self._asked = self._breed()
        return [vector.copy() for vector in self._asked]

    def tell(self, evaluations: Sequence[Evaluation]) -> Iteration:
        """Takes the initial population, or places the children one after the other."""
        if not self._population:
            self._population = self._asked
            self._fitnesses = np.array([e.fitness for e in evaluations], dtype=float)
            placed: list[int | None] = list(range(len(evaluations)))
        else:
            children = zip(self._asked, evaluations, strict=False)  # the last batch may be cut
            placed = [self._place(vector, evaluation) for vector, evaluation in children]
        mean = mean_fitness(self._fitnesses)
        self._means.append(mean)
        settings = self.settings
        levelled_off = has_levelled_off(
            self._means,
            rise=settings.stop_rise,
            window=settings.stop_window,
            after=settings.stop_after,
        )
        return Iteration(
            report={"mean_fitness": json_number(mean)},
            placed=placed,
            stop="mean fitness levelled off" if levelled_off else None,
        )

    def _breed(self) -> list[Vector]:
        settings, generator = self.settings, self.generator
        first, second = cross_over(
            self._select_parent(),
            self._select_parent(),
            probability=settings.crossover_probability,
            generator=generator,
        )
        mutation = draw_mutation(
            self._steps, probability=settings.mutation_probability, generator=generator
        )
        children = []
        for crossed in (first, second):
            child = mutate(crossed, mutation=mutation, floors=self.space.floors)
            children.append(self.space.repair(child))
        return children

    def _select_parent(self) -> Vector:
        tournament, generator = self.settings.tournament, self.generator
        chosen = select_parent(self._fitnesses, tournament=tournament, generator=generator)
        return self._population[chosen]

    def _place(self, vector: Vector, evaluation: Evaluation) -> int | None:
        tournament, generator = self.settings.tournament, self.generator
        fitness = evaluation.fitness
        place = find_place(self._fitnesses, fitness, tournament=tournament, generator=generator)
        if place is not None:
            self._population[place], self._fitnesses[place] = vector, fitness
        return place


def select_parent(fitnesses: Vector, *, tournament: int, generator: np.random.Generator) -> int:
    """The best of a tournament; of equals the first drawn (listing A.3.2)."""
    candidates = generator.integers(0, len(fitnesses), size=tournament)
    return int(candidates[np.argmax(fitnesses[candidates])])


def select_victim(fitnesses: Vector, *, tournament: int, generator: np.random.Generator) -> int:
    """The worst of a tournament; of equals the last drawn (listing A.3.5)."""
    candidates = generator.integers(0, len(fitnesses), size=tournament)[::-1]
    return int(candidates[np.argmin(fitnesses[candidates])])


def cross_over(
    first: Vector, second: Vector, *, probability: float, generator: np.random.Generator
) -> tuple[Vector, Vector]:
    """Two children: the parents with each parameter swapped at this probability."""
    swapped = generator.random(len(first)) >= 1.0 - probability
    return np.where(swapped, second, first), np.where(swapped, first, second)


def mutation_steps(space: ParameterSpace, settings: kinds.SteadyState) -> Vector:
    """Largest change of each parameter in one mutation (Table 6); 0 where its bounds are equal.

    With `tau_mutation: listing`, tau_A does not mutate: the listing's index 26 is that of tau_B.
    """
    is_gain = np.array([name.startswith("gain ") for name in space.names])
    steps = np.where(is_gain, GAIN_MUTATION, settings.weight_mutation)
    step = settings.tau_mutation_range
    steps[TAU_A] = 0.0 if settings.tau_mutation == "listing" else step
    steps[TAU_B] = TAU_B_PER_TAU_A * step
    return np.where(space.low == space.high, 0.0, steps)


def draw_mutation(steps: Vector, *, probability: float, generator: np.random.Generator) -> Vector:
    """Changes of all parameters: 0, or up to the parameter's step with either sign; one draw
    serves both children of an iteration, as in the listing."""
    sign = np.where(generator.random(len(steps)) > 0.5, 1.0, -1.0)
    moved = generator.random(len(steps)) >= 1.0 - probability
    size = steps * generator.random(len(steps))
    return np.where(moved, sign * size, 0.0)


def mutate(vector: Vector, *, mutation: Vector, floors: Vector) -> Vector:
    """The vector with the mutation added; a parameter that would fall to its floor stays. Only
    reductions are checked, as in the listing (A.3.3, A.3.4)."""
    moved = vector + mutation
    return np.where((mutation < 0.0) & ~(moved > floors), vector, moved)


def find_place(
    fitnesses: Vector, child: float, *, tournament: int, generator: np.random.Generator
) -> int | None:
    """Index of the member that a child of this fitness replaces: the worst of a tournament if the
    child is fitter, else the worst of all if it is fitter than that, else None."""
    victim = select_victim(fitnesses, tournament=tournament, generator=generator)
    worst = int(np.argmin(fitnesses))
    for member in (victim, worst):
        if child > fitnesses[member]:
            return member
    return None


def mean_fitness(fitnesses: Vector) -> float:
    """Mean over the members that have not failed; NaN if all have."""
    finite = fitnesses[np.isfinite(fitnesses)]
    return float(np.mean(finite)) if finite.size else float("nan")


def has_levelled_off(means: Sequence[float], *, rise: float, window: int, after: int) -> bool:
    """True if the mean fitness rose by less than `rise` in the last `window` iterations, and
    iteration `after` is over; `means` begins with iteration 0."""
    iteration = len(means) - 1
    long_enough = iteration > after and iteration >= window
    return long_enough and means[iteration] - means[iteration - window] < rise
