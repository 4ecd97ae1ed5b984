"""Ground contact: normal force (Eq. 1), friction, and the modes of contact nodes.

A contact node touches the ground with a sphere about it, its *foot*. The ground acts on the foot's
lowest point, along the normal of the surface. So friction has a lever about the node. A foot
without radius is the node itself, as in the thesis. On uneven ground, the lowest point of a round
foot is the one that is deepest in the ground, so that normal forces have a potential energy; see
`terrain`.

The bristle's deflection is the distance by which the material at the lowest point has slid, not the
distance by which the point has moved: a foot that rolls does not bend its bristle. Within a step,
the deflection is the distance of the node from the stick point, plus what the foot has turned along
the ground since the beginning of the step. At the end of a step, the stick point moves so that the
deflection stays.

The state of a contact node is a row of the table `modes` (contacts, 12):

- contact: 1 if the node touches the ground, otherwise 0
- friction mode along the tangents t1 and t2; see `friction`
- stick point: the point in the world where the bristle deflection is zero
- heading of the node's body at touchdown
- orientation of the node's body at the beginning of the step; used only by round feet

The laws use the frames of `terrain`. On flat ground these are the axes of the world.
"""

from __future__ import annotations

import functools
from typing import Annotated, Any, NamedTuple, Self

import numpy as np
from pydantic import Field

from tetra_drake.kernels.compiling import compiled, inlined
from tetra_drake.kernels.lanes import (
    Real,
    Table,
    Truth,
    any_lane,
    inverse_sqrt,
    maximum,
    named,
    not_,
    select,
)
from tetra_drake.laws import friction, kinematics, terrain
from tetra_drake.laws.vectors import (
    NO_INDICES,
    NO_NUMBERS,
    cross,
    difference,
    put_vector,
    sum_of,
    vector_at,
)
from tetra_drake.settings.quantities import DampingPerLength, Stiffness
from tetra_drake.settings.section import Section, Varied

CONTACT, MODE, STICK_POINT, HEADING, ORIENTATION, MODE_COLUMNS = 0, 1, 3, 6, 8, 12
"""Columns of the table `modes`, and their number: contact (0 or 1), friction mode (along t1, t2),
stick point (x, y, z) in m, heading (along t1, t2), orientation (inverse quaternion, w first)."""

FRICTION_1, FRICTION_2, NORMAL, GROUND_FORCE_COLUMNS = range(4)
"""Columns of the table `ground_forces` (contacts, 3), and their number: friction along t1 and t2,
normal force (N)."""


class GroundSection(Section):
    """Stiffness and damping of the ground, which give the normal force (Table 1 of the thesis)."""

    stiffness: Annotated[Stiffness, Varied()] = Field(gt=0)
    """Normal force divided by the depth of a node in the ground."""
    damping: Annotated[DampingPerLength, Varied()] = Field(ge=0)
    """Damping of the ground: lambda = 3/2 alpha stiffness. An impact at the speed v has the
    restitution 1 - alpha v (Eq. 2)."""


class NormalForce(NamedTuple):
    """Constants of the law of the normal force (Table 1 of the thesis): stiffness in N/m, damping
    in N s/m²."""

    stiffness: Real
    damping: Real


class Ground(NamedTuple):
    """Ground as an argument of kernels: its laws and surface, and the nodes that may touch it
    (contact nodes) with the spheres about them (feet). By default no node touches it."""

    contacts: Table = NO_INDICES
    """Rows (contacts,) of the table `nodes` on which the ground acts. The row of a foot without
    radius is its contact node. The rows of round feet are their lowest points, after all nodes."""
    centres: Table = NO_INDICES
    """Indices of the contact nodes (contacts,), which are the centres of the feet."""
    radius: Table = NO_NUMBERS
    """Radii of the feet (contacts,)."""
    carriers: Table = NO_INDICES
    """Index of the body of each contact node (contacts,), ascending."""
    is_round: bool = False
    """True if at least one foot has a radius."""
    normal: Table = np.zeros(2)
    """The fields of NormalForce as an array."""
    friction: friction.FrictionLaw = friction.FrictionLaw(0, np.zeros(1))
    flat: bool = True
    grid: Table = np.zeros(len(terrain.SurfaceGrid._fields))
    """The fields of terrain.SurfaceGrid as an array."""
    heights: Any = NO_NUMBERS
    """Heights (points,) of the surface's control points in m, row by row, then of rolled surfaces.
    None in lanes, which share one table of heights."""
    rolled: Table = np.zeros((0, len(terrain.SurfaceGrid._fields)))
    """The fields of terrain.SurfaceGrid (contacts, fields), for each foot of the surface that its
    centre meets. Empty without round feet, and on planes."""

    def under(self, centres: Table, *, carriers: Table, radius: Table, nodes: int) -> Self:
        """Copy of this ground that acts on the given contact nodes.

        Args:
            centres: indices of the contact nodes (contacts,).
            carriers: index of the body of each contact node (contacts,), ascending.
            radius: radii of the feet (contacts,) in m.
            nodes: number of nodes of the robot.
        """
        of_round = np.flatnonzero(radius)
        contacts = centres.copy()
        contacts[of_round] = nodes + np.arange(of_round.size)
        grid = terrain.SurfaceGrid(*self.grid)
        heights = self.heights[: round(grid.last_row + 1.5) * int(grid.columns)]
        table, stacked = heights.reshape(-1, int(grid.columns)), [heights]
        slopes = [np.diff(table, axis=axis) for axis in (0, 1)]
        is_plane = all(np.ptp(slope) <= 1e-9 * np.abs(slope).max() for slope in slopes)
        sizes = () if is_plane else np.unique(radius[of_round])
        rolled = np.zeros((radius.size if len(sizes) else 0, len(grid)))
        for size in sizes:
            rolled_grid, more = terrain.rolled_surface(grid, table, size)
            rolled[radius == size] = rolled_grid._replace(first=sum(map(len, stacked)))
            stacked.append(more)
        return self._replace(
            contacts=contacts,
            centres=centres,
            radius=radius,
            carriers=carriers,
            is_round=of_round.size > 0,
            grid=np.array(grid._replace(reach=radius.max(initial=0.0))),
            heights=np.concatenate(stacked),
            rolled=rolled,
        )


@functools.partial(compiled, nogil=True)  # a call of its own: inlined, it slows other robots
def roll_feet(nodes: Table, ground: Ground, frames: Table) -> None:
    """Writes the frames of round feet on their rolled surfaces to `frames`. The gap of such a frame
    is the foot's. `nodes` has the positions of the feet's centres."""
    rolled, base = ground.rolled, named(terrain.SurfaceGrid, ground.grid)
    for i in range(rolled.shape[0]):
        if ground.contacts[i] != ground.centres[i]:
            grid = terrain.row_of(rolled, i, base.first)
            place = vector_at(nodes, ground.centres[i], kinematics.P_WN)
            terrain.put_frame(place, grid, ground.heights, True, i, frames)


@inlined
def meet_ground(ground: Ground, state: Table, nodes: Table, frames: Table) -> None:
    """Writes the frames of the surface below the contact nodes, and the lowest points of round
    feet.

    A frame is a row of `frames` (contacts, FRAME_COLUMNS): gap, normal and tangents. The lowest
    points are written to rows of the table `nodes` of laws.kinematics, after all nodes. The forces
    on them become zero.

    The velocity of a lowest point is the velocity of the body's material there. The gap in the
    frame of a round foot is the distance of its lowest point from the surface. On flat ground,
    `frames` is not used.
    """
    if not ground.flat:
        grid = named(terrain.SurfaceGrid, ground.grid)
        terrain.find_frames(nodes, ground.centres, grid, ground.heights, frames)
    if not ground.is_round:
        return
    is_rolled = ground.rolled.shape[0] > 0
    if is_rolled:
        roll_feet(nodes, ground, frames)
    for i in range(ground.contacts.size):
        centre, foot, radius = ground.centres[i], ground.contacts[i], ground.radius[i]
        if foot == centre:
            continue
        if not ground.flat and not is_rolled:
            frames[i, terrain.GAP] -= radius
        drop = terrain.to_world(0.0, 0.0, -radius, frames, i, ground.flat)
        turns = cross(kinematics.angular_velocity(state, ground.carriers[i]), drop)
        for column in (kinematics.P_BN_W, kinematics.P_WN):
            put_vector(sum_of(vector_at(nodes, centre, column), drop), foot, column, nodes)
        velocity = sum_of(vector_at(nodes, centre, kinematics.V_WN), turns)
        put_vector(velocity, foot, kinematics.V_WN, nodes)
        put_vector((0.0, 0.0, 0.0), foot, kinematics.FORCE, nodes)


@inlined
def gap(nodes: Table, ground: Ground, frames: Table, i: int) -> Real:
    """Distance (m) from the ground to the lowest point of foot i; negative in the ground. It is
    read from `nodes` if the ground is flat, otherwise from `frames`; see meet_ground()."""
    if ground.flat:
        return nodes[ground.contacts[i], kinematics.P_WN + 2]
    return frames[i, terrain.GAP]


@inlined
def normal_force(depth: Real, depth_rate: Real, law: NormalForce) -> Real:
    """Normal force (N) on a node by Eq. 1 of the thesis with the exponent n = 1: stiffness depth +
    damping depth depth_rate, but never below 0.

    `depth` (m) is the node's depth in the ground, `depth_rate` (m/s) its rate, positive as it sinks
    in. In the air, where `depth` is negative, the force is 0.
    """
    force = law.stiffness * depth + law.damping * depth * depth_rate
    return select(depth > 0.0, maximum(force, 0.0), 0.0)


@inlined
def sliding(
    state: Table, nodes: Table, modes: Table, ground: Ground, frames: Table, i: int
) -> tuple[friction.Slide, Real]:
    """Motion of foot i along the ground, with its normal force (N), and the rate (m/s) of its
    distance from the ground, positive upward.

    `state` is [q; v] (13*bodies,), `nodes` the table of node motions. `frames` has the tangents of
    the ground, `modes` the friction modes, stick points and headings; both are only read.
    """
    p_WN = vector_at(nodes, ground.centres[i], kinematics.P_WN)
    v_WN = vector_at(nodes, ground.contacts[i], kinematics.V_WN)
    deflection = difference(p_WN, vector_at(modes, i, STICK_POINT))
    if ground.is_round:
        turn = kinematics.turn_from(modes, i, ORIENTATION, state, ground.carriers[i])
        drop = terrain.to_world(0.0, 0.0, -ground.radius[i], frames, i, ground.flat)
        deflection = sum_of(deflection, cross(turn, drop))
    v_1, v_2, v_n = terrain.to_frame(v_WN, frames, i, ground.flat)
    x_1, x_2, _ = terrain.to_frame(deflection, frames, i, ground.flat)
    t1 = friction.TangentSlide(v_1, x_1, modes[i, MODE])
    t2 = friction.TangentSlide(v_2, x_2, modes[i, MODE + 1])
    heading = modes[i, HEADING], modes[i, HEADING + 1]
    law = named(NormalForce, ground.normal)
    normal = normal_force(-gap(nodes, ground, frames, i), -v_n, law)
    return friction.Slide(t1, t2, heading, normal), v_n


@inlined
def update_modes(state: Table, nodes: Table, ground: Ground, frames: Table, modes: Table) -> Truth:
    """Updates the contact and friction modes in `modes` (contacts, 12) for a state [q; v] and its
    `nodes` and `frames`.

    Returns True in lanes where a mode changed; each lane is a robot. A node that lands sticks where
    it lands. A sliding node that sticks again does so at its present position, so the deflection of
    its bristle becomes 0; some settings of friction keep the deflection. The stick point of a node
    in the air is where it has left the ground.
    """
    changed = False
    for i in range(ground.contacts.size):
        touched, touches = modes[i, CONTACT] != 0.0, gap(nodes, ground, frames, i) <= 0.0
        if not any_lane(touched | touches):
            continue
        slide, _ = sliding(state, nodes, modes, ground, frames, i)
        due = friction.next_mode(ground.friction, slide)
        stays, lands = touched & touches, touches & not_(touched)
        after_1 = select(stays, due.mode[0], friction.STICK)
        after_2 = select(stays, due.mode[1], friction.STICK)
        if any_lane(lands):
            # The heading is the body's x axis, projected into the tangent plane.
            x, y, z = kinematics.rotation(state, ground.carriers[i])
            h_1, h_2, _ = terrain.to_frame((x[0], y[0], z[0]), frames, i, ground.flat)
            per_length = inverse_sqrt(maximum(h_1 * h_1 + h_2 * h_2, 1e-30))
            modes[i, HEADING] = select(lands, h_1 * per_length, modes[i, HEADING])
            modes[i, HEADING + 1] = select(lands, h_2 * per_length, modes[i, HEADING + 1])
        arrives_or_leaves = touched ^ touches
        moves_1 = (due.begins[0] & stays) | arrives_or_leaves
        moves_2 = (due.begins[1] & stays) | arrives_or_leaves
        bend = select(stays, due.bend[0], 0.0), select(stays, due.bend[1], 0.0)
        move_stick_point(state, nodes, ground, frames, i, (moves_1, moves_2), bend, slide, modes)
        modes[i, CONTACT] = select(touches, 1.0, 0.0)
        modes[i, MODE], modes[i, MODE + 1] = after_1, after_2
        changed = changed | arrives_or_leaves
        changed = changed | (after_1 != slide.t1.mode) | (after_2 != slide.t2.mode)
    return changed


@inlined
def move_stick_point(
    state: Table,
    nodes: Table,
    ground: Ground,
    frames: Table,
    i: int,
    along: tuple[Truth, Truth],
    bend: friction.Vector2,
    slide: friction.Slide,
    modes: Table,
) -> None:
    """Moves the stick point of foot i, in `modes`, so that the deflection of its bristle becomes
    `bend` (m, along t1 and t2), but only along the tangents for which `along` is true. Along the
    others the deflection stays. `slide` is the foot's present motion.

    With round feet, also stores the body's orientation in `modes`, from which the foot's later turn
    counts in the deflection.
    """
    p_WN = vector_at(nodes, ground.centres[i], kinematics.P_WN)
    if ground.is_round:
        x_1 = select(along[0], bend[0], slide.t1.deflection)
        x_2 = select(along[1], bend[1], slide.t2.deflection)
        deflection = terrain.to_world(x_1, x_2, 0.0, frames, i, ground.flat)
        put_vector(difference(p_WN, deflection), i, STICK_POINT, modes)
        kinematics.put_orientation(state, ground.carriers[i], i, ORIENTATION, modes)
        return
    bent = terrain.to_world(bend[0], bend[1], 0.0, frames, i, ground.flat)
    p_x, p_y, p_z = difference(p_WN, bent)
    stick_x, stick_y, stick_z = vector_at(modes, i, STICK_POINT)
    if ground.flat:
        modes[i, STICK_POINT] = select(along[0], p_x, stick_x)
        modes[i, STICK_POINT + 1] = select(along[1], p_y, stick_y)
        return
    x_1 = select(along[0], slide.t1.deflection - bend[0], 0.0)
    x_2 = select(along[1], slide.t2.deflection - bend[1], 0.0)
    x, y, z = terrain.to_world(x_1, x_2, 0.0, frames, i, False)
    both = along[0] & along[1]
    modes[i, STICK_POINT] = select(both, p_x, stick_x + x)
    modes[i, STICK_POINT + 1] = select(both, p_y, stick_y + y)
    modes[i, STICK_POINT + 2] = select(both, p_z, stick_z + z)
