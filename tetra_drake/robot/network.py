"""The oscillator network of a gait and its feedback, as the kernels of every engine take them."""

from __future__ import annotations

import numbers
from collections.abc import Callable

import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.physics.cable import PASSIVE
from tetra_drake.physics.feedback import Senses
from tetra_drake.physics.oscillator import Network, steered_input
from tetra_drake.robot.bodies import tetrahedron_inertia
from tetra_drake.robot.equilibrium import settled_lengths
from tetra_drake.robot.gait import Gait, check_gait
from tetra_drake.robot.structure import NODES, Structure
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.settings import CpgSection

SteeringSignal = Callable[[float], float]
"""The turn, from -1 to 1, at a time in s."""


def constant_steering(turn: float) -> SteeringSignal:
    """The signal of a constant turn; InputError if it is not a number."""
    if isinstance(turn, bool) or not isinstance(turn, numbers.Real):
        expected = "a number from -1 to 1, or a function of the time in s"
        raise InputError("steering", "", f"found {turn!r}, expected {expected}")
    return lambda time: turn


def make_network(scenario: Scenario, structure: Structure, gait: Gait) -> Network:
    """The network of a gait; raises InputError where the gait does not fit the scenario."""
    actuation = structure.actuation
    check_gait(gait, scenario, actuation, source=f"gait {gait.name}")
    neurons = np.arange(2 * len(actuation.names))
    inhibition = np.zeros((neurons.size, neurons.size))
    inhibition[neurons, neurons ^ 1] = scenario.cpg.partner_weight
    inhibition[tuple(actuation.couplings.T)] = gait.weights
    return Network.of(
        inhibition,
        tau_a=gait.tau_a,
        tau_b=gait.tau_b,
        self_inhibition_weight=scenario.cpg.self_inhibition_weight,
    )


def initial_neurons(cpg: CpgSection, oscillators: int) -> np.ndarray:
    """(4n,): u, then v, of all neurons at t = 0 (Table 4)."""
    inner_state, extensor_self_inhibition, flexor_self_inhibition = cpg.initial_state
    u = np.full(2 * oscillators, inner_state)
    v = np.tile([extensor_self_inhibition, flexor_self_inhibition], oscillators)
    return np.concatenate([u, v])


def tonic_input(scenario: Scenario, structure: Structure, turns: np.ndarray) -> np.ndarray:
    """(..., 2m): u0 by neuron for turns (...); see physics.oscillator.steered_input."""
    sides = np.repeat(structure.actuation.sides, 2)
    steered: np.ndarray = steered_input(scenario.cpg.external_input, turns[..., np.newaxis], sides)
    return steered


def sample_turns(
    scenario: Scenario, structure: Structure, gait: Gait, steering: SteeringSignal | None
) -> np.ndarray:
    """The turns at 0, one `cpg.listing_step`, two ... to the duration; one alone if constant.

    Raises InputError if a turn is not a number from -1 to 1, or where nothing can be steered.
    """
    if steering is None:
        return np.array([gait.turn])
    if not structure.actuation.sides.any():
        raise InputError("steering", "", "no oscillator is on one side of the robot")
    step = scenario.cpg.listing_step
    times = step * np.arange(round(scenario.simulation.duration / step) + 1)
    turns = np.array([float(steering(time)) for time in times.tolist()])
    wrong = ~(np.abs(turns) <= 1.0)
    if wrong.any():
        time, turn = times[wrong.argmax()], turns[wrong.argmax()]
        raise InputError("steering", f"at {time:g} s", f"found {turn}, expected -1 to 1")
    return turns


def make_senses(scenario: Scenario, structure: Structure) -> Senses:
    """What the oscillators can sense. Raises InputError if the robot finds no rest."""
    drivers, pathways = structure.actuation.drivers, scenario.cpg.feedback
    sizes = np.bincount(drivers[drivers != PASSIVE])[drivers]  # cables of each cable's group
    settled = settled_lengths(scenario) if "length" in pathways else np.ones(len(drivers))
    per_load = 0.0
    if "load" in pathways:
        mass = len(structure.bodies) * tetrahedron_inertia(structure).get_mass()
        per_load = 1.0 / (mass * scenario.robot.gravity)
    return Senses(
        drivers=drivers,
        ahead=structure.actuation.junctions + 1,
        carriers=structure.contacts // len(NODES),
        settled=settled,
        per_length=1.0 / (settled * sizes),
        per_load=np.array([per_load]),
    )
