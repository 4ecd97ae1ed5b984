"""Evolutionary operators of the thesis (section 2.3, listing A.3): pure functions on vectors.

The comparisons are the listing's: an event of probability p happens if a number drawn from
[0, 1) is at least 1 - p.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from tetra_drake.robot.gait import Vector

Fitnesses = npt.NDArray[np.float64]


def select_parent(fitnesses: Fitnesses, *, tournament: int, generator: np.random.Generator) -> int:
    """The best of a tournament; of equals the first drawn (listing A.3.2)."""
    candidates = generator.integers(0, len(fitnesses), size=tournament)
    return int(candidates[np.argmax(fitnesses[candidates])])


def select_victim(fitnesses: Fitnesses, *, tournament: int, generator: np.random.Generator) -> int:
    """The worst of a tournament; of equals the last drawn (listing A.3.5)."""
    candidates = generator.integers(0, len(fitnesses), size=tournament)[::-1]
    return int(candidates[np.argmin(fitnesses[candidates])])


def cross_over(
    first: Vector, second: Vector, *, probability: float, generator: np.random.Generator
) -> tuple[Vector, Vector]:
    """Two children: the parents with each parameter swapped at this probability."""
    swapped = generator.random(len(first)) >= 1.0 - probability
    return np.where(swapped, second, first), np.where(swapped, first, second)


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
    fitnesses: Fitnesses, child: float, *, tournament: int, generator: np.random.Generator
) -> int | None:
    """Index of the member that a child of this fitness replaces: the worst of a tournament if the
    child is fitter, else the worst of all if it is fitter than that, else None."""
    victim = select_victim(fitnesses, tournament=tournament, generator=generator)
    return next((m for m in (victim, int(np.argmin(fitnesses))) if child > fitnesses[m]), None)


def mean_fitness(fitnesses: Fitnesses) -> float:
    """Mean over the members that have not failed; NaN if all have."""
    finite = fitnesses[np.isfinite(fitnesses)]
    return float(np.mean(finite)) if finite.size else float("nan")


def has_levelled_off(means: Sequence[float], *, rise: float, window: int, after: int) -> bool:
    """Whether the mean fitness rose by less than `rise` in the last `window` iterations, and
    iteration `after` is over; `means` begins with iteration 0."""
    iteration = len(means) - 1
    long_enough = iteration > after and iteration >= window
    return long_enough and means[iteration] - means[iteration - window] < rise
