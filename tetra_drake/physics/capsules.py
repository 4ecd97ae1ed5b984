"""Contact of struts: a force that pushes struts of different bodies apart where they touch.

Struts are capsules. Their gap is the distance of the nearest points of their axes, less both radii.
Where it is negative, the struts push each other along the line between these points, without
friction. The law is the one of the ground, Hunt and Crossley's; see contact.normal_force().

The nearest points of two axes jump from end to end as the axes become parallel. Real struts touch
along a line then, and the pressure moves along it within a small angle. So does the contact here:
below the angle PARALLEL it moves to the middle of the stretch where the struts are side by side.

Most struts are far from each other. Pairs that are near are found anew when a node has moved by
half the difference between `near` and the largest distance of axes that touch. The forces do not
depend on when that was, because other pairs exert none.
"""

from __future__ import annotations

import functools
import math
from typing import Annotated, NamedTuple, Self

import numpy as np

from tetra_drake.physics import kinematics
from tetra_drake.physics.contact import NormalForce, normal_force
from tetra_drake.physics.struts import (
    Axes,
    Struts,
    axes_of,
    may_be_nearer,
    midpoint,
    nearest_on_struts,
    origin,
    share,
    vector_between,
)
from tetra_drake.physics.vectors import (
    Vector,
    add_vector,
    difference,
    dot,
    scaled,
    subtract_vector,
    sum_of,
    vector_at,
)
from tetra_drake.simd.allocation import allocate
from tetra_drake.simd.compiling import compiled, inlined
from tetra_drake.simd.lanes import Real, Table, any_lane, inverse_sqrt, maximum, named

PARALLEL = 0.01
"""Angle (rad) of two struts at which their contact is halfway between the nearest points and the
middle. A strut of 0.5 m that is pressed by 0.4 mm touches along its length up to this angle."""
LEAST_SQUARE = 1e-30
"""Lower limit (m²) of squared distances, for axes that meet. The force is zero there."""


class Search(NamedTuple):
    """Distances (m) of the search for near struts."""

    near: Real
    """Distance of the axes of two struts below which the pair is near."""
    drift: Real
    """Distance that a node may move before the next search."""


class StrutContactLaw(NamedTuple):
    """Contact of the struts in the form of the kernels."""

    acts: bool
    """False if struts pass through each other."""
    normal: Table
    """Table of the numbers of NormalForce."""
    search: Table
    """Table of the numbers of Search."""


class NearStruts(NamedTuple):
    """Memory for the pairs of struts that are near. Without contact of struts it is empty."""

    p_WN: Annotated[Table, "strut_nodes", 3, math.inf]
    """Positions (nodes, 3) in m of the nodes at the latest search; infinite before the first."""
    pairs: Annotated[Table, "strut_pairs", 2, int]
    """Indices of the two struts of each near pair (pairs, 2)."""
    count: Annotated[Table, 1, int]
    """Number of near pairs."""

    @classmethod
    def of(cls, struts: Struts) -> Self:
        """Memory for the near pairs among struts."""
        return allocate(cls, near_sizes(struts))


def near_sizes(struts: Struts) -> dict[str, int]:
    """Sizes of NearStruts, for allocate()."""
    of_bodies = np.diff(struts.first_strut)
    pairs = (of_bodies.sum() ** 2 - (of_bodies**2).sum()) // 2
    return {
        "strut_nodes": int(max(struts.node_a.max(initial=-1), struts.node_b.max(initial=-1))) + 1,
        "strut_pairs": int(pairs),
    }


@functools.partial(compiled, nogil=True)  # a call of its own, as searches are rare
def find_near_struts(
    struts: Struts,
    contact: StrutContactLaw,
    radius: Table,
    state: Table,
    nodes: Table,
    near: NearStruts,
) -> None:
    """Writes the pairs of struts that are near in any lane.

    `radius` (bodies,) are radii of spheres around the bodies. `nodes` is the table of
    physics.kinematics for a `state` (13 bodies,).
    """
    limit, count = named(Search, contact.search).near, 0
    for first in range(radius.size):
        for second in range(first + 1, radius.size):
            offset = difference(origin(state, second), origin(state, first))
            if not may_be_nearer(offset, radius[first] + radius[second], limit):
                continue
            for i in range(struts.first_strut[first], struts.first_strut[first + 1]):
                for j in range(struts.first_strut[second], struts.first_strut[second + 1]):
                    if are_near(struts, nodes, i, j, limit):
                        near.pairs[count, 0], near.pairs[count, 1] = i, j
                        count += 1
    near.count[0] = count
    for node in range(near.p_WN.shape[0]):
        for axis in range(3):
            near.p_WN[node, axis] = nodes[node, kinematics.P_WN + axis]


class Touch(NamedTuple):
    """Contact of two struts."""

    s: Real
    """Place on the first axis, 0 at its start, 1 at its end."""
    t: Real
    """Place on the second axis."""
    direction: Vector
    """Unit vector from the second place to the first."""
    depth: Real
    """Depth (m) of the overlap; negative if the struts are apart."""


@inlined
def are_near(struts: Struts, nodes: Table, i: int, j: int, limit: Real) -> bool:
    """True if the axes of two struts are at most `limit` (m) apart in any lane."""
    offset = difference(midpoint(struts, nodes, i), midpoint(struts, nodes, j))
    if not may_be_nearer(offset, 0.5 * (struts.length[i] + struts.length[j]), limit):
        return False
    reach = struts.radius[i] + struts.radius[j]
    return any_lane(reach - find_touch(struts, nodes, i, j).depth <= limit)


@inlined
def have_moved(nodes: Table, near: NearStruts, drift: Real) -> bool:
    """True if a node has moved by more than `drift` (m) since the latest search, in any lane."""
    largest = 0.0 * drift
    for node in range(near.p_WN.shape[0]):
        moved = difference(vector_at(nodes, node, kinematics.P_WN), vector_at(near.p_WN, node, 0))
        largest = maximum(largest, dot(moved, moved))
    return any_lane(largest > drift * drift)


@inlined
def contact_places(axes: Axes) -> tuple[Real, Real]:
    """Places on both axes, 0 to 1, between which two struts touch.

    They are the nearest ones, unless the struts are nearly parallel.
    """
    uu_vv = axes.uu * axes.vv
    begin = share(-axes.ur / axes.uu)
    end = share((axes.uv - axes.ur) / axes.uu)
    smoothing = PARALLEL * PARALLEL * uu_vv
    nearest = axes.uv * axes.vr - axes.ur * axes.vv
    square_of_sine = uu_vv - axes.uv * axes.uv
    s = (nearest + smoothing * 0.5 * (begin + end)) / (square_of_sine + smoothing)
    return nearest_on_struts(axes, s)


@inlined
def place_on(nodes: Table, a: int, b: int, column: int, s: Real) -> Vector:
    """Vector in three columns of the table `nodes`, at the place s, 0 to 1, from node a to b."""
    at_a, at_b = vector_at(nodes, a, column), vector_at(nodes, b, column)
    return sum_of(at_a, scaled(s, difference(at_b, at_a)))


@inlined
def find_touch(struts: Struts, nodes: Table, i: int, j: int) -> Touch:
    """Place, direction and depth of the contact of struts i and j."""
    axes = axes_of(struts, nodes, i, j)
    s, t = contact_places(axes)
    between = vector_between(axes, s, t)
    square = dot(between, between)
    per_distance = inverse_sqrt(maximum(square, LEAST_SQUARE))
    depth = struts.radius[i] + struts.radius[j] - square * per_distance
    return Touch(s, t, scaled(per_distance, between), depth)


@inlined
def add_contact_force(struts: Struts, law: NormalForce, nodes: Table, i: int, j: int) -> None:
    """Adds the force between two struts to the forces on their nodes."""
    s, t, direction, depth = find_touch(struts, nodes, i, j)
    if not any_lane(depth > 0.0):
        return
    a_i, b_i, a_j, b_j = struts.node_a[i], struts.node_b[i], struts.node_a[j], struts.node_b[j]
    v_i = place_on(nodes, a_i, b_i, kinematics.V_WN, s)
    v_j = place_on(nodes, a_j, b_j, kinematics.V_WN, t)
    depth_rate = dot(difference(v_j, v_i), direction)
    force = scaled(normal_force(depth, depth_rate, law), direction)
    # A force on a rigid strut, between its nodes, has the effect of its shares on the nodes.
    add_vector(scaled(1.0 - s, force), a_i, kinematics.FORCE, nodes)
    add_vector(scaled(s, force), b_i, kinematics.FORCE, nodes)
    subtract_vector(scaled(1.0 - t, force), a_j, kinematics.FORCE, nodes)
    subtract_vector(scaled(t, force), b_j, kinematics.FORCE, nodes)
