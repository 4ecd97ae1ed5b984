"""The clearance of struts: the least distance between the axes of those of different bodies."""

from __future__ import annotations

from tetra_drake.physics.kinematics import P_WN
from tetra_drake.physics.vectors import Vector, difference, dot, vector_at
from tetra_drake.simd.compiling import inlined
from tetra_drake.simd.lanes import Real, Table, any_lane, maximum, minimum

CORNERS = 4
"""The nodes of a tetrahedron: three of the base, then the tip."""

_MARGIN = 1.0 + 1e-9
"""So that what is rounded decides nothing where a bound equals a distance."""

_PARALLEL = 1e-12
"""Square of the sine of an angle that is none."""


@inlined
def least_strut_distance(nodes: Table, least: Real) -> Real:
    """Square of the least distance (m²) between struts of different tetrahedra, or `least` if that
    is less; `nodes` of physics.kinematics.

    A pair of tetrahedra is split into tip and base struts of the first with all struts of the
    second. Where a plane across the line between their centres has the two on its sides, with more
    room than `least`, no distance is computed.
    """
    strut = difference(vector_at(nodes, 1, P_WN), vector_at(nodes, 0, P_WN))
    per_square = 1.0 / dot(strut, strut)  # all struts are alike
    for first in range(0, nodes.shape[0], CORNERS):
        for second in range(first + CORNERS, nodes.shape[0], CORNERS):
            base, tip, square = room_between(nodes, first, second)
            bound = _MARGIN * least * square
            if any_lane((tip <= 0.0) | (tip * tip <= bound)):
                for a in range(first, first + 3):
                    least = minimum(least, nearest_strut(nodes, a, first + 3, second, per_square))
            if any_lane((base <= 0.0) | (base * base <= bound)):
                for k in range(3):
                    a, b = first + k, first + (k + 1) % 3
                    least = minimum(least, nearest_strut(nodes, a, b, second, per_square))
    return least


@inlined
def room_between(nodes: Table, first: int, second: int) -> tuple[Real, Real, Real]:
    """Distances along the vector between two centres, times its length, at which the second
    tetrahedron begins behind the base, and behind all nodes, of the first; and its square."""
    u_x = u_y = u_z = 0.0
    for k in range(CORNERS):
        p = difference(vector_at(nodes, second + k, P_WN), vector_at(nodes, first + k, P_WN))
        u_x += p[0]
        u_y += p[1]
        u_z += p[2]
    u = u_x, u_y, u_z
    begin, base = along(nodes, second, u), along(nodes, first, u)
    for k in range(1, 3):
        begin = minimum(begin, along(nodes, second + k, u))
        base = maximum(base, along(nodes, first + k, u))
    begin = minimum(begin, along(nodes, second + 3, u))
    tip = maximum(base, along(nodes, first + 3, u))
    return begin - base, begin - tip, dot(u, u)


@inlined
def along(nodes: Table, node: int, u: Vector) -> Real:
    """The product of a node's position and a vector."""
    return dot(u, vector_at(nodes, node, P_WN))


@inlined
def nearest_strut(nodes: Table, a: int, b: int, second: int, per_square: Real) -> Real:
    """Square of the least distance (m²) of the strut from node a to b to those of the tetrahedron
    that begins with node `second`; see segment_distance."""
    least = segment_distance(nodes, a, b, second, second + 1, per_square)
    for c in range(second, second + 2):
        for d in range(second + 2, second + 4):
            least = minimum(least, segment_distance(nodes, a, b, c, d, per_square))
    return minimum(least, segment_distance(nodes, a, b, second + 2, second + 3, per_square))


@inlined
def segment_distance(nodes: Table, a: int, b: int, c: int, d: int, per_square: Real) -> Real:
    """Square of the distance (m²) between the segments from node a to b and from c to d, which have
    the same length; `per_square` is 1 over its square.

    The nearest points of the lines; where one is beyond its segment, the end there, and what is
    nearest to that (C. Ericson, Real-Time Collision Detection, 2005, section 5.1.9).
    """
    u = difference(vector_at(nodes, b, P_WN), vector_at(nodes, a, P_WN))
    v = difference(vector_at(nodes, d, P_WN), vector_at(nodes, c, P_WN))
    r = difference(vector_at(nodes, a, P_WN), vector_at(nodes, c, P_WN))
    # Products of u, v and r, in lengths of u and v.
    uv, ur, vr = per_square * dot(u, v), per_square * dot(u, r), per_square * dot(v, r)
    s = share((uv * vr - ur) / maximum(1.0 - uv * uv, _PARALLEL))
    t = share(uv * s + vr)
    s = share(uv * t - ur)
    apart = (
        r[0] + s * u[0] - t * v[0],
        r[1] + s * u[1] - t * v[1],
        r[2] + s * u[2] - t * v[2],
    )
    return dot(apart, apart)


@inlined
def share(x: Real) -> Real:
    """The nearest number from 0 to 1."""
    return minimum(maximum(x, 0.0), 1.0)
