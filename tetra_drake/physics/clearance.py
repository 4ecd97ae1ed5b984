"""Clearance: the least distance between the axes of struts of different bodies."""

from __future__ import annotations

import math
from typing import NamedTuple

from tetra_drake.physics.kinematics import P_WN
from tetra_drake.physics.vectors import Vector, difference, dot, vector_at
from tetra_drake.simd.compiling import inlined
from tetra_drake.simd.lanes import Real, Table, any_lane, maximum, minimum

_MARGIN = 1.0 + 1e-9
"""Factor on bounds, so that rounding errors cannot exclude a pair whose distance equals a bound."""
_PARALLEL = 1e-12
"""Squared sine of the angle below which two struts count as parallel."""


class Struts(NamedTuple):
    """Struts of all bodies, in the order of the bodies."""

    node_a: Table
    """Index of the node at one end (struts,)."""
    node_b: Table
    """Index of the node at the other end (struts,)."""
    first_strut: Table
    """Index of each body's first strut (bodies + 1,); the last number is the number of struts."""
    length: Table
    """Lengths (struts,) in m."""


@inlined
def least_strut_distance(
    struts: Struts, radius: Table, first_node: Table, state: Table, nodes: Table, least: Real
) -> Real:
    """Least distance (m) between struts of different bodies, or `least` if it is smaller.

    `radius` (bodies,) are radii of spheres around the bodies. `nodes` is the table of
    physics.kinematics for a `state` (13 bodies,). `first_node` is Model.first_node.
    """
    for first in range(radius.size):
        for second in range(first + 1, radius.size):
            offset = difference(origin(state, second), origin(state, first))
            if may_be_nearer(offset, radius[first] + radius[second], least):
                least = nearest_struts(struts, first_node, nodes, first, second, offset, least)
    return least


@inlined
def nearest_struts(
    struts: Struts,
    first_node: Table,
    nodes: Table,
    first: int,
    second: int,
    offset: Vector,
    least: Real,
) -> Real:
    """Least distance (m) between struts of two bodies, or `least` if it is smaller.

    `offset` is the vector between the origins of the bodies. Along this vector, a strut of the
    first body may end more than `least` before the second body begins. Such a strut is skipped.
    """
    begin = dot(offset, vector_at(nodes, first_node[second], P_WN))
    for node in range(first_node[second] + 1, first_node[second + 1]):
        begin = minimum(begin, dot(offset, vector_at(nodes, node, P_WN)))
    length = math.sqrt(dot(offset, offset))
    for a in range(struts.first_strut[first], struts.first_strut[first + 1]):
        end_a = dot(offset, vector_at(nodes, struts.node_a[a], P_WN))
        end_b = dot(offset, vector_at(nodes, struts.node_b[a], P_WN))
        if any_lane(begin - maximum(end_a, end_b) <= _MARGIN * least * length):
            least = nearest_strut(struts, nodes, a, second, least)
    return least


@inlined
def origin(state: Table, body: int) -> Vector:
    """Position of a body's origin (m)."""
    return state[7 * body + 4], state[7 * body + 5], state[7 * body + 6]


@inlined
def may_be_nearer(offset: Vector, reach: Real, least: Real) -> bool:
    """False if two parts are certainly farther from each other than `least`, in all lanes.

    `offset` is the vector between the centres of the parts, `reach` (m) the sum of their radii.
    """
    bound = reach + least
    return any_lane(dot(offset, offset) <= _MARGIN * bound * bound)


@inlined
def nearest_strut(struts: Struts, nodes: Table, a: int, body: int, least: Real) -> Real:
    """Least distance (m) from a strut to the struts of a body, or `least` if it is smaller."""
    midpoint_a = midpoint(struts, nodes, a)
    for b in range(struts.first_strut[body], struts.first_strut[body + 1]):
        offset = difference(midpoint_a, midpoint(struts, nodes, b))
        if may_be_nearer(offset, 0.5 * (struts.length[a] + struts.length[b]), least):
            least = minimum(least, strut_distance(struts, nodes, a, b))
    return least


@inlined
def midpoint(struts: Struts, nodes: Table, i: int) -> Vector:
    """Midpoint of a strut (m)."""
    a_x, a_y, a_z = vector_at(nodes, struts.node_a[i], P_WN)
    b_x, b_y, b_z = vector_at(nodes, struts.node_b[i], P_WN)
    return 0.5 * (a_x + b_x), 0.5 * (a_y + b_y), 0.5 * (a_z + b_z)


@inlined
def strut_distance(struts: Struts, nodes: Table, i: int, j: int) -> Real:
    """Distance (m) between two struts (C. Ericson, Real-Time Collision Detection, 2005, section
    5.1.9).

    It is the distance between the nearest points of the two lines. If a point is beyond the end of
    its strut, the end is used, and the point of the other strut that is nearest to it.
    """
    start_i = vector_at(nodes, struts.node_a[i], P_WN)
    start_j = vector_at(nodes, struts.node_a[j], P_WN)
    u = difference(vector_at(nodes, struts.node_b[i], P_WN), start_i)
    v = difference(vector_at(nodes, struts.node_b[j], P_WN), start_j)
    r = difference(start_i, start_j)
    uu, vv = struts.length[i] * struts.length[i], struts.length[j] * struts.length[j]
    uv, ur, vr = dot(u, v), dot(u, r), dot(v, r)
    s = share((uv * vr - ur * vv) / maximum(uu * vv - uv * uv, _PARALLEL * uu * vv))
    t = share((uv * s + vr) / vv)
    s = share((uv * t - ur) / uu)
    between = (
        r[0] + s * u[0] - t * v[0],
        r[1] + s * u[1] - t * v[1],
        r[2] + s * u[2] - t * v[2],
    )
    return math.sqrt(dot(between, between))


@inlined
def share(x: Real) -> Real:
    """Clamps a number to the range from 0 to 1."""
    return minimum(maximum(x, 0.0), 1.0)
