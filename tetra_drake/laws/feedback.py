"""Feedback to the oscillators: the term f of Eq. 7, from the robot's state and forces.

There are three pathways, each with a gain. Feedback with opposite signs on extensor and flexor
shifts the signal to one side. Feedback with equal signs excites or calms both neurons. In Taga
(1991), angles act with opposite signs and loads with equal signs.

    length  relative elongation of the oscillator's cables from their lengths in equilibrium, mean
            over the cables: + on the extensor, - on the flexor
    load    share of the robot's weight on the feet of the body in front (the last body that the
            oscillator's cables join): + on both
    pitch   sine of the angle by which the x axis of that body points up: + on the extensor, - on
            the flexor

The input of a sense must be smooth within a step of an integrator. Contact with the ground jumps;
normal forces do not.

To add a pathway: name it in Pathway and Gains, in the same order, and add its part to sense().
A constant of the robot is a field of Senses, which robot.robot fills in.
"""

from __future__ import annotations

from typing import Literal, NamedTuple, get_args

from tetra_drake.kernels.compiling import compiled
from tetra_drake.kernels.lanes import Table
from tetra_drake.laws import cable, contact
from tetra_drake.settings.section import Section

Pathway = Literal["length", "load", "pitch"]
"""A signal that can be fed back to the oscillators; as described above."""

PATHWAYS: tuple[str, ...] = get_args(Pathway)

LENGTH, LOAD, PITCH = range(len(PATHWAYS))
"""Indices of the pathways in tables of gains."""


class Gains(Section):
    """Gain of each pathway of feedback in a gait, in units of the input u0."""

    length: float = 0.0
    load: float = 0.0
    pitch: float = 0.0


class Senses(NamedTuple):
    """Constants of the feedback to m oscillators.

    All tables have one axis. The types of tables contain all lengths but the first (see
    kernels.lanes). With two axes, kernels would be compiled again for robots of another size.
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


@compiled
def sense(
    senses: Senses,
    gains: Table,
    state: Table,
    cable_forces: Table,
    ground_forces: Table,
    feedback: Table,
) -> None:
    """Writes the feedback of each neuron (2m,), from the state of the bodies and its forces.

    `gains` are in the order of PATHWAYS. `cable_forces` and `ground_forces` are the
    tables of `cable` and `contact`.
    """
    for i in range(feedback.size):
        feedback[i] = 0.0
    for i in range(senses.drivers.size):
        k, length = senses.drivers[i], cable_forces[i, cable.LENGTH]
        if k != cable.PASSIVE:
            feedback[2 * k] += senses.per_length[i] * (length - senses.neutral_length[i])
    for k in range(feedback.size // 2):
        body, load = senses.ahead[k], 0.0
        for c in range(senses.carriers.size):
            if senses.carriers[c] == body:
                load += ground_forces[c, contact.NORMAL]
        q = 7 * body
        pitch = 2.0 * (state[q + 1] * state[q + 3] - state[q] * state[q + 2])
        differs = gains[LENGTH] * feedback[2 * k]
        differs += gains[PITCH] * pitch
        same = gains[LOAD] * (senses.per_load[0] * load)
        feedback[2 * k] = same + differs
        feedback[2 * k + 1] = same - differs
