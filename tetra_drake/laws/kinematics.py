"""Kinematics of free rigid bodies: motions of their nodes, and sums of the forces on the nodes."""

from __future__ import annotations

import numpy as np

from tetra_drake.kernels.compiling import compiled, inlined
from tetra_drake.kernels.lanes import Real, Table, inverse_sqrt, select
from tetra_drake.laws.vectors import (
    Vector3,
    cross,
    difference,
    dot,
    put_vector,
    scaled,
    sum_of,
    vector_at,
)

P_BN_W, P_WN, V_WN, FORCE, NODE_COLUMNS = 0, 3, 6, 9, 12
"""Columns of the table `nodes` (nodes, 12), and their number: vector from the body's origin to the
node (m), position (m), velocity (m/s), force on the node (N), all in the world frame. The nodes of
a body are consecutive rows. Then come fixed nodes, which belong to no body; the forces on them move
nothing. The last rows are the lowest points of round feet; see `contact`."""


@compiled
def move_nodes(state: Table, p_BN: Table, first_node: Table, nodes: Table) -> None:
    """Writes positions and velocities of all nodes to the table `nodes`, and sets the forces on
    them to zero.

    Args:
        state: [q; v] of the bodies, 13 numbers per body.
        p_BN: positions of the nodes (nodes, 3) in the frames of their bodies, in m; then positions
            of fixed nodes in the world.
        first_node: index of each body's first node (bodies + 1,); the last number is the index of
            the first fixed node.
        nodes: the table to write.
    """
    bodies = state.size // 13
    for body in range(bodies):
        q, v = 7 * body, 7 * bodies + 6 * body
        x, y, z = rotation(state, body)
        o_x, o_y, o_z = state[q + 4], state[q + 5], state[q + 6]
        w_x, w_y, w_z = state[v], state[v + 1], state[v + 2]
        v_x, v_y, v_z = state[v + 3], state[v + 4], state[v + 5]
        for node in range(first_node[body], first_node[body + 1]):
            p_B = vector_at(p_BN, node, 0)
            p_x, p_y, p_z = dot(x, p_B), dot(y, p_B), dot(z, p_B)
            put_vector((p_x, p_y, p_z), node, P_BN_W, nodes)
            put_vector((o_x + p_x, o_y + p_y, o_z + p_z), node, P_WN, nodes)
            nodes[node, V_WN] = v_x + w_y * p_z - w_z * p_y
            nodes[node, V_WN + 1] = v_y + w_z * p_x - w_x * p_z
            nodes[node, V_WN + 2] = v_z + w_x * p_y - w_y * p_x
            put_vector((0.0, 0.0, 0.0), node, FORCE, nodes)
    for node in range(first_node[bodies], p_BN.shape[0]):
        place = vector_at(p_BN, node, 0)
        put_vector(place, node, P_BN_W, nodes)
        put_vector(place, node, P_WN, nodes)
        put_vector((0.0, 0.0, 0.0), node, V_WN, nodes)
        put_vector((0.0, 0.0, 0.0), node, FORCE, nodes)


_LEAST_INERTIA = 1e-9
"""Moment of inertia that is added about each axis, divided by the sum of all three moments. So
nodes on a line have no angular velocity about the line."""


@inlined
def pitch_rate(nodes: Table, moving: int) -> Real:
    """Angular velocity (rad/s) about the world's y axis of the structure as a whole, positive if it
    rolls forward (+x).

    It is the angular velocity of the rigid motion that fits the velocities of the nodes best (least
    squares): their angular momentum about their centre, divided by their inertia, with a unit mass
    at each node. Only the first `moving` nodes count; the others are fixed. A change of shape alone
    does not count.
    """
    share = 1.0 / moving
    centre = spin = (0.0, 0.0, 0.0)
    for node in range(moving):
        centre = sum_of(centre, scaled(share, vector_at(nodes, node, P_WN)))
    s_xx = s_yy = s_zz = s_xy = s_xz = s_yz = 0.0
    for node in range(moving):
        r = difference(vector_at(nodes, node, P_WN), centre)
        r_x, r_y, r_z = r
        s_xx += r_x * r_x
        s_yy += r_y * r_y
        s_zz += r_z * r_z
        s_xy += r_x * r_y
        s_xz += r_x * r_z
        s_yz += r_y * r_z
        spin = sum_of(spin, cross(r, vector_at(nodes, node, V_WN)))
    least = _LEAST_INERTIA * (s_xx + s_yy + s_zz)
    i_xx, i_yy, i_zz = s_yy + s_zz + least, s_xx + s_zz + least, s_xx + s_yy + least
    # Cofactors of the inertia's second row.
    c_yx = s_xz * s_yz + s_xy * i_zz
    c_yy = i_xx * i_zz - s_xz * s_xz
    c_yz = s_xy * s_xz + i_xx * s_yz
    determinant = i_yy * c_yy - s_xy * c_yx - s_yz * c_yz
    return dot((c_yx, c_yy, c_yz), spin) / determinant


@inlined
def rotation(state: Table, body: int) -> tuple[Vector3, Vector3, Vector3]:
    """Rotation matrix R_WB of a body, as its rows. `state` is [q; v] of all bodies (13*bodies,)."""
    q = 7 * body
    w, x, y, z = state[q], state[q + 1], state[q + 2], state[q + 3]
    s = 2.0 / (w * w + x * x + y * y + z * z)
    return (
        (1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)),
        (s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x)),
        (s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y)),
    )


@inlined
def move_bodies(state: Table, velocities: Table, time: Real, moved: Table) -> None:
    """Writes the positions and quaternions of the bodies after a time (s) to `moved` (13*bodies,).

    The bodies move from `state` [q; v] with constant `velocities` v (6*bodies,). The last 6*bodies
    numbers of `moved`, the velocities, are not written. Quaternions get the length 1.
    """
    half = 0.5 * time
    for body in range(velocities.size // 6):
        q, v = 7 * body, 6 * body
        # Quaternion of the rotation, to fourth order in the angle (some 0.001 rad per step).
        x, y, z = half * velocities[v], half * velocities[v + 1], half * velocities[v + 2]
        square = x * x + y * y + z * z
        sine = 1.0 - square * (1.0 / 6.0)
        w = 1.0 - 0.5 * square * (1.0 - square * (1.0 / 12.0))
        x, y, z = sine * x, sine * y, sine * z
        q_w, q_x, q_y, q_z = state[q], state[q + 1], state[q + 2], state[q + 3]
        n_w = w * q_w - x * q_x - y * q_y - z * q_z
        n_x = w * q_x + x * q_w + y * q_z - z * q_y
        n_y = w * q_y + y * q_w + z * q_x - x * q_z
        n_z = w * q_z + z * q_w + x * q_y - y * q_x
        scale = inverse_sqrt(n_w * n_w + n_x * n_x + n_y * n_y + n_z * n_z)
        moved[q] = scale * n_w
        moved[q + 1] = scale * n_x
        moved[q + 2] = scale * n_y
        moved[q + 3] = scale * n_z
        moved[q + 4] = state[q + 4] + time * velocities[v + 3]
        moved[q + 5] = state[q + 5] + time * velocities[v + 4]
        moved[q + 6] = state[q + 6] + time * velocities[v + 5]


@inlined
def put_orientation(state: Table, body: int, row: int, column: int, table: Table) -> None:
    """Writes the inverse of a body's quaternion (w first) to a row of a table, in four columns from
    `column` on. turn_from() reads it. `state` is [q; v] of all bodies."""
    q = 7 * body
    w, x, y, z = state[q], state[q + 1], state[q + 2], state[q + 3]
    scale = 1.0 / (w * w + x * x + y * y + z * z)
    table[row, column] = scale * w
    put_vector((-scale * x, -scale * y, -scale * z), row, column + 1, table)


@inlined
def turn_from(table: Table, row: int, column: int, state: Table, body: int) -> Vector3:
    """Rotation vector (rad) in the world frame from an earlier orientation of a body to its present
    one in `state`, to third order in the angle. put_orientation() has stored the earlier
    orientation in this row of the table, from `column` on."""
    w, x, y, z = state[7 * body], state[7 * body + 1], state[7 * body + 2], state[7 * body + 3]
    i_w, i = table[row, column], vector_at(table, row, column + 1)
    turned = sum_of(sum_of(scaled(w, i), scaled(i_w, (x, y, z))), cross((x, y, z), i))
    cosine = w * i_w - dot((x, y, z), i)
    return scaled(select(cosine < 0.0, -2.0, 2.0), turned)


@inlined
def angular_velocity(state: Table, body: int) -> Vector3:
    """Angular velocity w_WB (rad/s) of a body in the world frame. `state` is [q; v] of all bodies
    (13*bodies,)."""
    v = 7 * (state.size // 13) + 6 * body
    return state[v], state[v + 1], state[v + 2]


@inlined
def node_acceleration(
    state: Table, acceleration: Table, nodes: Table, node: int, body: int
) -> Vector3:
    """Acceleration (m/s²) in the world frame of a node that is fixed to `body`. `state` is [q; v]
    (13*bodies,), `acceleration` is dv/dt of all bodies, 6 numbers per body. `nodes` has the vector
    from the body's origin to the node."""
    a = 6 * body
    w_x, w_y, w_z = angular_velocity(state, body)
    p_x, p_y, p_z = vector_at(nodes, node, P_BN_W)
    u_x, u_y, u_z = cross((w_x, w_y, w_z), (p_x, p_y, p_z))
    alpha_x, alpha_y, alpha_z = acceleration[a], acceleration[a + 1], acceleration[a + 2]
    return (
        acceleration[a + 3] + alpha_y * p_z - alpha_z * p_y + w_y * u_z - w_z * u_y,
        acceleration[a + 4] + alpha_z * p_x - alpha_x * p_z + w_z * u_x - w_x * u_z,
        acceleration[a + 5] + alpha_x * p_y - alpha_y * p_x + w_x * u_y - w_y * u_x,
    )


@inlined
def gather_forces(nodes: Table, first_node: Table, generalized_force: Table) -> None:
    """Sums the forces on the nodes of each body, and writes torque and force [t_W; f_W] at the
    body's origin to `generalized_force` (6*bodies,), as in Drake's applied_generalized_force.
    `first_node` is the index of each body's first node (bodies + 1,)."""
    for body in range(generalized_force.size // 6):
        torque = total = (0.0, 0.0, 0.0)
        for node in range(first_node[body], first_node[body + 1]):
            force = vector_at(nodes, node, FORCE)
            torque = sum_of(torque, cross(vector_at(nodes, node, P_BN_W), force))
            total = sum_of(total, force)
        g = 6 * body
        generalized_force[g], generalized_force[g + 1], generalized_force[g + 2] = torque
        generalized_force[g + 3], generalized_force[g + 4], generalized_force[g + 5] = total


@compiled
def interpolate_state(before: Table, after: Table, step: float, part: float) -> Table:
    """State [q; v] (13*bodies,) between the states `before` and `after` a step of `step` seconds.

    `part` (0 to 1) is the time since the beginning of the step, divided by `step`. Positions and
    quaternions are cubic polynomials that fit values and velocities at both ends; quaternions then
    get the length 1. Velocities are linear. If `part` is 1, the state equals `after`.
    """
    bodies = before.size // 13
    between = after.copy()
    if part == 1.0:
        return between
    left = 1.0 - part
    from_before = (1.0 + 2.0 * part) * left * left
    rate_before = step * part * left * left
    rate_after = -step * part * part * left
    q_rates = np.empty((2, 7))
    for body in range(bodies):
        q, v = 7 * body, 7 * bodies + 6 * body
        for end, state in enumerate((before, after)):
            w, x, y, z = state[q], state[q + 1], state[q + 2], state[q + 3]
            w_x, w_y, w_z = 0.5 * state[v], 0.5 * state[v + 1], 0.5 * state[v + 2]
            q_rates[end, 0] = -w_x * x - w_y * y - w_z * z
            q_rates[end, 1] = w_x * w + w_y * z - w_z * y
            q_rates[end, 2] = w_y * w + w_z * x - w_x * z
            q_rates[end, 3] = w_z * w + w_x * y - w_y * x
            for k in range(3):
                q_rates[end, 4 + k] = state[v + 3 + k]
        for k in range(7):
            between[q + k] = (
                from_before * before[q + k]
                + (1.0 - from_before) * after[q + k]
                + rate_before * q_rates[0, k]
                + rate_after * q_rates[1, k]
            )
        norm = np.sqrt((between[q : q + 4] ** 2).sum())
        for k in range(4):
            between[q + k] /= norm
        for k in range(6):
            between[v + k] = left * before[v + k] + part * after[v + k]
    return between


def rigid_motions(p: np.ndarray) -> np.ndarray:
    """Velocities (points, 3, 6) of points of a rigid body for six unit motions. `p` (points, 3) are
    their positions in m.

    The six motions are rotations about x, y and z through the origin with 1 rad/s, then
    translations along x, y and z with 1 m/s.
    """
    motions = np.zeros((len(p), 3, 6))
    x, y, z = p.T
    motions[:, 1, 0], motions[:, 2, 0] = -z, y
    motions[:, 0, 1], motions[:, 2, 1] = z, -x
    motions[:, 0, 2], motions[:, 1, 2] = -y, x
    motions[:, :, 3:] = np.eye(3)
    return motions
