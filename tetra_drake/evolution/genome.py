"""The genome: a gait's parameters in one row, as the thesis's listing keeps them.

Row of 2 n (n - 1) + 2 numbers for n oscillators: the weights in the listing's order, tau_A,
tau_B (both in s).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tetra_drake.evolution.optimizers.base import Genome
from tetra_drake.robot.gait import TAU_B_PER_TAU_A, Gait, random_gait, weight_count
from tetra_drake.scenario.schema import Scenario

TAU_A, TAU_B = -2, -1
"""Where the time constants stand in a genome."""

NO_FLOOR = 0.0
"""A weight may shrink to anything above this (listing A.3.3)."""


@dataclass(frozen=True)
class MutationLimits:
    """How far, per parameter of a genome, one mutation may reach."""

    reach: Genome
    """Largest change; 0 for a parameter that is not mutated."""
    floors: Genome
    """A reduced parameter must stay above this."""


def mutation_limits(scenario: Scenario) -> MutationLimits:
    """The scenario's mutation ranges (Table 6) laid out along the genome.

    With equal bounds of tau_A in the scenario, tau_A is fixed. With `tau_mutation: listing`
    it is not mutated either: the listing's index 26 is tau_B's (A.3.4). An independent tau_B
    has the range and the floor of tau_A, doubled.
    """
    settings, bounds = scenario.evolution, scenario.gait_bounds
    weights = weight_count(scenario.oscillators)
    fixed = bounds.tau_a_min == bounds.tau_a_max
    tau_range = 0.0 if fixed else settings.tau_mutation_range
    reach = np.full(weights + 2, settings.weight_mutation)
    reach[TAU_A] = 0.0 if settings.tau_mutation == "listing" else tau_range
    reach[TAU_B] = TAU_B_PER_TAU_A * tau_range
    floors = np.full(weights + 2, NO_FLOOR)
    floors[TAU_A] = bounds.tau_a_min
    floors[TAU_B] = TAU_B_PER_TAU_A * bounds.tau_a_min
    return MutationLimits(reach=reach, floors=floors)


def random_genome(scenario: Scenario, generator: np.random.Generator) -> Genome:
    """A genome drawn from the scenario's bounds (Table 5), with tau_B = 2 tau_A."""
    return genome_of(random_gait(scenario, generator, name=""))


def couple_tau_b(genome: Genome) -> Genome:
    """The genome with tau_B = 2 tau_A, as the listing leaves it before it simulates."""
    coupled = genome.copy()
    coupled[TAU_B] = TAU_B_PER_TAU_A * genome[TAU_A]
    return coupled


def genome_of(gait: Gait) -> Genome:
    """The genome of a gait."""
    return np.array([*gait.weights, gait.tau_a, gait.tau_b])


def gait_of(genome: Genome, *, name: str) -> Gait:
    """The gait of a genome."""
    *weights, tau_a, tau_b = genome.tolist()
    return Gait(name=name, weights=tuple(weights), tau_a=tau_a, tau_b=tau_b)
