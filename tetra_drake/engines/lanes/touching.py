"""Contacts of struts in the implicit matrix of a step.

A contact pushes both bodies along g, the derivative of the struts' distance. In the implicit matrix
it counts as w g gᵀ with w = time * damping + time² * stiffness. The pair of bodies may have no
block in the matrix. So the matrix is factorised without contacts, and Sherman and Morrison's
formula adds one contact after the other to the solution:

    (B + w g gᵀ)⁻¹ b = x - z (w gᵀ x) / (1 + w gᵀ z)    with B x = b and B z = g

The sum of both forces is zero in g, so that the momentum is kept.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from tetra_drake.kernels.compiling import inlined, merged
from tetra_drake.kernels.lanes import Real, Table, Truth, any_lane, named, select
from tetra_drake.laws import capsules, contact
from tetra_drake.laws.forces import Forces
from tetra_drake.laws.kinematics import FORCE, gather_forces
from tetra_drake.laws.model import Model
from tetra_drake.laws.sparse import Schedule, solve
from tetra_drake.laws.vectors import put_vector


class Touching(NamedTuple):
    """Contacts between struts that the implicit matrix of a step takes into account; the forces of
    further contacts are explicit."""

    along: Annotated[Table, "6 * touches * bodies"]
    """Derivatives g of the struts' distances, one vector per contact, one after the other."""
    solved: Annotated[Table, "6 * touches * bodies"]
    """Solutions z of B z = g, one vector per contact, one after the other."""
    factor: Annotated[Table, "touches"]
    """Factors w / (1 + w gᵀ z) of the contacts; at first their weights w."""
    spring: Annotated[Table, "touches"]
    """Stiffness parts of the weights w: time² * stiffness."""
    vector: Annotated[Table, "6 * bodies"]
    """Scratch memory."""
    count: Annotated[Table, 1, int]  # type: ignore[assignment]  # tuples have a method count()
    """Number of contacts."""


@merged
def add_touching(
    robot: Model, schedule: Schedule, forces: Forces, time: Real, blocks: Table, touching: Touching
) -> None:
    """Writes the contacts between struts for the implicit matrix to `touching`, at the node
    positions in `forces`.

    `blocks` is the factorised matrix without them, and is not changed. `time` is in s, a share of
    the step. The forces on nodes in `forces` are overwritten. Each lane numbers its own contacts,
    so that it does not depend on the other lanes.
    """
    near, nodes, vector = forces.near_struts, forces.nodes, touching.vector
    law = named(contact.NormalForce, robot.strut_contact.normal)
    touching.count[0], found = 0, 0.0 * time
    for k in range(near.count[0]):
        i, j = near.pairs[k, 0], near.pairs[k, 1]
        touch = capsules.find_touch(robot.struts, nodes, i, j)
        if not any_lane(touch.depth > 0.0):
            continue
        rate = capsules.depth_rate(robot.struts, nodes, i, j, touch)
        presses = contact.normal_force(touch.depth, rate, law) > 0.0
        takes_place = presses & (found < touching.factor.size)
        for node in range(nodes.shape[0]):
            put_vector((0.0, 0.0, 0.0), node, FORCE, nodes)
        capsules.push_ends(robot.struts, nodes, i, j, touch, 1.0)
        gather_forces(nodes, robot.first_node, vector)
        damping = time * law.damping * touch.depth
        put_contact(touching, takes_place, found, time * time * law.stiffness, damping)
        found += select(takes_place, 1.0, 0.0)
    for place in range(touching.count[0]):
        first = place * vector.size
        for n in range(vector.size):
            vector[n] = touching.along[first + n]
        touching.count[0], weight = place, touching.factor[place]
        solve_touching(blocks, schedule, touching, vector)
        for n in range(vector.size):
            touching.solved[first + n] = vector[n]
        touching.factor[place] = weight / (1.0 + weight * product(touching.along, place, vector))
        touching.count[0] = place + 1


@inlined
def put_contact(
    touching: Touching, takes_place: Truth, place: Real, spring: Real, damping: Real
) -> None:
    """Stores a contact of two struts in `touching`, in lanes where the mask `takes_place` is true,
    as contact number `place` of the lane.

    Its vector g, the derivative of the struts' distance, is read from `touching.vector`. Its weight
    w in the implicit matrix is `spring` + `damping`, both in kg: the stiffness times time², and
    the damping coefficient times the time.
    """
    size = touching.vector.size
    count = touching.count[0]
    if any_lane(takes_place & (place == count)):
        touching.spring[count] = touching.factor[count] = 0.0 * spring
        for n in range(size):
            touching.along[count * size + n] = 0.0 * spring
        touching.count[0] = count + 1
    for k in range(touching.count[0]):
        here = takes_place & (place == k)
        touching.spring[k] = select(here, spring, touching.spring[k])
        touching.factor[k] = select(here, spring + damping, touching.factor[k])
        for n in range(size):
            old = touching.along[k * size + n]
            touching.along[k * size + n] = select(here, touching.vector[n], old)


@inlined
def product(vectors: Table, k: int, x: Table) -> Real:
    """Scalar product of x and vector number k of `vectors`, where vectors of the length of x are
    one after the other."""
    total = 0.0
    for n in range(x.size):
        total += vectors[k * x.size + n] * x[n]
    return total


@inlined
def solve_touching(blocks: Table, schedule: Schedule, touching: Touching, x: Table) -> None:
    """Solves the linear system of the matrix that factorise() has left in `blocks`, plus the
    contacts of `touching`. `x` (6*bodies,) is the right-hand side, and is overwritten by the
    solution."""
    solve(blocks, schedule, x)
    for k in range(touching.count[0]):
        scale = touching.factor[k] * product(touching.along, k, x)
        for n in range(x.size):
            x[n] -= scale * touching.solved[k * x.size + n]


@inlined
def subtract_springs(touching: Touching, factor: Real, k1: Table, k2: Table) -> None:
    """Subtracts factor * K * k1 from k2, in place. K is time² * the stiffness matrix of the
    contacts in `touching`, k1 and k2 (6*bodies,) are the stages of the step."""
    for k in range(touching.count[0]):
        scale = factor * touching.spring[k] * product(touching.along, k, k1)
        for n in range(k2.size):
            k2[n] -= scale * touching.along[k * k2.size + n]
