"""When contact and friction modes change: the margin until then, and a prediction of the time."""

from __future__ import annotations

import math

import numpy as np

from tetra_drake.physics.contact import (
    CONTACT,
    Ground,
    NormalForce,
    gap,
    meet_ground,
    modes_after_step,
    sliding,
)
from tetra_drake.physics.friction import first_zero, friction_margin, time_to_friction_change
from tetra_drake.physics.kinematics import node_acceleration
from tetra_drake.physics.terrain import to_frame
from tetra_drake.simd.compiling import compiled, inlined
from tetra_drake.simd.lanes import Real, Table, any_lane, minimum, named, select

Array = np.ndarray


@compiled
def mode_margin(
    state: Array,
    modes: Array,
    p_BN: Array,
    first_node: Array,
    ground: Ground,
    nodes: Array,
    frames: Array,
) -> float:
    """Positive while no mode is due to change; crosses zero where the first one is.

    The least of: gap in the air, depth on the ground (m), the margin of friction. Only its sign has
    a meaning. Writes `nodes` and `frames`.
    """
    meet_ground(state, p_BN, first_node, ground, nodes, frames)
    margin, law = math.inf, named(NormalForce, ground.normal)
    for i in range(ground.contacts.size):
        distance = gap(nodes, ground, frames, i)
        if modes[i, CONTACT] == 0.0:
            margin = min(margin, distance)
            continue
        margin = min(margin, -distance)
        slide, _ = sliding(nodes, modes, ground, law, frames, i)
        margin = min(margin, friction_margin(slide, ground.friction))
    return margin


@inlined
def time_to_mode_change(
    state: Table,
    acceleration: Table,
    nodes: Table,
    modes: Table,
    ground: Ground,
    frames: Table,
    horizon: Real,
) -> Real:
    """Time (s) to the next mode change, at most `horizon`, at constant node accelerations, over the
    local tangent plane.

    `acceleration` is dv/dt, 6 numbers per body, and `nodes` that of `state`; the other arguments
    are those of `add_ground_forces`.
    """
    time, law = horizon, named(NormalForce, ground.normal)
    for i in range(ground.contacts.size):
        node, body = ground.contacts[i], ground.carriers[i]
        a_WN = node_acceleration(state, acceleration, nodes, node, body)
        a_1, a_2, a_n = to_frame(a_WN, frames, i, ground.flat)
        slide, v_n = sliding(nodes, modes, ground, law, frames, i)
        touches, distance = modes[i, CONTACT] != 0.0, gap(nodes, ground, frames, i)
        up = select(touches, -1.0, 1.0)  # the way that leads to the ground's surface
        time = minimum(time, first_zero(up * distance, up * v_n, up * a_n, horizon))
        if not any_lane(touches):
            continue
        rate = law.damping * (v_n * v_n + distance * a_n) - law.stiffness * v_n
        rate = select(slide.normal > 0.0, rate, 0.0)
        change = time_to_friction_change(slide, (a_1, a_2), rate, ground.friction, horizon)
        time = minimum(time, select(touches, change, horizon))
    return time


@compiled
def next_mode_change(
    state: Array,
    acceleration: Array,
    modes: Array,
    p_BN: Array,
    first_node: Array,
    ground: Ground,
    nodes: Array,
    frames: Array,
    horizon: float,
) -> tuple[bool, float]:
    """Mode change that is due in a state of the bodies, and the time (s) to the next change
    after that, as time_to_mode_change() predicts it.

    Writes `nodes` and `frames`, and brings `modes` up to date.
    """
    due = modes_after_step(state, p_BN, first_node, ground, nodes, frames, modes)
    return due, time_to_mode_change(state, acceleration, nodes, modes, ground, frames, horizon)
