"""Feedback to the oscillators: the term f of Eq. 7, from the robot's state and forces.

Each pathway has a gain. Feedback with opposite signs on extensor and flexor shifts the signal to
one side. Feedback with equal signs excites or calms both neurons. In Taga (1991), angles act with
opposite signs and loads with equal signs.

Feedback must be smooth within a step of an integrator. Forces are smooth there, and modes are
constant. The sign of a gap jumps, so feedback must not depend on it.

To add a pathway, write a field of Gains and its lines in sense(). All engines have the state, the
modes and Forces. A constant of the robot is a field of Senses, which robot.robot fills in.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, NamedTuple, TypeAlias

from tetra_drake.kernels.compiling import compiled, inlined
from tetra_drake.kernels.lanes import Real, Table, named
from tetra_drake.kernels.packed import Packed, unpacked
from tetra_drake.laws import cable, contact
from tetra_drake.laws.forces import Forces, compute_forces_at
from tetra_drake.laws.model import Model


class Gains(NamedTuple):
    """Gain of each pathway of feedback in a gait, in units of the tonic input u0. Each oscillator
    has two inputs: of its extensor and its flexor.

    The *body in front* of an oscillator is the last body, in the robot's order, that its cables
    join.
    """

    length: Real = 0.0
    """Gain of the mean relative elongation of the oscillator's cables, measured from their lengths
    in equilibrium: + on the extensor, - on the flexor."""
    load: Real = 0.0
    """Gain of the share of the robot's weight on the feet of the body in front: + on both
    inputs."""
    pitch: Real = 0.0
    """Gain of the sine of the angle by which the x axis of the body in front points up: + on the
    extensor, - on the flexor."""


PATHWAYS = Gains._fields
"""Names of the feedback pathways. Arrays of gains have this order."""

if TYPE_CHECKING:
    Pathway = str
else:
    Pathway = Literal[PATHWAYS]


class Senses(NamedTuple):
    """Constants of a robot from which the feedback to its m oscillators is computed.

    All tables have one axis. Numba would compile the kernels again for robots of another size if a
    table had two, because the type of a table contains all lengths but the first; see
    kernels.lanes.
    """

    drivers: Table
    """Index of the oscillator that drives each cable (cables,); PASSIVE if there is none."""
    ahead: Table
    """Index of the body in front of each oscillator (m,)."""
    carriers: Table
    """Index of the body of each contact node (contacts,)."""
    neutral_length: Table
    """Cable lengths (cables,) in m at which the feedback is zero: the lengths in equilibrium."""
    per_length: Table
    """Weight of a cable's elongation in the feedback to its oscillator (cables,), in 1/m."""
    per_load: Table
    """Weight of a normal force (1,), in 1/N."""


@inlined
def sense(
    senses: Senses, gains: Table, state: Table, modes: Table, forces: Forces, feedback: Table
) -> None:
    """Writes the feedback f of each neuron to `feedback` (2m,), for m oscillators: extensor and
    flexor in turn. The unit is the unit of the tonic input u0.

    It is computed from the `state` [q; v] (13*bodies,) and from `forces`, which must hold the cable
    and ground forces. `gains` are in the order of PATHWAYS. `modes` (contacts, 12) are the contact
    modes, for further pathways; no present one uses them.
    """
    gain = named(Gains, gains)
    for i in range(feedback.size):
        feedback[i] = 0.0
    for i in range(senses.drivers.size):
        k, length = senses.drivers[i], forces.cable_forces[i, cable.LENGTH]
        if k != cable.PASSIVE:
            feedback[2 * k] += senses.per_length[i] * (length - senses.neutral_length[i])
    for k in range(feedback.size // 2):
        body, load = senses.ahead[k], 0.0
        for c in range(senses.carriers.size):
            if senses.carriers[c] == body:
                load += forces.ground_forces[c, contact.NORMAL]
        q = 7 * body
        pitch = 2.0 * (state[q + 1] * state[q + 3] - state[q] * state[q + 2])
        differs = gain.length * feedback[2 * k]
        differs += gain.pitch * pitch
        same = gain.load * (senses.per_load[0] * load)
        feedback[2 * k] = same + differs
        feedback[2 * k + 1] = same - differs


FeedbackParts: TypeAlias = Packed[tuple[Model, Forces, Senses, Table]]
"""A robot, its Forces and Senses, and the gains in the order of PATHWAYS, packed for kernels."""


@compiled
def compute_feedback(
    parts: FeedbackParts, state: Table, modes: Table, signals: Table, drives: Table, feedback: Table
) -> None:
    """Computes the forces of a robot, then writes the feedback of each neuron to `feedback` (2m,);
    see sense().

    `state` is [q; v] (13*bodies,), `modes` (contacts, 12) are contact and friction modes, `signals`
    (m,) are in N, `drives` (drives,) are the actuators' states. Also writes the forces to the
    Forces of `parts`.
    """
    robot, forces, senses, gains = unpacked(parts)
    compute_forces_at(robot, state, modes, signals, drives, forces)
    sense(senses, gains, state, modes, forces, feedback)
