"""Ground contact: normal force (Eq. 1), and the contact and friction modes of contact nodes.

What a contact node remembers is a row of `modes`, (contacts, 5): whether it touches the
ground, per horizontal axis its friction mode (STICK, or the sign of the direction it slips
in), and per axis the stick point: where its bristle deflection is zero.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from tetra_drake.physics.compiling import compiled
from tetra_drake.physics.friction import STICK, friction_force, next_friction_mode
from tetra_drake.physics.kinematics import (
    FORCE,
    P_WN,
    V_WN,
    gather_forces,
    move_nodes,
    node_acceleration,
)

Array = np.ndarray

CONTACT, MODE, STICK_POINT, MODE_COLUMNS = 0, 1, 3, 5
"""Columns of `modes`: contact (0 or 1), mode (x, y), stick point (x, y) in m; and their number."""

NORMAL = ("stiffness", "damping")
FRICTION = ("stiction_range", "stiction_damping", "stiction_switch", "proportional_stiction")
GROUND = np.dtype([(name, np.float64) for name in (*NORMAL, *FRICTION)])
"""The constants of the ground's laws (Tables 1 and 2) in SI units: `law` is one of these, `ground`
an array of one."""


@compiled
def normal_force(depth: float, depth_rate: float, law: Any) -> float:
    """Upward force (N) on a node `depth` (m) below the ground, sinking at `depth_rate` (m/s).

    Eq. 1 with n = 1; the ground never pulls.
    """
    if depth <= 0.0:
        return 0.0
    return max(0.0, law.stiffness * depth + law.damping * depth * depth_rate)


@compiled
def add_ground_forces(nodes: Array, modes: Array, contacts: Array, ground: Array) -> Array:
    """Adds the forces of the ground to those on the `nodes` of `kinematics`.

    `contacts`, (contacts,), are the indices of the nodes that may touch the ground; `modes` is
    (contacts, MODE_COLUMNS), `ground` (1,) of dtype GROUND. Returns the forces on the contact
    nodes, (contacts, 3): friction along x and y, normal force.
    """
    law, forces = ground[0], np.zeros((contacts.size, 3))
    for i in range(contacts.size):
        node = contacts[i]
        forces[i, 2] = normal_force(-nodes[node, P_WN + 2], -nodes[node, V_WN + 2], law)
        nodes[node, FORCE + 2] += forces[i, 2]
        if modes[i, CONTACT] == 0.0:
            continue
        for axis in range(2):
            deflection = nodes[node, P_WN + axis] - modes[i, STICK_POINT + axis]
            velocity, mode = nodes[node, V_WN + axis], modes[i, MODE + axis]
            forces[i, axis] = friction_force(velocity, deflection, mode, law)
            nodes[node, FORCE + axis] += forces[i, axis]
    return forces


@compiled
def ground_forces(
    state: Array, modes: Array, p_BN: Array, contacts: Array, ground: Array, generalized: Array
) -> None:
    """Writes [t_W; f_W] of the ground at each Bo, (6 bodies,), for a state of the bodies."""
    nodes = move_nodes(state, p_BN)
    add_ground_forces(nodes, modes, contacts, ground)
    generalized[:] = gather_forces(nodes, state.size // 13)


@compiled
def update_modes(nodes: Array, contacts: Array, ground: Array, modes: Array) -> bool:
    """Brings `modes`, (contacts, MODE_COLUMNS), up to date with `nodes`; whether they changed.

    A node that lands sticks where it lands; one that sticks again does so where it is
    (the reset of the integrator). The arguments are those of `add_ground_forces`.
    """
    changed = False
    for i in range(contacts.size):
        node = contacts[i]
        touched = modes[i, CONTACT] != 0.0
        touches = nodes[node, P_WN + 2] <= 0.0
        if not (touched or touches):
            continue
        if touched != touches:
            modes[i, CONTACT] = 1.0 if touches else 0.0
            changed = True
        for axis in range(2):
            before = modes[i, MODE + axis]
            after = STICK
            position = nodes[node, P_WN + axis]
            if touched and touches:
                deflection = position - modes[i, STICK_POINT + axis]
                velocity = nodes[node, V_WN + axis]
                after = next_friction_mode(velocity, deflection, before, ground[0].stiction_range)
            if after == STICK and (before != STICK or not touched):
                modes[i, STICK_POINT + axis] = position
            if after != before:
                modes[i, MODE + axis] = after
                changed = True
    return changed


@compiled
def mode_margin(nodes: Array, modes: Array, contacts: Array, ground: Array) -> float:
    """Positive while no mode is due to change; crosses zero where the first one is.

    The least of: height in the air, depth on the ground (m), stiction range less deflection
    (m), speed in the direction of slip (m/s). Only its sign has a meaning.
    """
    margin = math.inf
    for i in range(contacts.size):
        node = contacts[i]
        if modes[i, CONTACT] == 0.0:
            margin = min(margin, nodes[node, P_WN + 2])
            continue
        margin = min(margin, -nodes[node, P_WN + 2])
        for axis in range(2):
            mode = modes[i, MODE + axis]
            if mode == STICK:
                deflection = nodes[node, P_WN + axis] - modes[i, STICK_POINT + axis]
                margin = min(margin, ground[0].stiction_range - abs(deflection))
            else:
                margin = min(margin, mode * nodes[node, V_WN + axis])
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
    nodes: Array,
    modes: Array,
    contacts: Array,
    ground: Array,
    horizon: float,
) -> float:
    """Time (s) to the next mode change, at most `horizon`, at constant node accelerations.

    `acceleration` is dv/dt, 6 numbers per body, and `nodes` that of `state`; the other arguments
    are those of `add_ground_forces`.
    """
    time = horizon
    for i in range(contacts.size):
        node = contacts[i]
        a_WN = node_acceleration(state, acceleration, nodes, node)
        p_z, v_z, a_z = nodes[node, P_WN + 2], nodes[node, V_WN + 2], a_WN[2]
        if modes[i, CONTACT] == 0.0:
            time = min(time, first_zero(p_z, v_z, a_z, horizon))
            continue
        time = min(time, first_zero(-p_z, -v_z, -a_z, horizon))
        for axis in range(2):
            velocity = nodes[node, V_WN + axis]
            mode = modes[i, MODE + axis]
            if mode == STICK:
                x = nodes[node, P_WN + axis] - modes[i, STICK_POINT + axis]
                a = a_WN[axis]
                time = min(time, first_zero(ground[0].stiction_range - x, -velocity, -a, horizon))
                time = min(time, first_zero(ground[0].stiction_range + x, velocity, a, horizon))
            else:
                time = min(time, first_zero(mode * velocity, mode * a_WN[axis], 0.0, horizon))
    return time
