"""The thesis's steady-state evolutionary algorithm and its operators (section 2.3, listing A.3).

Comparisons are as in the listing: an event of probability p happens if a random number from [0, 1)
is at least 1 - p.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from tetra_drake.files import json_number
from tetra_drake.laws.matsuoka import TAU_B_PER_TAU_A
from tetra_drake.optimizers.base import Evaluation, Iteration, mean_fitness
from tetra_drake.robot.parameter_space import ParameterSpace, Vector
from tetra_drake.scenario import optimizer_kinds as kinds
from tetra_drake.scenario.experiment_sections import EvolutionSection

GAIN_MUTATION = 0.2
"""Largest change of a feedback gain in one mutation."""

RANGE_MUTATION = 0.1
"""Largest change of any other parameter in one mutation, as a share of its range."""


@dataclass(eq=False)
class SteadyStateOptimizer:
    """The thesis's optimiser: a random population, then two children per iteration.

    Both children have the same parents and the same mutation. Both are made before either enters
    the population, so they can be evaluated at the same time. The report has mean_fitness over the
    members that did not fail.
    """

    space: ParameterSpace
    evolution: EvolutionSection
    generator: np.random.Generator
    settings: kinds.SteadyState

    _asked: list[Vector] = field(init=False, default_factory=list)
    _population: list[Vector] = field(init=False, default_factory=list)
    _fitnesses: Vector = field(init=False)
    _means: list[float] = field(init=False, default_factory=list)

    def ask(self) -> list[Vector]:
        """Vectors to evaluate: at first the initial population, then two children at a time."""
        settings, generator, space = self.settings, self.generator, self.space
        if not self._population:
            self._asked = [space.random(generator) for _ in range(settings.population)]
        else:
            size = settings.tournament
            first, second = (
                select_parent(self._fitnesses, tournament=size, generator=generator)
                for _ in range(2)
            )
            parents = self._population[first], self._population[second]
            children = make_children(*parents, space, settings, generator)
            self._asked = [space.repair(child) for child in children]
        return [vector.copy() for vector in self._asked]

    def tell(self, evaluations: Sequence[Evaluation]) -> Iteration:
        """Takes the evaluations of the vectors from ask(), in the same order: of the initial
        population, or of two children. The children replace members of the population one after the
        other; see find_place(). Returns a report on the iteration."""
        placed: list[int | None] = []
        if not self._population:
            self._population = self._asked
            self._fitnesses = np.array([e.fitness for e in evaluations], dtype=float)
            placed += range(len(evaluations))
        else:
            size, generator = self.settings.tournament, self.generator
            # The last batch may be cut.
            for vector, evaluation in zip(self._asked, evaluations, strict=False):
                fitness = evaluation.fitness
                member = find_place(self._fitnesses, fitness, tournament=size, generator=generator)
                if member is not None:
                    self._population[member], self._fitnesses[member] = vector, fitness
                placed.append(member)

        mean = mean_fitness(self._fitnesses)
        self._means.append(mean)
        levelled_off = has_levelled_off(self._means, self.settings)
        return Iteration(
            report={"mean_fitness": json_number(mean)},
            placed=placed,
            stop="mean fitness levelled off" if levelled_off else None,
        )


def select_parent(fitnesses: Vector, *, tournament: int, generator: np.random.Generator) -> int:
    """Index of a parent: the fittest of `tournament` members, drawn at random with replacement.
    Among equals the first drawn wins (listing A.3.2 of the thesis)."""
    candidates = generator.integers(0, len(fitnesses), size=tournament)
    return int(candidates[np.argmax(fitnesses[candidates])])


def mutation_steps(space: ParameterSpace, settings: kinds.SteadyState) -> Vector:
    """Largest change of each parameter in one mutation: of weights, gains and time constants as in
    Table 6 of the thesis, of others a tenth of the range; 0 if the bounds are equal.

    With `tau_mutation: listing`, tau_A does not mutate, like in the thesis's listing A.3.4, whose
    index 26 means tau_B.
    """
    tau = settings.tau_mutation_range
    of_word = {
        "weight": settings.weight_mutation,
        "gain": GAIN_MUTATION,
        "tau_A": 0.0 if settings.tau_mutation == "listing" else tau,
        "tau_B": TAU_B_PER_TAU_A * tau,
    }
    ranges = (RANGE_MUTATION * (space.high - space.low)).tolist()
    given = zip(space.names, ranges, strict=True)
    steps = np.array([of_word.get(name.partition(" ")[0], share) for name, share in given])
    return np.where(space.low == space.high, 0.0, steps)


def make_children(
    first: Vector,
    second: Vector,
    space: ParameterSpace,
    settings: kinds.SteadyState,
    generator: np.random.Generator,
) -> list[Vector]:
    """Two children of two parents, by crossover and mutation (listings A.3.3 and A.3.4 of the
    thesis).

    A child is a copy of a parent; with `crossover_probability` a parameter is swapped with the
    other child. With `mutation_probability` a parameter moves up or down, by at most its step; see
    mutation_steps().

    Both children get the same changes, and only reductions are checked, like in the listing: a
    parameter that would fall to its floor (lower limit) or below stays as it is.
    """
    steps, count = mutation_steps(space, settings), len(first)
    swapped = generator.random(count) >= 1.0 - settings.crossover_probability
    children = np.where(swapped, second, first), np.where(swapped, first, second)

    sign = np.where(generator.random(count) > 0.5, 1.0, -1.0)
    moves = generator.random(count) >= 1.0 - settings.mutation_probability
    change = np.where(moves, sign * (steps * generator.random(count)), 0.0)
    return [
        np.where((change < 0.0) & ~(child + change > space.floors), child, child + change)
        for child in children
    ]


def find_place(
    fitnesses: Vector, child: float, *, tournament: int, generator: np.random.Generator
) -> int | None:
    """Index of the member that a child with fitness `child` replaces; None if there is none.

    If the child is fitter than the worst of a tournament, it replaces this member; among equals the
    last drawn counts (listing A.3.5 of the thesis). Otherwise, if it is fitter than the worst of
    the population, it replaces that member.
    """
    drawn = generator.integers(0, len(fitnesses), size=tournament)[::-1]
    victim = int(drawn[np.argmin(fitnesses[drawn])])
    for member in (victim, int(np.argmin(fitnesses))):
        if child > fitnesses[member]:
            return member
    return None


def has_levelled_off(means: Sequence[float], settings: kinds.SteadyState) -> bool:
    """True if the mean fitness rose by less than `stop_rise` in the last `stop_window` iterations.
    False up to iteration `stop_after`. `means` begins with iteration 0."""
    iteration, window = len(means) - 1, settings.stop_window
    long_enough = iteration > settings.stop_after and iteration >= window
    return long_enough and means[iteration] - means[iteration - window] < settings.stop_rise
