"""The equations of motion: free rigid bodies under the forces of cables, ground and gravity.

Vectors over bodies hold 6 numbers a body, rotation before translation, in World.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tetra_drake.engines.compiled.block_tridiagonal import BLOCK, ROW, add_outer_product
from tetra_drake.physics.cable import add_cable_forces
from tetra_drake.physics.compiling import compiled
from tetra_drake.physics.contact import CONTACT, MODE, add_ground_forces
from tetra_drake.physics.friction import STICK
from tetra_drake.physics.kinematics import (
    MOTION_COLUMNS,
    P_BN_W,
    P_WN,
    gather_forces,
    move_nodes,
)
from tetra_drake.robot.model import Model

Array = np.ndarray


class Forces(NamedTuple):
    """Room for the forces at one state; shapes and units are those of `physics`."""

    motion: Array
    node_force: Array
    generalized_force: Array
    tensions: Array
    lengths: Array
    normal: Array
    friction: Array


@compiled
def make_forces(robot: Model, bodies: int) -> Forces:
    """Room for the forces on a robot of this many bodies."""
    nodes, cables, contacts = robot.p_BN.shape[0] * bodies, robot.cables.size, robot.contacts.size
    return Forces(
        np.empty((nodes, MOTION_COLUMNS)),
        np.empty((nodes, 3)),
        np.empty(BLOCK * bodies),
        np.empty(cables),
        np.empty(cables),
        np.empty(contacts),
        np.empty((contacts, 2)),
    )


@compiled
def compute_forces(
    robot: Model, state: Array, modes: Array, signals: Array, forces: Forces
) -> None:
    """All forces at a state (13 bodies,), gathered body by body, gravity among them.

    `modes`, (contacts, MODE_COLUMNS), and `signals`, (signals,) in N, as in `physics`.
    """
    move_nodes(state, robot.p_BN, forces.motion)
    forces.node_force[:] = 0.0
    add_cable_forces(
        forces.motion,
        signals,
        robot.cables,
        robot.slack,
        forces.node_force,
        forces.tensions,
        forces.lengths,
    )
    add_ground_forces(
        forces.motion,
        modes,
        robot.contacts,
        robot.ground,
        forces.node_force,
        forces.normal,
        forces.friction,
    )
    gather_forces(forces.motion, forces.node_force, forces.generalized_force)
    for body in range(forces.generalized_force.size // BLOCK):
        forces.generalized_force[BLOCK * body + 5] -= robot.mass * robot.gravity


@compiled
def multiply_by_mass(robot: Model, acceleration: Array, force: Array) -> None:
    """The mass matrix times an acceleration; both (6 bodies,)."""
    for i in range(acceleration.size):
        force[i] = acceleration[i] * (robot.moment if i % BLOCK < 3 else robot.mass)


@compiled
def divide_by_mass(robot: Model, force: Array, acceleration: Array) -> None:
    """Newton and Euler: dv/dt from forces; both (6 bodies,). Isotropic bodies do not precess."""
    for i in range(force.size):
        acceleration[i] = force[i] / (robot.moment if i % BLOCK < 3 else robot.mass)


@compiled
def move_bodies(state: Array, velocities: Array, time: float, moved: Array) -> None:
    """Moves the bodies of `state` for some time (s) at constant velocities (6 bodies,).

    Of `moved`, (13 bodies,), only the positions are written; quaternions stay of length 1.
    """
    for body in range(state.size // 13):
        q, v = 7 * body, BLOCK * body
        # The rotation's quaternion, to fourth order in its angle (some thousandths a step).
        half = 0.5 * time
        x, y, z = half * velocities[v], half * velocities[v + 1], half * velocities[v + 2]
        square = x * x + y * y + z * z
        sine = 1.0 - square / 6.0
        w, x, y, z = 1.0 - 0.5 * square * (1.0 - square / 12.0), sine * x, sine * y, sine * z
        q_w, q_x, q_y, q_z = state[q], state[q + 1], state[q + 2], state[q + 3]
        n_w = w * q_w - x * q_x - y * q_y - z * q_z
        n_x = w * q_x + x * q_w + y * q_z - z * q_y
        n_y = w * q_y + y * q_w + z * q_x - x * q_z
        n_z = w * q_z + z * q_w + x * q_y - y * q_x
        scale = 1.0 / np.sqrt(n_w * n_w + n_x * n_x + n_y * n_y + n_z * n_z)
        moved[q] = scale * n_w
        moved[q + 1] = scale * n_x
        moved[q + 2] = scale * n_y
        moved[q + 3] = scale * n_z
        moved[q + 4] = state[q + 4] + time * velocities[v + 3]
        moved[q + 5] = state[q + 5] + time * velocities[v + 4]
        moved[q + 6] = state[q + 6] + time * velocities[v + 5]


@compiled
def implicit_matrix(
    robot: Model, modes: Array, forces: Forces, time: float, row: Array, rows: Array
) -> None:
    """Mass matrix + time * damping matrix + time² * contact stiffness, into `rows` of
    block_tridiagonal.

    Damping is what makes the equations stiff: that of cables, normal forces and stiction.
    `row`, (ROW,), is room to work in; `time` in s.
    """
    nodes = robot.p_BN.shape[0]
    rows[:] = 0.0
    for body in range(rows.shape[0]):
        for k in range(BLOCK):
            rows[body, k, k] = robot.moment if k < 3 else robot.mass
    motion = forces.motion
    for i in range(robot.cables.size):
        cable = robot.cables[i]
        a, b = cable.node_a, cable.node_b
        scale = 1.0 / forces.lengths[i]
        d_x = (motion[b, P_WN] - motion[a, P_WN]) * scale
        d_y = (motion[b, P_WN + 1] - motion[a, P_WN + 1]) * scale
        d_z = (motion[b, P_WN + 2] - motion[a, P_WN + 2]) * scale
        speed_row(motion, a, -d_x, -d_y, -d_z, row[:BLOCK])
        speed_row(motion, b, d_x, d_y, d_z, row[BLOCK:])
        add_outer_product(time * cable.damping, row, a // nodes, ROW, rows)
    law = robot.ground[0]
    for i in range(robot.contacts.size):
        if modes[i, CONTACT] == 0.0:
            continue
        node = robot.contacts[i]
        body = node // nodes
        if forces.normal[i] > 0.0:
            depth = -motion[node, P_WN + 2]
            speed_row(motion, node, 0.0, 0.0, 1.0, row)
            damping = time * (law.damping * depth + time * law.stiffness)
            add_outer_product(damping, row, body, BLOCK, rows)
        damping = time * law.stiction_damping
        if modes[i, MODE] == STICK:
            speed_row(motion, node, 1.0, 0.0, 0.0, row)
            add_outer_product(damping, row, body, BLOCK, rows)
        if modes[i, MODE + 1] == STICK:
            speed_row(motion, node, 0.0, 1.0, 0.0, row)
            add_outer_product(damping, row, body, BLOCK, rows)


@compiled
def speed_row(motion: Array, node: int, d_x: float, d_y: float, d_z: float, row: Array) -> None:
    """The row (BLOCK,) whose product with its body's velocity is the node's speed along d."""
    p_x, p_y, p_z = motion[node, P_BN_W], motion[node, P_BN_W + 1], motion[node, P_BN_W + 2]
    row[0] = p_y * d_z - p_z * d_y
    row[1] = p_z * d_x - p_x * d_z
    row[2] = p_x * d_y - p_y * d_x
    row[3] = d_x
    row[4] = d_y
    row[5] = d_z
