"""Ground contact: normal force (Eq. 1), contact and friction modes of the contact nodes.

What a contact node remembers is a row of `modes`, (contacts, 5): whether it touches the
ground, per horizontal axis its friction mode (STICK, or the sign of the direction it slips
in), and per axis the stick point: where its bristle deflection is zero.
"""

from __future__ import annotations

import math

import numpy as np

from tetra_drake.physics.compiling import compiled
from tetra_drake.physics.friction import STICK, friction_force, next_friction_mode
from tetra_drake.physics.kinematics import (
    P_BN_W,
    P_WN,
    V_WN,
    gather_forces,
    node_acceleration,
    node_motion,
)

Array = np.ndarray

CONTACT, MODE, STICK_POINT, MODE_COLUMNS = 0, 1, 3, 5
"""Columns of `modes`: contact (0 or 1), mode (x, y), stick point (x, y) in m; and their number."""

GROUND = np.dtype(
    [
        ("stiffness", np.float64),
        ("damping", np.float64),
        ("stiction_range", np.float64),
        ("stiction_damping", np.float64),
        ("stiction_switch", np.float64),
        ("proportional_stiction", np.float64),
    ]
)
"""The constants of Tables 1 and 2 in SI units; kernels take an array of one of these."""


@compiled
def normal_force(depth: float, depth_rate: float, stiffness: float, damping: float) -> float:
    """Upward force (N) on a node `depth` (m) below the ground, sinking at `depth_rate` (m/s).

    Eq. 1 with n = 1; the ground never pulls.
    """
    if depth <= 0.0:
        return 0.0
    return max(0.0, stiffness * depth + damping * depth * depth_rate)


@compiled
def add_ground_forces(
    motion: Array,
    modes: Array,
    contacts: Array,
    ground: Array,
    node_force: Array,
    normal: Array,
    friction: Array,
) -> None:
    """Adds the forces of the ground to those at the nodes.

    Args:
        motion: (nodes, MOTION_COLUMNS) of `kinematics`.
        modes: (contacts, MODE_COLUMNS).
        contacts: (contacts,), the indices of the nodes that may touch the ground.
        ground: (1,) of dtype GROUND.
        node_force: (nodes, 3), added to, in N.
        normal: (contacts,), written, in N.
        friction: (contacts, 2), written, along x and y in N.
    """
    law = ground[0]
    for i in range(contacts.size):
        node = contacts[i]
        normal[i] = normal_force(
            -motion[node, P_WN + 2], -motion[node, V_WN + 2], law.stiffness, law.damping
        )
        node_force[node, 2] += normal[i]
        for axis in range(2):
            friction[i, axis] = 0.0
            if modes[i, CONTACT] != 0.0:
                friction[i, axis] = friction_force(
                    motion[node, V_WN + axis],
                    motion[node, P_WN + axis] - modes[i, STICK_POINT + axis],
                    modes[i, MODE + axis],
                    law.stiction_range,
                    law.stiction_damping,
                    law.stiction_switch,
                    law.proportional_stiction,
                )
                node_force[node, axis] += friction[i, axis]


@compiled
def ground_forces(
    state: Array,
    modes: Array,
    p_BN: Array,
    contacts: Array,
    ground: Array,
    generalized_force: Array,
    normal: Array,
    friction: Array,
) -> None:
    """Forces of the ground on the bodies.

    Args:
        state: [q; v] of the bodies, 13 numbers a body.
        p_BN: (nodes a body, 3), in m.
        generalized_force: (6 bodies,), written, [t_W; f_W] at each Bo.
        modes, contacts, ground, normal, friction: as in `add_ground_forces`.
    """
    motion = node_motion(state, p_BN)
    node_force = np.zeros((motion.shape[0], 3))
    add_ground_forces(motion, modes, contacts, ground, node_force, normal, friction)
    gather_forces(motion, node_force, generalized_force)


@compiled
def update_modes(motion: Array, contacts: Array, ground: Array, modes: Array) -> bool:
    """Brings `modes`, (contacts, MODE_COLUMNS), up to date with `motion`; whether they changed.

    A node that lands sticks where it lands; one that sticks again does so where it is
    (the reset of the integrator). The arguments are those of `add_ground_forces`.
    """
    stiction_range = ground[0].stiction_range
    changed = False
    for i in range(contacts.size):
        node = contacts[i]
        touched = modes[i, CONTACT] != 0.0
        touches = motion[node, P_WN + 2] <= 0.0
        if not (touched or touches):
            continue
        if touched != touches:
            modes[i, CONTACT] = 1.0 if touches else 0.0
            changed = True
        for axis in range(2):
            before = modes[i, MODE + axis]
            after = STICK
            position = motion[node, P_WN + axis]
            if touched and touches:
                deflection = position - modes[i, STICK_POINT + axis]
                velocity = motion[node, V_WN + axis]
                after = next_friction_mode(velocity, deflection, before, stiction_range)
            if after == STICK and (before != STICK or not touched):
                modes[i, STICK_POINT + axis] = position
            if after != before:
                modes[i, MODE + axis] = after
                changed = True
    return changed


@compiled
def mode_margin(motion: Array, modes: Array, contacts: Array, ground: Array) -> float:
    """Positive while no mode is due to change; crosses zero where the first one is.

    The least of: height in the air, depth on the ground (m), stiction range less deflection
    (m), speed in the direction of slip (m/s). Only its sign has a meaning.
    """
    margin = math.inf
    for i in range(contacts.size):
        node = contacts[i]
        if modes[i, CONTACT] == 0.0:
            margin = min(margin, motion[node, P_WN + 2])
            continue
        margin = min(margin, -motion[node, P_WN + 2])
        for axis in range(2):
            mode = modes[i, MODE + axis]
            if mode == STICK:
                deflection = motion[node, P_WN + axis] - modes[i, STICK_POINT + axis]
                margin = min(margin, ground[0].stiction_range - abs(deflection))
            else:
                margin = min(margin, mode * motion[node, V_WN + axis])
    return margin


@compiled
def first_zero(value: float, rate: float, rate_rate: float, horizon: float) -> float:
    """First time in (0, horizon) at which value + rate t + rate_rate t²/2 falls to zero;
    the horizon where it does not, or where the value is not positive now."""
    if value <= 0.0:
        return horizon
    discriminant = rate * rate - 2.0 * rate_rate * value
    if discriminant < 0.0:
        return horizon
    # The two roots without cancellation; each may lie in the past.
    q = -0.5 * (rate + math.copysign(math.sqrt(discriminant), rate))
    first = horizon
    if q > 0.0:
        first = min(first, value / q)
    if rate_rate * q > 0.0:
        first = min(first, 2.0 * q / rate_rate)
    return first


@compiled
def time_to_mode_change(
    state: Array,
    acceleration: Array,
    motion: Array,
    modes: Array,
    contacts: Array,
    ground: Array,
    horizon: float,
) -> float:
    """Time (s) to the next mode change, extrapolating with constant node accelerations.

    `acceleration` is dv/dt, 6 numbers a body; no answer exceeds `horizon` (s). `motion`
    belongs to `state`. The other arguments are those of `add_ground_forces`.
    """
    nodes_a_body = motion.shape[0] // (state.size // 13)
    stiction_range = ground[0].stiction_range
    time = horizon
    for i in range(contacts.size):
        node = contacts[i]
        a_WN = node_acceleration(
            state, acceleration, node // nodes_a_body, motion[node, P_BN_W : P_BN_W + 3]
        )
        p_z, v_z, a_z = motion[node, P_WN + 2], motion[node, V_WN + 2], a_WN[2]
        if modes[i, CONTACT] == 0.0:
            time = min(time, first_zero(p_z, v_z, a_z, horizon))
            continue
        time = min(time, first_zero(-p_z, -v_z, -a_z, horizon))
        for axis in range(2):
            velocity = motion[node, V_WN + axis]
            mode = modes[i, MODE + axis]
            if mode == STICK:
                x = motion[node, P_WN + axis] - modes[i, STICK_POINT + axis]
                a = a_WN[axis]
                time = min(time, first_zero(stiction_range - x, -velocity, -a, horizon))
                time = min(time, first_zero(stiction_range + x, velocity, a, horizon))
            else:
                time = min(time, first_zero(mode * velocity, mode * a_WN[axis], 0.0, horizon))
    return time
