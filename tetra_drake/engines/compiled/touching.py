"""Implicit part of the forces between struts that touch.

A contact pushes both bodies along g, the derivative of the struts' distance. In the implicit matrix
it counts as w g gᵀ with w = time * damping + time² * stiffness. The pair of bodies may have no
block in the matrix. So the matrix is factorised without contacts, and Sherman and Morrison's
formula adds one contact after the other to the solution:

    (B + w g gᵀ)⁻¹ b = x - z (w gᵀ x) / (1 + w gᵀ z)    with B x = b and B z = g

The sum of both forces is zero in g, so that the momentum is kept.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from tetra_drake.engines.compiled.block_sparse import BLOCK, Schedule, solve
from tetra_drake.physics import capsules, contact
from tetra_drake.physics.forces import Forces
from tetra_drake.physics.kinematics import P_BN_W
from tetra_drake.physics.model import Model
from tetra_drake.physics.vectors import Vector, cross, put_vector, sum_of, vector_at
from tetra_drake.simd.compiling import inlined, merged
from tetra_drake.simd.lanes import Real, Table, any_lane, named, select

FACTOR, SPRING, ROW = range(2 * BLOCK, 2 * BLOCK + 3)
"""Columns of `rows`: w / (1 + w gᵀ z), time² * stiffness. ROW is their number; the first ones are
g."""


class Touching(NamedTuple):
    """Contacts of struts in the implicit matrix; others are explicit if these are full."""

    rows: Annotated[Table, "touches", ROW]
    solved: Annotated[Table, "touches", "6 * bodies"]
    """The vectors z."""
    bodies: Annotated[Table, "touches", 2, int]
    """Indices of both bodies of each contact."""
    count: Annotated[Table, 1, int]
    """Number of contacts."""


@merged
def add_touching(
    robot: Model,
    schedule: Schedule,
    forces: Forces,
    time: Real,
    blocks: Table,
    touching: Touching,
    x: Table,
) -> None:
    """Writes `touching` for the contacts of struts in the state of `forces`.

    `blocks` is the factorised matrix without them, `time` is in s, `x` (6 bodies,) is scratch
    memory.
    """
    touching.count[0] = 0
    near, law = forces.near_struts, named(contact.NormalForce, robot.strut_contact.normal)
    for k in range(near.count[0]):
        pair = near.pairs[k, 0], near.pairs[k, 1]
        touch = capsules.find_touch(robot.struts, forces.nodes, pair[0], pair[1])
        last = touching.count[0]
        if last == touching.bodies.shape[0] or not any_lane(touch.depth > 0.0):
            continue
        rate = capsules.depth_rate(robot.struts, forces.nodes, pair[0], pair[1], touch)
        presses = contact.normal_force(touch.depth, rate, law) > 0.0
        spring = select(presses, time * time * law.stiffness, 0.0)
        weight = select(presses, time * law.damping * touch.depth, 0.0) + spring
        for i in range(x.size):
            x[i] = 0.0
        for side in range(2):
            body, strut = near.pairs[k, 2 + side], pair[side]
            touching.bodies[last, side] = body
            ends = robot.struts.node_a[strut], robot.struts.node_b[strut]
            pushes = touch.gradient[2 * side], touch.gradient[2 * side + 1]
            put_wrench(forces.nodes, ends, pushes, last, BLOCK * side, touching.rows)
            for c in range(BLOCK):
                x[BLOCK * body + c] = touching.rows[last, BLOCK * side + c]
        solve_touching(blocks, schedule, touching, x)
        for i in range(x.size):
            touching.solved[last, i] = x[i]
        touching.rows[last, SPRING] = spring
        touching.rows[last, FACTOR] = weight / (1.0 + weight * along(touching, last, x))
        touching.count[0] = last + 1


@inlined
def put_wrench(
    nodes: Table,
    ends: tuple[int, int],
    pushes: tuple[Vector, Vector],
    row: int,
    column: int,
    rows: Table,
) -> None:
    """Writes the torque and the force on a body, 6 numbers, by forces on two nodes."""
    torque_a = cross(vector_at(nodes, ends[0], P_BN_W), pushes[0])
    torque_b = cross(vector_at(nodes, ends[1], P_BN_W), pushes[1])
    put_vector(sum_of(torque_a, torque_b), row, column, rows)
    put_vector(sum_of(pushes[0], pushes[1]), row, column + 3, rows)


@inlined
def along(touching: Touching, k: int, x: Table) -> Real:
    """Product gᵀ x of contact k."""
    product = 0.0
    for side in range(2):
        first = BLOCK * touching.bodies[k, side]
        for c in range(BLOCK):
            product += touching.rows[k, BLOCK * side + c] * x[first + c]
    return product


@inlined
def solve_touching(blocks: Table, schedule: Schedule, touching: Touching, x: Table) -> None:
    """Solves the factorised system with the contacts of `touching`; see block_sparse.solve()."""
    solve(blocks, schedule, x)
    for k in range(touching.count[0]):
        scale = touching.rows[k, FACTOR] * along(touching, k, x)
        for i in range(x.size):
            x[i] -= scale * touching.solved[k, i]


@inlined
def subtract_springs(touching: Touching, factor: Real, k1: Table, k2: Table) -> None:
    """Subtracts factor * time² * stiffness * k1 of the contacts from k2."""
    for k in range(touching.count[0]):
        scale = factor * touching.rows[k, SPRING] * along(touching, k, k1)
        for side in range(2):
            first = BLOCK * touching.bodies[k, side]
            for c in range(BLOCK):
                k2[first + c] -= scale * touching.rows[k, BLOCK * side + c]
