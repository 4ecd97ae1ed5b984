"""The equations of nodes: free rigid bodies under the forces of cables, ground and gravity.

Vectors over bodies hold 6 numbers per body, rotation before translation, in World.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tetra_drake.engines.compiled.block_tridiagonal import BLOCK, ROW, add_outer_product
from tetra_drake.physics.cable import add_cable_forces
from tetra_drake.physics.compiling import compiled
from tetra_drake.physics.contact import CONTACT, MODE, add_ground_forces
from tetra_drake.physics.friction import STICK
from tetra_drake.physics.kinematics import P_BN_W, P_WN, gather_forces
from tetra_drake.robot.model import Model

Array = np.ndarray


class Forces(NamedTuple):
    """The forces at a state; as in `physics`."""

    nodes: Array
    generalized: Array
    """(6 bodies,)."""
    cables: Array
    """(2, cables): tensions and lengths."""
    contacts: Array
    """(contacts, 3): on the contact nodes."""


@compiled
def compute_forces(robot: Model, nodes: Array, modes: Array, signals: Array) -> Forces:
    """All forces on nodes that have just been moved, and gravity; arguments as in `physics`."""
    cables = add_cable_forces(nodes, signals, robot.cables, robot.slack)
    contacts = add_ground_forces(nodes, modes, robot.contacts, robot.ground)
    generalized = gather_forces(nodes, robot.inertia.size // BLOCK)
    for i in range(5, generalized.size, BLOCK):
        generalized[i] -= robot.mass * robot.gravity
    return Forces(nodes, generalized, cables, contacts)


@compiled
def move_bodies(state: Array, velocities: Array, time: float) -> Array:
    """The state (13 bodies,) with its bodies moved for a time (s) at velocities (6 bodies,).

    Its own velocities stay as they are; quaternions get the length 1.
    """
    moved = state.copy()
    for body in range(state.size // 13):
        q, v = 7 * body, BLOCK * body
        # The rotation's quaternion, to fourth order in its angle (some thousandths per step).
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
    return moved


@compiled
def implicit_matrix(robot: Model, modes: Array, forces: Forces, time: float) -> Array:
    """Mass matrix + time * damping matrix + time² * contact stiffness, as rows of
    block_tridiagonal; time in s.

    Damping is what makes the equations stiff: that of cables, normal forces and stiction.
    """
    per_body, nodes, law = robot.p_BN.shape[0], forces.nodes, robot.ground[0]
    rows, row = np.zeros((robot.inertia.size // BLOCK, BLOCK, ROW)), np.zeros(ROW)
    for k in range(robot.inertia.size):
        rows[k // BLOCK, k % BLOCK, k % BLOCK] = robot.inertia[k]
    for i in range(robot.cables.size):
        cable = robot.cables[i]
        a, b = cable.node_a, cable.node_b
        scale = 1.0 / forces.cables[1, i]
        d_x = (nodes[b, P_WN] - nodes[a, P_WN]) * scale
        d_y = (nodes[b, P_WN + 1] - nodes[a, P_WN + 1]) * scale
        d_z = (nodes[b, P_WN + 2] - nodes[a, P_WN + 2]) * scale
        speed_row(nodes, a, -d_x, -d_y, -d_z, row[:BLOCK])
        speed_row(nodes, b, d_x, d_y, d_z, row[BLOCK:])
        add_outer_product(time * cable.damping, row, a // per_body, ROW, rows)
    for i in range(robot.contacts.size):
        if modes[i, CONTACT] == 0.0:
            continue
        node = robot.contacts[i]
        body = node // per_body
        if forces.contacts[i, 2] > 0.0:
            speed_row(nodes, node, 0.0, 0.0, 1.0, row)
            damping = law.damping * -nodes[node, P_WN + 2] + time * law.stiffness
            add_outer_product(time * damping, row, body, BLOCK, rows)
        for axis in range(2):
            if modes[i, MODE + axis] == STICK:
                speed_row(nodes, node, 1.0 - axis, 1.0 * axis, 0.0, row)
                add_outer_product(time * law.stiction_damping, row, body, BLOCK, rows)
    return rows


@compiled
def speed_row(nodes: Array, node: int, d_x: float, d_y: float, d_z: float, row: Array) -> None:
    """The row (BLOCK,) whose product with its body's velocity is the node's speed along d."""
    p_x, p_y, p_z = nodes[node, P_BN_W], nodes[node, P_BN_W + 1], nodes[node, P_BN_W + 2]
    row[0] = p_y * d_z - p_z * d_y
    row[1] = p_z * d_x - p_x * d_z
    row[2] = p_x * d_y - p_y * d_x
    row[3] = d_x
    row[4] = d_y
    row[5] = d_z
