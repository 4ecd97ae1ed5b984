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

from tetra_drake.engines.compiled.block_sparse import Schedule, solve
from tetra_drake.physics import capsules, contact
from tetra_drake.physics.forces import Forces
from tetra_drake.physics.kinematics import FORCE, gather_forces
from tetra_drake.physics.model import Model
from tetra_drake.physics.vectors import put_vector
from tetra_drake.simd.compiling import inlined, merged
from tetra_drake.simd.lanes import Real, Table, any_lane, named, select


class Touching(NamedTuple):
    """Contacts of struts in the implicit matrix; further ones are explicit if these are full."""

    along: Annotated[Table, "6 * touches * bodies"]
    """The vectors g, one after the other."""
    solved: Annotated[Table, "6 * touches * bodies"]
    """The vectors z, one after the other."""
    factor: Annotated[Table, "touches"]
    """The factors w / (1 + w gᵀ z)."""
    spring: Annotated[Table, "touches"]
    """Parts time² * stiffness of w."""
    vector: Annotated[Table, "6 * bodies"]
    """Scratch memory."""
    count: Annotated[Table, 1, int]
    """Number of contacts."""


@merged
def add_touching(
    robot: Model, schedule: Schedule, forces: Forces, time: Real, blocks: Table, touching: Touching
) -> None:
    """Writes `touching` for the contacts of struts in the state of `forces`.

    `blocks` is the factorised matrix without them, `time` is in s. Forces on nodes are overwritten.
    """
    touching.count[0] = 0
    near, nodes, vector = forces.near_struts, forces.nodes, touching.vector
    law = named(contact.NormalForce, robot.strut_contact.normal)
    for k in range(near.count[0]):
        i, j, last = near.pairs[k, 0], near.pairs[k, 1], touching.count[0]
        touch = capsules.find_touch(robot.struts, nodes, i, j)
        if last == touching.factor.size or not any_lane(touch.depth > 0.0):
            continue
        rate = capsules.depth_rate(robot.struts, nodes, i, j, touch)
        presses = contact.normal_force(touch.depth, rate, law) > 0.0
        spring = select(presses, time * time * law.stiffness, 0.0)
        weight = spring + select(presses, time * law.damping * touch.depth, 0.0)
        for node in range(nodes.shape[0]):
            put_vector((0.0, 0.0, 0.0), node, FORCE, nodes)
        capsules.push_ends(robot.struts, nodes, i, j, touch, 1.0)
        gather_forces(nodes, robot.first_node, vector)
        for n in range(vector.size):
            touching.along[last * vector.size + n] = vector[n]
        solve_touching(blocks, schedule, touching, vector)
        for n in range(vector.size):
            touching.solved[last * vector.size + n] = vector[n]
        touching.spring[last] = spring
        touching.factor[last] = weight / (1.0 + weight * product(touching.along, last, vector))
        touching.count[0] = last + 1


@inlined
def product(vectors: Table, k: int, x: Table) -> Real:
    """Scalar product of vector k and x."""
    total = 0.0
    for n in range(x.size):
        total += vectors[k * x.size + n] * x[n]
    return total


@inlined
def solve_touching(blocks: Table, schedule: Schedule, touching: Touching, x: Table) -> None:
    """Solves the factorised system with the contacts of `touching`; see block_sparse.solve()."""
    solve(blocks, schedule, x)
    for k in range(touching.count[0]):
        scale = touching.factor[k] * product(touching.along, k, x)
        for n in range(x.size):
            x[n] -= scale * touching.solved[k * x.size + n]


@inlined
def subtract_springs(touching: Touching, factor: Real, k1: Table, k2: Table) -> None:
    """Subtracts factor * time² * stiffness * k1 of the contacts from k2."""
    for k in range(touching.count[0]):
        scale = factor * touching.spring[k] * product(touching.along, k, k1)
        for n in range(k2.size):
            k2[n] -= scale * touching.along[k * k2.size + n]
