"""Clearance: the least distance between the axes of struts of different bodies."""

from __future__ import annotations

import math

from tetra_drake.kernels.compiling import inlined
from tetra_drake.kernels.lanes import Real, Table, any_lane, maximum, minimum
from tetra_drake.laws.kinematics import P_WN
from tetra_drake.laws.struts import (
    MARGIN,
    Struts,
    may_be_nearer,
    midpoint,
    origin,
    strut_distance,
)
from tetra_drake.laws.vectors import Vector3, difference, dot, vector_at


@inlined
def least_strut_distance(
    struts: Struts, radius: Table, first_node: Table, state: Table, nodes: Table, least: Real
) -> Real:
    """Least distance (m) between struts of different bodies, or `least` if it is smaller.

    `radius` (bodies,) are radii of spheres around the bodies. `nodes` is the table of
    laws.kinematics for a `state` (13 bodies,). `first_node` is Model.first_node.
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
    offset: Vector3,
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
        if any_lane(begin - maximum(end_a, end_b) <= MARGIN * least * length):
            least = nearest_strut(struts, nodes, a, second, least)
    return least


@inlined
def nearest_strut(struts: Struts, nodes: Table, a: int, body: int, least: Real) -> Real:
    """Least distance (m) from a strut to the struts of a body, or `least` if it is smaller."""
    midpoint_a = midpoint(struts, nodes, a)
    for b in range(struts.first_strut[body], struts.first_strut[body + 1]):
        offset = difference(midpoint_a, midpoint(struts, nodes, b))
        if may_be_nearer(offset, 0.5 * (struts.length[a] + struts.length[b]), least):
            least = minimum(least, strut_distance(struts, nodes, a, b))
    return least
