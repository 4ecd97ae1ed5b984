"""Contact of struts: a force that pushes struts of different bodies apart where they touch.

Struts are capsules. Their gap is the distance of the nearest points of their axes, less both radii.
Where it is negative, the struts push each other along the line between these points, without
friction. The law is the one of the ground, Hunt and Crossley's; see contact.normal_force().

The nearest points of two axes jump from end to end as the axes become parallel. Real struts touch
along a line then, and the pressure moves along it within a small angle. So does the contact here:
nearly parallel struts count as slightly thicker in the middle. The distance D of two struts is

    D² = min |r + s u - t v|² + w ((s - 1/2)² + (t - 1/2)²)

over the positions s and t, 0 to 1, along the axes u and v, whose starts are r apart. With the sum
of the radii as reach, the weight w is (BARREL reach)² at the angle 0, half of it at the angle
PARALLEL, and 0 if the struts are perpendicular:

    w = (BARREL reach)² / (1 + tan² / PARALLEL²)

So D differs from the distance of the axes by at most 1 % of the reach. The force is the gradient of
an energy, k (reach - D)² / 2: without dissipation, struts keep the energy at any angle.

Most struts are far from each other. Near pairs are searched again when a node has moved by a
quarter of the difference between `near` and the largest distance of axes that touch. The forces do
not depend on the time of the search, because other pairs exert none.
"""

from __future__ import annotations

import functools
import math
from typing import Annotated, ClassVar, NamedTuple, Self

import numpy as np
from pydantic import Field

from tetra_drake.kernels.compiling import compiled, inlined
from tetra_drake.kernels.lanes import Real, Table, any_lane, inverse_sqrt, maximum, minimum, named
from tetra_drake.kernels.packed import allocate
from tetra_drake.laws import kinematics
from tetra_drake.laws.contact import NormalForce, normal_force
from tetra_drake.laws.struts import (
    Axes,
    Struts,
    axes_of,
    may_be_near,
    may_be_nearer,
    nearest_on_line,
    nearest_on_struts,
    origin,
    strut_distance,
    vector_between,
)
from tetra_drake.laws.vectors import (
    Vector3,
    add_vector,
    difference,
    dot,
    scaled,
    sum_of,
    vector_at,
)
from tetra_drake.settings.quantities import InverseSpeed, Stiffness
from tetra_drake.settings.section import Kinds, Section

PARALLEL = 0.01
"""Angle (rad) of two struts below which they count as thicker in the middle."""
BARREL = 0.2
"""Factor in the weight w that makes nearly parallel struts count as thicker in the middle. At the
ends of both struts the sum of the radii is smaller by BARREL² / 4, that is 1 %."""
LEAST_SQUARE = 1e-30
"""Lower limit (m²) of squared distances, for axes that meet. The force is zero there."""


class StrutSearch(NamedTuple):
    """Constants of the search for near struts, and limits of steps near contacts; lengths in m."""

    near: Real
    """Distance of the axes of two struts below which the pair is near."""
    drift: Real
    """Distance that a node may move before the next search."""
    passage: Real
    """Distance by which a step may carry a strut into another; see time_to_pass()."""
    lightest: Real
    """Least mass (kg) of a body."""


class StrutContactLaw(NamedTuple):
    """Arguments of the law of contact between struts, for the kernels: whether it acts, and its
    constants as arrays."""

    acts: bool = False
    """False if struts pass through each other."""
    normal: Table = np.zeros(2)
    """The fields of NormalForce as an array."""
    search: Table = np.zeros(4)
    """The fields of StrutSearch as an array."""


class NearStruts(NamedTuple):
    """List of the pairs of struts that are near each other, with the positions of the nodes when it
    was made; empty if struts pass through each other."""

    p_WN: Annotated[Table, "strut_nodes", 3, math.inf]
    """Positions (nodes, 3) in m of the nodes at the latest search; infinite before the first."""
    pairs: Annotated[Table, "strut_pairs", 2, int]
    """Indices of the two struts of each near pair (pairs, 2)."""
    count: Annotated[Table, 1, int]  # type: ignore[assignment]  # tuples have a method count()
    """Number of near pairs."""

    @classmethod
    def of(cls, struts: Struts) -> Self:
        """New list of the near pairs among struts, before the first search."""
        return allocate(cls, near_sizes(struts))


def near_sizes(struts: Struts) -> dict[str, int]:
    """Numbers of rows of the tables in NearStruts, by name, for allocate(), which makes the tables:
    "strut_nodes", up to the last node of a strut, and "strut_pairs". There is room for all pairs of
    struts of different bodies."""
    of_bodies = np.diff(struts.first_strut)
    pairs = (of_bodies.sum() ** 2 - (of_bodies**2).sum()) // 2
    return {
        "strut_nodes": int(max(struts.node_a.max(initial=-1), struts.node_b.max(initial=-1))) + 1,
        "strut_pairs": int(pairs),
    }


@functools.partial(compiled, nogil=True)  # a call of its own, as searches are rare
def find_near_struts(
    struts: Struts, limit: Real, radius: Table, state: Table, nodes: Table, near: NearStruts
) -> None:
    """Lists in `near` the pairs of struts of different bodies whose axes are at most `limit` (m)
    apart in any lane (each lane is a robot), except struts with a common joint. Also stores the
    positions of the nodes there.

    `radius` (bodies,) are radii of spheres around the bodies. `nodes` is the table of
    laws.kinematics for a `state` [q; v] (13*bodies,).
    """
    count = 0
    for first in range(radius.size):
        for second in range(first + 1, radius.size):
            offset = difference(origin(state, second), origin(state, first))
            if not may_be_nearer(offset, radius[first] + radius[second], limit):
                continue
            for i in range(struts.first_strut[first], struts.first_strut[first + 1]):
                for j in range(struts.first_strut[second], struts.first_strut[second + 1]):
                    if not may_be_near(struts, nodes, i, j, limit):
                        continue
                    if any_lane(strut_distance(struts, nodes, i, j) <= limit):
                        near.pairs[count, 0], near.pairs[count, 1] = i, j
                        count += 1
    near.count[0] = count
    for node in range(near.p_WN.shape[0]):
        for axis in range(3):
            near.p_WN[node, axis] = nodes[node, kinematics.P_WN + axis]


class Touch(NamedTuple):
    """Geometry of a contact of two struts: its position on both axes, its depth, and how the depth
    changes as the ends move."""

    s: Real
    """Position of the contact along the first axis: 0 at its start, 1 at its end."""
    t: Real
    """Position along the second axis."""
    depth: Real
    """Depth (m) of the overlap; negative if the struts are apart."""
    gradient: tuple[Vector3, Vector3, Vector3, Vector3]
    """Derivatives of the distance by the positions of the ends: start and end of the first axis,
    then of the second."""


@inlined
def time_to_pass(
    struts: Struts, law: StrutContactLaw, nodes: Table, near: NearStruts, horizon: Real
) -> Real:
    """Longest step (s), at most `horizon` (s), that cannot carry a strut through another.

    The step also ends before the next collision begins, unless it is short compared with the
    collision. `nodes` has the nodes' positions and velocities. `near` has the near pairs; the
    forces must have been computed for the same `nodes`, because add_strut_forces() updates `near`.

    Struts approach at most by the largest difference of the nodes' velocities. Two struts of a near
    pair may move by their gap and by the distance `passage` of StrutSearch, by which struts may
    overlap. Struts of other pairs are apart by at least half of the difference of `near` in
    StrutSearch and the largest distance of axes that touch. This bound does not depend on the time
    of the latest search. So the motion of a robot does not depend on the robots in other lanes.
    """
    if not law.acts:
        return horizon
    search, normal = named(StrutSearch, law.search), named(NormalForce, law.normal)
    # A bar that is hit at its end gives way like a quarter of its mass, two bars like an eighth.
    brief = math.sqrt(0.125 * search.lightest / normal.stiffness)
    square, beyond = 0.0, 2.0 * search.drift
    for axis in range(kinematics.V_WN, kinematics.V_WN + 3):
        least = most = nodes[0, axis]
        for node in range(1, near.p_WN.shape[0]):
            least, most = minimum(nodes[node, axis], least), maximum(nodes[node, axis], most)
        square += (most - least) * (most - least)
    per_speed = inverse_sqrt(maximum(square, LEAST_SQUARE))
    time, gap = minimum(horizon, maximum(beyond * per_speed, brief)), beyond
    for k in range(near.count[0]):
        i, j = near.pairs[k, 0], near.pairs[k, 1]
        touch = find_touch(struts, nodes, i, j)
        rate = maximum(depth_rate(struts, nodes, i, j, touch), LEAST_SQUARE)
        time = minimum(time, maximum(abs(touch.depth) / rate, brief))
        gap = minimum(-touch.depth, gap)
    return minimum(time, (maximum(gap, 0.0) + search.passage) * per_speed)


@inlined
def barrel(axes: Axes, reach: Real) -> tuple[Real, Real, Real]:
    """Weight w (m²) that makes nearly parallel struts count as thicker in the middle, and its first
    and second derivative with respect to uv, the scalar product of the axes.

    The weight is (BARREL reach)² for parallel struts and 0 for perpendicular ones; see
    laws.capsules. `reach` (m) is the sum of the radii.
    """
    most = (PARALLEL * BARREL * reach) * (PARALLEL * BARREL * reach)
    uu_vv, flat = axes.uu * axes.vv, (1.0 - PARALLEL * PARALLEL) * axes.uv * axes.uv
    square = uu_vv - flat
    slope = 2.0 * most * uu_vv / (square * square)
    return most * axes.uv * axes.uv / square, slope * axes.uv, slope * (1.0 + 4.0 * flat / square)


@inlined
def find_touch(struts: Struts, nodes: Table, i: int, j: int) -> Touch:
    """Position, depth and gradient of the contact of struts i and j; see Touch. The depth is
    negative if they are apart. `nodes` is the table with the positions of the nodes."""
    axes, reach = axes_of(struts, nodes, i, j), struts.radius[i] + struts.radius[j]
    weight, weight_rate, _ = barrel(axes, reach)
    half, uu, vv = 0.5 * weight, axes.uu + weight, axes.vv + weight
    thicker = Axes(axes.u, axes.v, axes.r, uu, vv, axes.uv, axes.ur - half, axes.vr + half)
    s, t = nearest_on_struts(thicker, nearest_on_line(thicker))
    between = vector_between(axes, s, t)
    off_middle = (s - 0.5) * (s - 0.5) + (t - 0.5) * (t - 0.5)
    square = dot(between, between) + weight * off_middle
    per_distance = inverse_sqrt(maximum(square, LEAST_SQUARE))
    direction = scaled(per_distance, between)
    turn = 0.5 * off_middle * weight_rate * per_distance
    by_u = sum_of(scaled(s, direction), scaled(turn, axes.v))
    by_v = difference(scaled(turn, axes.u), scaled(t, direction))
    starts = difference(direction, by_u), scaled(-1.0, sum_of(direction, by_v))
    return Touch(s, t, reach - square * per_distance, (starts[0], by_u, starts[1], by_v))


@inlined
def add_contact_force(struts: Struts, law: NormalForce, nodes: Table, i: int, j: int) -> None:
    """Adds the force between struts i and j, if they touch, to the forces on their nodes, in
    `nodes`, which has the nodes' positions and velocities. `law` has the constants of the force."""
    touch = find_touch(struts, nodes, i, j)
    if not any_lane(touch.depth > 0.0):
        return
    force = normal_force(touch.depth, depth_rate(struts, nodes, i, j, touch), law)
    push_ends(struts, nodes, i, j, touch, force)


@inlined
def push_ends(struts: Struts, nodes: Table, i: int, j: int, touch: Touch, force: Real) -> None:
    """Adds a force (N) that pushes struts i and j apart to the forces on their nodes, in `nodes`. A
    positive `force` pushes. The gradient of `touch` says how the ends share it."""
    start_i, end_i, start_j, end_j = touch.gradient
    add_vector(scaled(force, start_i), struts.node_a[i], kinematics.FORCE, nodes)
    add_vector(scaled(force, end_i), struts.node_b[i], kinematics.FORCE, nodes)
    add_vector(scaled(force, start_j), struts.node_a[j], kinematics.FORCE, nodes)
    add_vector(scaled(force, end_j), struts.node_b[j], kinematics.FORCE, nodes)


@inlined
def depth_rate(struts: Struts, nodes: Table, i: int, j: int, touch: Touch) -> Real:
    """Rate (m/s) of the depth of the contact `touch` of struts i and j, positive as they approach.
    `nodes` has the velocities of their ends."""
    start_i, end_i, start_j, end_j = touch.gradient
    rate_i = dot(start_i, vector_at(nodes, struts.node_a[i], kinematics.V_WN))
    rate_i += dot(end_i, vector_at(nodes, struts.node_b[i], kinematics.V_WN))
    rate_j = dot(start_j, vector_at(nodes, struts.node_a[j], kinematics.V_WN))
    rate_j += dot(end_j, vector_at(nodes, struts.node_b[j], kinematics.V_WN))
    return -(rate_i + rate_j)


class NoStrutContact(Section):
    """No contact of struts: they pass through each other, as in the thesis."""

    tag: ClassVar[str] = "Nothing"

    def law(self, search: StrutSearch) -> StrutContactLaw:
        """Law for the kernels that exerts no force. `search` has the constants of the search for
        near struts; it is stored but has no effect."""
        return StrutContactLaw(search=np.array(search))


class HuntCrossley(Section):
    """Contact of struts as capsules with the struts' radii, without friction. The force at a depth
    d of the overlap, with the rate d', is F = k d (1 + c d'); see laws.capsules."""

    stiffness: Stiffness = Field(gt=0)
    """Stiffness k of the overlap."""
    dissipation: InverseSpeed = Field(ge=0)
    """Hunt-Crossley dissipation c, as in Drake. An impact at a low speed v has the restitution 1 -
    2/3 c v."""

    def law(self, search: StrutSearch) -> StrutContactLaw:
        """Law for the kernels, with these settings as constants. `search` has the constants of the
        search for near struts."""
        normal = NormalForce(self.stiffness, damping=self.stiffness * self.dissipation)
        return StrutContactLaw(acts=True, normal=np.array(normal), search=np.array(search))


StrutContactKind = Annotated[NoStrutContact | HuntCrossley, Kinds()]
