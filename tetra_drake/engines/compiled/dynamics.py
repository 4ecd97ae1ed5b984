"""The equations of motion: free rigid bodies under the forces of cables, ground and gravity.

Vectors over bodies hold 6 numbers per body, rotation before translation, in World.
"""

from __future__ import annotations

from tetra_drake.engines.compiled.block_tridiagonal import BLOCK
from tetra_drake.physics.cable import DIRECTION
from tetra_drake.physics.contact import (
    CONTACT,
    NORMAL,
    Ground,
    NormalForce,
    gap,
    sliding,
)
from tetra_drake.physics.forces import Forces
from tetra_drake.physics.friction import friction_damping
from tetra_drake.physics.kinematics import P_BN_W
from tetra_drake.physics.model import JUNCTION_CABLES, Model
from tetra_drake.physics.terrain import to_world
from tetra_drake.simd.compiling import inlined, merged
from tetra_drake.simd.lanes import Real, Table, any_lane, named, select


@inlined
def inertia(robot: Model, j: int) -> Real:
    """The diagonal of a body's mass matrix: of rotation for j = 0, 1, 2, else of translation."""
    return robot.body.moment[0] if j < 3 else robot.body.mass[0]


@merged
def implicit_matrix(
    robot: Model, modes: Table, forces: Forces, time: Real, lines: Table, rows: Table
) -> None:
    """Writes mass matrix + time * damping matrix + time² * contact stiffness, as rows of
    block_tridiagonal; time in s.

    Damping is what makes the equations stiff: that of cables, normal forces and stiction.
    `lines`, (JUNCTION_CABLES, 9), is room for what is computed on the way.
    """
    for r in range(BLOCK):
        for c in range(r, BLOCK):
            rows[0, r, c] = 0.0
    for junction in range(rows.shape[0] - 1):
        add_junction(robot, forces, time, junction, lines, rows)
    for body in range(rows.shape[0]):
        for r in range(BLOCK):
            rows[body, r, r] += inertia(robot, r)
    law = named(NormalForce, robot.ground.normal)
    for i in range(robot.ground.contacts.size):
        if any_lane(modes[i, CONTACT] != 0.0):
            add_contact(modes, forces, robot.ground, law, i, time, rows)


@inlined
def add_junction(
    robot: Model, forces: Forces, time: Real, junction: int, lines: Table, rows: Table
) -> None:
    """Adds time * damping * l lᵀ for each cable from body `junction` to the next, the first to
    contribute to that one's rows.

    l, (ROW,), times the velocities of both bodies is the rate of the cable's length: the ends at
    p_a and p_b move apart along d, so l = (u, -d, w, d) with u = d x p_a and w = p_b x d. All
    cables of the junction are summed at once, a product of two columns of `lines`: u, w, d.
    """
    for j in range(JUNCTION_CABLES):
        i = JUNCTION_CABLES * junction + j
        d_x, d_y = forces.pulls[i, DIRECTION], forces.pulls[i, DIRECTION + 1]
        d_z = forces.pulls[i, DIRECTION + 2]
        a, b = robot.cables.node_a[i], robot.cables.node_b[i]
        p_x, p_y = forces.nodes[a, P_BN_W], forces.nodes[a, P_BN_W + 1]
        p_z = forces.nodes[a, P_BN_W + 2]
        lines[j, 0] = d_y * p_z - d_z * p_y
        lines[j, 1] = d_z * p_x - d_x * p_z
        lines[j, 2] = d_x * p_y - d_y * p_x
        p_x, p_y = forces.nodes[b, P_BN_W], forces.nodes[b, P_BN_W + 1]
        p_z = forces.nodes[b, P_BN_W + 2]
        lines[j, 3] = p_y * d_z - p_z * d_y
        lines[j, 4] = p_z * d_x - p_x * d_z
        lines[j, 5] = p_x * d_y - p_y * d_x
        lines[j, 6], lines[j, 7], lines[j, 8] = d_x, d_y, d_z
    first, damping = JUNCTION_CABLES * junction, robot.cables.damping
    weights = (
        time * damping[first],
        time * damping[first + 1],
        time * damping[first + 2],
        time * damping[first + 3],
        time * damping[first + 4],
        time * damping[first + 5],
    )
    after = junction + 1
    for r in range(3):
        u = weighted(lines, r, weights)
        w = weighted(lines, 3 + r, weights)
        d = weighted(lines, 6 + r, weights)
        for c in range(r, 3):
            rows[junction, r, c] += product(u, lines, c)
            rows[after, r, c] = product(w, lines, 3 + c)
            dd = product(d, lines, 6 + c)
            rows[junction, 3 + r, 3 + c] += dd
            rows[after, 3 + r, 3 + c] = dd
            rows[junction, 3 + r, 9 + c] = -dd
            rows[junction, 3 + c, 9 + r] = -dd
        for c in range(3):
            rows[junction, r, 6 + c] = product(u, lines, 3 + c)
            ud = product(u, lines, 6 + c)
            rows[junction, r, 3 + c] -= ud
            rows[junction, r, 9 + c] = ud
            wd = product(w, lines, 6 + c)
            rows[after, r, 3 + c] = wd
            rows[junction, 3 + c, 6 + r] = -wd


@inlined
def weighted(lines: Table, c: int, weights: tuple[Real, ...]) -> tuple[Real, ...]:
    """Column c of `lines`, times weights."""
    return (
        weights[0] * lines[0, c],
        weights[1] * lines[1, c],
        weights[2] * lines[2, c],
        weights[3] * lines[3, c],
        weights[4] * lines[4, c],
        weights[5] * lines[5, c],
    )


@inlined
def product(column: tuple[Real, ...], lines: Table, c: int) -> Real:
    """The product of a column and column c of `lines`."""
    return (
        column[0] * lines[0, c]
        + column[1] * lines[1, c]
        + column[2] * lines[2, c]
        + column[3] * lines[3, c]
        + column[4] * lines[4, c]
        + column[5] * lines[5, c]
    )


@inlined
def add_contact(
    modes: Table, forces: Forces, ground: Ground, law: NormalForce, i: int, time: Real, rows: Table
) -> None:
    """Adds time * damping + time² * stiffness of a contact, which acts where it touches."""
    nodes, frames = forces.nodes, forces.frames
    touches, node = modes[i, CONTACT] != 0.0, ground.contacts[i]
    depth = -gap(nodes, ground, frames, i)
    slide, _ = sliding(nodes, modes, ground, law, frames, i)
    k_1, k_12, k_2 = friction_damping(slide, time, ground.friction)
    k_1, k_2 = select(touches, k_1, 0.0), select(touches, k_2, 0.0)
    k_12 = select(touches, k_12, 0.0)
    presses = touches & (forces.pushes[i, NORMAL] > 0.0)
    k_n = select(presses, time * (law.damping * depth + time * law.stiffness), 0.0)
    body = node // (nodes.shape[0] // rows.shape[0])
    # The columns of the matrix in World, and from the frame's: R K, then (R K) Rᵀ.
    a = to_world(k_1, k_12, 0.0, frames, i, ground.flat)
    b = to_world(k_12, k_2, 0.0, frames, i, ground.flat)
    c = to_world(0.0, 0.0, k_n, frames, i, ground.flat)
    x = to_world(a[0], b[0], c[0], frames, i, ground.flat)
    y = to_world(a[1], b[1], c[1], frames, i, ground.flat)
    z = to_world(a[2], b[2], c[2], frames, i, ground.flat)
    add_diagonal(nodes, node, body, (x[0], y[1], z[2]), rows)
    xy, xz, yz = x[1], x[2], y[2]
    if any_lane((xy != 0.0) | (xz != 0.0) | (yz != 0.0)):
        add_off_diagonal(nodes, node, body, (xy, xz, yz), rows)


@inlined
def add_diagonal(
    nodes: Table, node: int, body: int, k: tuple[Real, Real, Real], rows: Table
) -> None:
    """Adds Jᵀ diag(k_x, k_y, k_z) J of a node at p from its body's origin, where J = [-[p]x 1]
    times the velocity of the body is the node's."""
    p_x, p_y, p_z = nodes[node, P_BN_W], nodes[node, P_BN_W + 1], nodes[node, P_BN_W + 2]
    k_x, k_y, k_z = k
    rows[body, 0, 0] += p_y * p_y * k_z + p_z * p_z * k_y
    rows[body, 1, 1] += p_z * p_z * k_x + p_x * p_x * k_z
    rows[body, 2, 2] += p_x * p_x * k_y + p_y * p_y * k_x
    rows[body, 0, 1] -= p_x * p_y * k_z
    rows[body, 0, 2] -= p_x * p_z * k_y
    rows[body, 1, 2] -= p_y * p_z * k_x
    rows[body, 0, 4] -= p_z * k_y
    rows[body, 0, 5] += p_y * k_z
    rows[body, 1, 3] += p_z * k_x
    rows[body, 1, 5] -= p_x * k_z
    rows[body, 2, 3] -= p_y * k_x
    rows[body, 2, 4] += p_x * k_y
    rows[body, 3, 3] += k_x
    rows[body, 4, 4] += k_y
    rows[body, 5, 5] += k_z


@inlined
def add_off_diagonal(
    nodes: Table, node: int, body: int, k: tuple[Real, Real, Real], rows: Table
) -> None:
    """Product with the symmetric matrix of k_xy, k_xz and k_yz."""
    p_x, p_y, p_z = nodes[node, P_BN_W], nodes[node, P_BN_W + 1], nodes[node, P_BN_W + 2]
    xy, xz, yz = k
    # The rows of [p]x K.
    a = p_y * xz - p_z * xy, p_y * yz, -p_z * yz
    b = -p_x * xz, p_z * xy - p_x * yz, p_z * xz
    c = p_x * xy, -p_y * xy, p_x * yz - p_y * xz
    rows[body, 0, 0] += p_y * a[2] - p_z * a[1]
    rows[body, 0, 1] += p_z * a[0] - p_x * a[2]
    rows[body, 0, 2] += p_x * a[1] - p_y * a[0]
    rows[body, 1, 1] += p_z * b[0] - p_x * b[2]
    rows[body, 1, 2] += p_x * b[1] - p_y * b[0]
    rows[body, 2, 2] += p_x * c[1] - p_y * c[0]
    for column in range(3):
        rows[body, 0, 3 + column] += a[column]
        rows[body, 1, 3 + column] += b[column]
        rows[body, 2, 3 + column] += c[column]
    rows[body, 3, 4] += xy
    rows[body, 3, 5] += xz
    rows[body, 4, 5] += yz
