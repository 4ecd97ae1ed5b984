"""The clearance of struts: the least distance between the axes of those of different bodies."""

from __future__ import annotations

import math
from typing import NamedTuple

from tetra_drake.physics.kinematics import P_WN
from tetra_drake.physics.vectors import Vector, difference, dot, vector_at
from tetra_drake.simd.compiling import inlined
from tetra_drake.simd.lanes import Real, Table, any_lane, maximum, minimum

_MARGIN = 1.0 + 1e-9
"""So that what is rounded decides nothing where a bound equals a distance."""

_PARALLEL = 1e-12
"""Square of the sine of an angle that is none."""


class Struts(NamedTuple):
    """The struts of all bodies, body by body."""

    node_a: Table
    """(struts,): the index of the node at one end."""
    node_b: Table
    """(struts,): and of that at the other."""
    first_strut: Table
    """(bodies + 1,): the index of each body's first strut, and the number of struts."""
    length: Table
    """(struts,): in m."""


@inlined
def least_strut_distance(
    struts: Struts, radius: Table, first_node: Table, state: Table, nodes: Table, least: Real
) -> Real:
    """The least distance (m) between struts of different bodies, or `least` if that is less.

    `radius`, (bodies,), is that of the spheres in which the bodies are; `nodes` those of
    physics.kinematics at a state (13 bodies,), and `first_node` as in Model.
    """
    for first in range(radius.size):
        for second in range(first + 1, radius.size):
            apart = difference(origin(state, second), origin(state, first))
            if may_be_nearer(apart, radius[first] + radius[second], least):
                least = nearest_struts(struts, first_node, nodes, first, second, apart, least)
    return least


@inlined
def nearest_struts(
    struts: Struts,
    first_node: Table,
    nodes: Table,
    first: int,
    second: int,
    apart: Vector,
    least: Real,
) -> Real:
    """The least distance (m) between struts of two bodies, whose origins are `apart`, or `least`.

    Struts of the first body that a plane across the line between the origins parts from the second
    one, with more room than `least`, are left out.
    """
    begin = dot(apart, vector_at(nodes, first_node[second], P_WN))
    for node in range(first_node[second] + 1, first_node[second + 1]):
        begin = minimum(begin, dot(apart, vector_at(nodes, node, P_WN)))
    length = math.sqrt(dot(apart, apart))
    for a in range(struts.first_strut[first], struts.first_strut[first + 1]):
        end_a = dot(apart, vector_at(nodes, struts.node_a[a], P_WN))
        end_b = dot(apart, vector_at(nodes, struts.node_b[a], P_WN))
        if any_lane(begin - maximum(end_a, end_b) <= _MARGIN * least * length):
            least = nearest_strut(struts, nodes, a, second, least)
    return least


@inlined
def origin(state: Table, body: int) -> Vector:
    """The position of a body's origin (m)."""
    return state[7 * body + 4], state[7 * body + 5], state[7 * body + 6]


@inlined
def may_be_nearer(apart: Vector, reach: Real, least: Real) -> bool:
    """True unless what reaches so far (m) from two points that are `apart` is surely farther away
    from each other than `least`, in all lanes."""
    bound = reach + least
    return any_lane(dot(apart, apart) <= _MARGIN * bound * bound)


@inlined
def nearest_strut(struts: Struts, nodes: Table, a: int, body: int, least: Real) -> Real:
    """The least distance (m) of a strut to those of a body, or `least` if that is less."""
    midpoint_a = midpoint(struts, nodes, a)
    for b in range(struts.first_strut[body], struts.first_strut[body + 1]):
        apart = difference(midpoint_a, midpoint(struts, nodes, b))
        if may_be_nearer(apart, 0.5 * (struts.length[a] + struts.length[b]), least):
            least = minimum(least, strut_distance(struts, nodes, a, b))
    return least


@inlined
def midpoint(struts: Struts, nodes: Table, i: int) -> Vector:
    """The midpoint of a strut (m)."""
    a_x, a_y, a_z = vector_at(nodes, struts.node_a[i], P_WN)
    b_x, b_y, b_z = vector_at(nodes, struts.node_b[i], P_WN)
    return 0.5 * (a_x + b_x), 0.5 * (a_y + b_y), 0.5 * (a_z + b_z)


@inlined
def strut_distance(struts: Struts, nodes: Table, i: int, j: int) -> Real:
    """The distance (m) between two struts.

    The nearest points of the lines; where one is beyond its strut, the end there, and what is
    nearest to that (C. Ericson, Real-Time Collision Detection, 2005, section 5.1.9).
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
    apart = (
        r[0] + s * u[0] - t * v[0],
        r[1] + s * u[1] - t * v[1],
        r[2] + s * u[2] - t * v[2],
    )
    return math.sqrt(dot(apart, apart))


@inlined
def share(x: Real) -> Real:
    """The nearest number from 0 to 1."""
    return minimum(maximum(x, 0.0), 1.0)
