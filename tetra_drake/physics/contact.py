"""Ground contact: normal force (Eq. 1), and the contact and friction modes of contact nodes.

What a contact node remembers is a row of `modes`, (contacts, 5): whether it touches the
ground, per horizontal axis its friction mode (STICK, or the sign of the direction it slips
in), and per axis the stick point: where its bristle deflection is zero.
"""

from __future__ import annotations

import math
from typing import NamedTuple

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
from tetra_drake.physics.lanes import Real, Table, Truth, any_lane, maximum, minimum, select

Array = np.ndarray

CONTACT, MODE, STICK_POINT, MODE_COLUMNS = 0, 1, 3, 5
"""Columns of `modes`: contact (0 or 1), mode (x, y), stick point (x, y) in m; and their number."""


class Ground(NamedTuple):
    """The constants of the ground's laws (Tables 1 and 2) in SI units."""

    stiffness: Real
    damping: Real
    stiction_range: Real
    stiction_damping: Real
    stiction_switch: Real
    proportional_stiction: Real


GROUND = np.dtype([(name, float) for name in Ground._fields])
"""The same as a record. What kernels call `ground` is an array of one, or Ground of tables of one;
what they call `law` is ground_law(ground)."""


@compiled
def ground_law(ground: Table) -> Ground:
    """The constants as numbers."""
    return Ground(
        ground.stiffness[0],
        ground.damping[0],
        ground.stiction_range[0],
        ground.stiction_damping[0],
        ground.stiction_switch[0],
        ground.proportional_stiction[0],
    )


@compiled
def normal_force(depth: Real, depth_rate: Real, law: Ground) -> Real:
    """Upward force (N) on a node `depth` (m) below the ground, sinking at `depth_rate` (m/s).

    Eq. 1 with n = 1; the ground never pulls.
    """
    force = law.stiffness * depth + law.damping * depth * depth_rate
    return select(depth > 0.0, maximum(force, 0.0), 0.0)


@compiled
def add_ground_forces(
    nodes: Table, modes: Table, contacts: Table, ground: Table, keep: bool, pushes: Table
) -> None:
    """Adds the forces of the ground to those on the `nodes` of `kinematics`.

    `contacts`, (contacts,), are the indices of the nodes that may touch the ground; `modes` is
    (contacts, MODE_COLUMNS). With `keep`, writes `pushes`, (contacts, 3): friction along x and y,
    normal force.
    """
    law = ground_law(ground)
    for i in range(pushes.shape[0]):
        node = contacts[i]
        normal = normal_force(-nodes[node, P_WN + 2], -nodes[node, V_WN + 2], law)
        if keep:
            pushes[i, 2] = normal
        nodes[node, FORCE + 2] += normal
        touches = modes[i, CONTACT] != 0.0
        for axis in range(2):
            deflection = nodes[node, P_WN + axis] - modes[i, STICK_POINT + axis]
            velocity, mode = nodes[node, V_WN + axis], modes[i, MODE + axis]
            friction = select(touches, friction_force(velocity, deflection, mode, law), 0.0)
            if keep:
                pushes[i, axis] = friction
            nodes[node, FORCE + axis] += friction


@compiled
def ground_forces(
    state: Table,
    modes: Table,
    p_BN: Table,
    contacts: Table,
    ground: Table,
    nodes: Table,
    pushes: Table,
    generalized_force: Table,
) -> None:
    """Writes [t_W; f_W] of the ground at each Bo, (6 bodies,), for a state of the bodies; also
    `nodes` and `pushes`."""
    move_nodes(state, p_BN, nodes)
    add_ground_forces(nodes, modes, contacts, ground, True, pushes)
    gather_forces(nodes, generalized_force)


@compiled
def update_modes(nodes: Table, contacts: Table, ground: Table, modes: Table) -> Truth:
    """Brings `modes`, (contacts, MODE_COLUMNS), up to date with `nodes`; whether they changed.

    A node that lands sticks where it lands; one that sticks again does so where it is
    (the reset of the integrator). The arguments are those of `add_ground_forces`.
    """
    changed = False
    for i in range(contacts.size):
        node = contacts[i]
        touched = modes[i, CONTACT] != 0.0
        touches = nodes[node, P_WN + 2] <= 0.0
        if not any_lane(touched | touches):
            continue
        modes[i, CONTACT] = select(touches, 1.0, 0.0)
        changed = changed | (touched ^ touches)
        for axis in range(2):
            position, velocity = nodes[node, P_WN + axis], nodes[node, V_WN + axis]
            before, stick_point = modes[i, MODE + axis], modes[i, STICK_POINT + axis]
            deflection = position - stick_point
            after = next_friction_mode(velocity, deflection, before, ground.stiction_range[0])
            after = select(touched & touches, after, STICK)
            resets = (after == STICK) & ((before != STICK) | (touches & (touched ^ touches)))
            modes[i, STICK_POINT + axis] = select(resets, position, stick_point)
            modes[i, MODE + axis] = after
            changed = changed | (after != before)
    return changed


@compiled
def mode_margin(nodes: Array, modes: Array, contacts: Array, ground: Table) -> float:
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
                margin = min(margin, ground.stiction_range[0] - abs(deflection))
            else:
                margin = min(margin, mode * nodes[node, V_WN + axis])
    return margin


@compiled
def first_zero(value: Real, rate: Real, rate_rate: Real, horizon: Real) -> Real:
    """First time in (0, horizon) at which value + rate t + rate_rate t²/2 falls to zero;
    the horizon where it does not, or where the value is not positive now."""
    reach = horizon * (abs(rate) + 0.5 * horizon * abs(rate_rate))
    if not any_lane((value > 0.0) & (value <= reach)):
        return horizon
    discriminant = rate * rate - 2.0 * rate_rate * value
    # Twice the mean speed at which the value falls until it is zero.
    speed = math.sqrt(maximum(discriminant, 0.0)) - rate
    falls = (value > 0.0) & (discriminant >= 0.0) & (speed > 0.0)
    return select(falls, minimum(2.0 * value / select(falls, speed, 1.0), horizon), horizon)


@compiled
def time_to_mode_change(
    state: Table,
    acceleration: Table,
    nodes: Table,
    modes: Table,
    contacts: Table,
    ground: Table,
    horizon: Real,
) -> Real:
    """Time (s) to the next mode change, at most `horizon`, at constant node accelerations.

    `acceleration` is dv/dt, 6 numbers per body, and `nodes` that of `state`; the other arguments
    are those of `add_ground_forces`.
    """
    time, p_0 = horizon, ground.stiction_range[0]
    for i in range(contacts.size):
        node = contacts[i]
        a_WN = node_acceleration(state, acceleration, nodes, node)
        touches = modes[i, CONTACT] != 0.0
        up = select(touches, -1.0, 1.0)  # the way that leads to the ground's surface
        p_z, v_z = nodes[node, P_WN + 2], nodes[node, V_WN + 2]
        time = minimum(time, first_zero(up * p_z, up * v_z, up * a_WN[2], horizon))
        if not any_lane(touches):
            continue
        for axis in range(2):
            velocity, a = nodes[node, V_WN + axis], a_WN[0] if axis == 0 else a_WN[1]
            mode, x = modes[i, MODE + axis], nodes[node, P_WN + axis] - modes[i, STICK_POINT + axis]
            sticks, slips = touches & (mode == STICK), touches & (mode != STICK)
            # A value of 0 is never reached: it counts as no mode change.
            to_front, to_back = select(sticks, p_0 - x, 0.0), select(sticks, p_0 + x, 0.0)
            time = minimum(time, first_zero(to_front, -velocity, -a, horizon))
            time = minimum(time, first_zero(to_back, velocity, a, horizon))
            slip = select(slips, mode * velocity, 0.0)
            time = minimum(time, first_zero(slip, mode * a, 0.0, horizon))
    return time
