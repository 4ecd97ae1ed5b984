"""Feedback to the oscillators: the f of Eq. 7, from the robot's state and forces.

Three pathways, each with a gain. What differs between extensor and flexor turns an oscillator
towards one of them; what is the same excites or calms both (after Taga 1991, where angles act with
opposite and loads with equal signs).

    length  the relative elongation of the oscillator's cables beyond their settled lengths, mean
            over its group: + on the extensor, - on the flexor
    load    the share of the robot's weight on the feet of the body ahead, the last one that the
            oscillator's cables join: + on both
    pitch   the sine of the angle by which that body's x axis points up: + and -

What a sense reads must be smooth within a step of an integrator. What jumps, such as touching the
ground, is read from `modes`, which are constant within a step (see `friction`).
"""

from __future__ import annotations

from typing import NamedTuple

from tetra_drake.physics.cable import PASSIVE
from tetra_drake.simd.compiling import compiled
from tetra_drake.simd.lanes import Table


class Senses(NamedTuple):
    """Constants of what m oscillators can sense.

    All tables have one axis. Kernels know every length but the first (see simd.lanes), so with two
    axes they would be compiled anew for robots of another size.
    """

    drivers: Table
    """(cables,): the oscillator that drives each cable, PASSIVE if none does."""
    ahead: Table
    """(m,): the body ahead of each oscillator's junction."""
    carriers: Table
    """(contacts,): the body of each contact node."""
    settled: Table
    """(cables,): lengths (m) without elongation."""
    per_length: Table
    """(cables,): what a cable's elongation counts for its oscillator, in 1/m."""
    per_load: Table
    """(1,): what a normal force counts, in 1/N."""


@compiled
def sense(
    senses: Senses,
    gains: Table,
    state: Table,
    lengths: Table,
    normal_forces: Table,
    feedback: Table,
) -> None:
    """Writes the feedback (2m,), by neuron.

    `gains`, (3,), of length, load and pitch; `state` of the bodies, `lengths` (cables,) in m,
    `normal_forces` (contacts,) in N.
    """
    for i in range(feedback.size):
        feedback[i] = 0.0
    for i in range(lengths.size):
        k = senses.drivers[i]
        if k != PASSIVE:
            feedback[2 * k] += senses.per_length[i] * (lengths[i] - senses.settled[i])
    for k in range(feedback.size // 2):
        body, load = senses.ahead[k], 0.0
        for c in range(normal_forces.size):
            if senses.carriers[c] == body:
                load += normal_forces[c]
        q = 7 * body
        pitch = 2.0 * (state[q + 1] * state[q + 3] - state[q] * state[q + 2])
        differs = gains[0] * feedback[2 * k]
        differs += gains[2] * pitch
        same = gains[1] * (senses.per_load[0] * load)
        feedback[2 * k] = same + differs
        feedback[2 * k + 1] = same - differs
