"""Struts, the nearest points of two struts, and the clearance of a robot.

The *clearance* is the least distance between the axes of struts of different bodies.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tetra_drake.kernels.compiling import inlined
from tetra_drake.kernels.lanes import Real, Table, any_lane, maximum, minimum
from tetra_drake.laws.kinematics import P_WN
from tetra_drake.laws.vectors import (
    NO_INDICES,
    NO_NUMBERS,
    Vector3,
    difference,
    dot,
    scaled,
    sum_of,
    vector_at,
)

MARGIN = 1.0 + 1e-9
"""Factor on bounds, so that rounding errors cannot exclude a pair whose distance equals a bound."""
_PARALLEL = 1e-12
"""Squared sine of the angle below which the axes of two struts count as parallel."""


class Struts(NamedTuple):
    """Struts of all bodies, in the order of the bodies."""

    node_a: Table = NO_INDICES
    """Index of the node at one end (struts,)."""
    node_b: Table = NO_INDICES
    """Index of the node at the other end (struts,)."""
    place_a: Table = NO_INDICES
    """Number of the place of node a (struts,). Nodes that joints hold together have one place."""
    place_b: Table = NO_INDICES
    """Number of the place of node b (struts,)."""
    first_strut: Table = np.zeros(1, np.int64)
    """Index of each body's first strut (bodies + 1,); the last number is the number of struts."""
    length: Table = NO_NUMBERS
    """Lengths (struts,) in m."""
    radius: Table = NO_NUMBERS
    """Radii (struts,) in m."""


class Axes(NamedTuple):
    """Geometry of two struts, in m: vectors u and v from start to end of their axes, vector r from
    the start of the second to the start of the first, and scalar products of these vectors, such as
    uv = u . v."""

    u: Vector3
    v: Vector3
    r: Vector3
    uu: Real
    vv: Real
    uv: Real
    ur: Real
    vr: Real


@inlined
def axes_of(struts: Struts, nodes: Table, i: int, j: int) -> Axes:
    """Geometry of struts i and j; see Axes. `nodes` is the table with the positions of the nodes;
    see laws.kinematics."""
    start_i = vector_at(nodes, struts.node_a[i], P_WN)
    start_j = vector_at(nodes, struts.node_a[j], P_WN)
    u = difference(vector_at(nodes, struts.node_b[i], P_WN), start_i)
    v = difference(vector_at(nodes, struts.node_b[j], P_WN), start_j)
    r = difference(start_i, start_j)
    uu, vv = struts.length[i] * struts.length[i], struts.length[j] * struts.length[j]
    return Axes(u, v, r, uu, vv, uv=dot(u, v), ur=dot(u, r), vr=dot(v, r))


@inlined
def nearest_on_line(axes: Axes) -> Real:
    """Position along the first axis that is nearest to the line of the second: 0 at its start, 1 at
    its end (C. Ericson, Real-Time Collision Detection, 2005, section 5.1.9). Both axes count as
    endless lines, so the result may be below 0 or above 1."""
    uu_vv = axes.uu * axes.vv
    square_of_sine = maximum(uu_vv - axes.uv * axes.uv, _PARALLEL * uu_vv)
    return (axes.uv * axes.vr - axes.ur * axes.vv) / square_of_sine


@inlined
def nearest_on_struts(axes: Axes, s: Real) -> tuple[Real, Real]:
    """Positions along both axes that are nearest to each other, first of the first axis, then of
    the second: 0 at the start of an axis, 1 at its end.

    The argument `s` is the result of nearest_on_line(). If a position is beyond the end of its
    strut, the end is used, and the point of the other strut that is nearest to it.
    """
    t = share((axes.uv * share(s) + axes.vr) / axes.vv)
    return share((axes.uv * t - axes.ur) / axes.uu), t


@inlined
def vector_between(axes: Axes, s: Real, t: Real) -> Vector3:
    """Vector (m) from position t along the second axis to position s along the first. Positions are
    0 at the start of an axis and 1 at its end."""
    return difference(sum_of(axes.r, scaled(s, axes.u)), scaled(t, axes.v))


@inlined
def strut_distance(struts: Struts, nodes: Table, i: int, j: int) -> Real:
    """Distance (m) between the axes of struts i and j, from end to end. `nodes` is the table with
    the positions of the nodes; see laws.kinematics."""
    axes = axes_of(struts, nodes, i, j)
    s, t = nearest_on_struts(axes, nearest_on_line(axes))
    between = vector_between(axes, s, t)
    return math.sqrt(dot(between, between))


@inlined
def are_joined(struts: Struts, i: int, j: int) -> bool:
    """True if a joint holds ends of struts i and j together, so that they cannot be apart."""
    a, b = struts.place_a[i], struts.place_b[i]
    return (
        a == struts.place_a[j]
        or a == struts.place_b[j]
        or (b == struts.place_a[j] or b == struts.place_b[j])
    )


@inlined
def share(x: Real) -> Real:
    """Clamps a number to the range from 0 to 1."""
    return minimum(maximum(x, 0.0), 1.0)


@inlined
def origin(state: Table, body: int) -> Vector3:
    """Position (m) of a body's origin in the world. `state` is [q; v] of all bodies
    (13*bodies,)."""
    return state[7 * body + 4], state[7 * body + 5], state[7 * body + 6]


@inlined
def midpoint(struts: Struts, nodes: Table, i: int) -> Vector3:
    """Midpoint (m) of strut i in the world. `nodes` is the table with the positions of the
    nodes."""
    p_WA, p_WB = vector_at(nodes, struts.node_a[i], P_WN), vector_at(nodes, struts.node_b[i], P_WN)
    return scaled(0.5, sum_of(p_WA, p_WB))


@inlined
def may_be_nearer(offset: Vector3, reach: Real, least: Real) -> bool:
    """Quick test of two bodies or struts: False if they are surely farther apart than `least` (m).

    `offset` is the vector between their centres, `reach` (m) the sum of the radii of spheres around
    them. In SIMD lanes, one robot per lane, the result is True if they may be nearer in any lane.
    """
    bound = reach + least
    return any_lane(dot(offset, offset) <= MARGIN * bound * bound)


@inlined
def may_be_near(struts: Struts, nodes: Table, i: int, j: int, least: Real) -> bool:
    """Quick test of two struts: False if a joint holds them together, or their axes are surely
    farther apart than `least` (m) in all lanes. `nodes` is the table with the positions of the
    nodes."""
    apart = difference(midpoint(struts, nodes, i), midpoint(struts, nodes, j))
    reach = 0.5 * (struts.length[i] + struts.length[j])
    return may_be_nearer(apart, reach, least) and not are_joined(struts, i, j)


@inlined
def least_strut_distance(
    struts: Struts, radius: Table, first_node: Table, state: Table, nodes: Table, least: Real
) -> Real:
    """Least distance (m) between the axes of struts of different bodies, or `least` (m) if that is
    smaller. Struts with a common joint do not count.

    `radius` (bodies,) are radii of spheres around the bodies. `first_node` is the index of each
    body's first node (bodies + 1,); the last number is the index of the first fixed node. `state`
    is [q; v] (13*bodies,), `nodes` the table of laws.kinematics for this state.
    """
    for first in range(radius.size):
        for second in range(first + 1, radius.size):
            offset = difference(origin(state, second), origin(state, first))
            if not may_be_nearer(offset, radius[first] + radius[second], least):
                continue
            begin = dot(offset, vector_at(nodes, first_node[second], P_WN))
            for node in range(first_node[second] + 1, first_node[second + 1]):
                begin = minimum(begin, dot(offset, vector_at(nodes, node, P_WN)))
            length = math.sqrt(dot(offset, offset))
            for a in range(struts.first_strut[first], struts.first_strut[first + 1]):
                end_a = dot(offset, vector_at(nodes, struts.node_a[a], P_WN))
                end_b = dot(offset, vector_at(nodes, struts.node_b[a], P_WN))
                # Along the offset, the strut may end long before the second body begins.
                if not any_lane(begin - maximum(end_a, end_b) <= MARGIN * least * length):
                    continue
                for b in range(struts.first_strut[second], struts.first_strut[second + 1]):
                    if may_be_near(struts, nodes, a, b, least):
                        least = minimum(least, strut_distance(struts, nodes, a, b))
    return least
