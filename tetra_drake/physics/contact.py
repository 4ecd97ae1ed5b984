"""Ground contact: normal force (Eq. 1), friction, and the modes of contact nodes.

The state of a contact node is a row of the table `modes` (contacts, 8):

- contact: 1 if the node touches the ground, otherwise 0
- friction mode along the tangents t1 and t2; see `friction`
- stick point: the point in the world where the bristle deflection is zero
- heading of the node's body at touchdown

The laws use the frames of `terrain`. On flat ground these are the axes of the world.
"""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np

from tetra_drake.physics import friction, kinematics, terrain
from tetra_drake.physics.vectors import difference, vector_at
from tetra_drake.simd.compiling import inlined
from tetra_drake.simd.lanes import (
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

CONTACT, MODE, STICK_POINT, HEADING, MODE_COLUMNS = 0, 1, 3, 6, 8
"""Columns of the table `modes`, and their number: contact (0 or 1), friction mode (along t1, t2),
stick point (x, y, z) in m, heading (along t1, t2)."""

FRICTION_1, FRICTION_2, NORMAL, GROUND_FORCE_COLUMNS = range(4)
"""Columns of the table `ground_forces` (contacts, 3), and their number: friction along t1 and t2,
normal force (N)."""


class NormalForce(NamedTuple):
    """Constants of the normal force (Table 1); SI units."""

    stiffness: Real
    damping: Real


class Ground(NamedTuple):
    """Ground in the form of the kernels, and the nodes that may touch it (contact nodes)."""

    contacts: Table
    """Indices of the contact nodes (contacts,)."""
    carriers: Table
    """Index of the body of each contact node (contacts,), ascending."""
    normal: Table
    """Table of the numbers of NormalForce."""
    friction: friction.FrictionLaw
    flat: bool
    grid: Table
    """Table of the numbers of SurfaceGrid."""
    heights: Table
    """Heights (points,) of the surface's control points in m, row by row."""

    @classmethod
    def nowhere(cls) -> Self:
        """Ground that no node may touch."""
        no_index, friction_law = np.zeros(0, dtype=np.int64), friction.FrictionLaw(0, np.zeros(1))
        return cls(no_index, no_index, np.zeros(2), friction_law, True, np.zeros(1), np.zeros(0))


@inlined
def meet_ground(ground: Ground, nodes: Table, frames: Table) -> None:
    """Writes the frames of the surface at the contact nodes to `frames` (contacts, FRAME_COLUMNS).

    `nodes` is the table of `kinematics`. On flat ground, `frames` is not used.
    """
    if not ground.flat:
        grid = named(terrain.SurfaceGrid, ground.grid)
        terrain.find_frames(nodes, ground.contacts, grid, ground.heights, frames)


@inlined
def gap(nodes: Table, ground: Ground, frames: Table, i: int) -> Real:
    """Distance (m) from the ground to a contact node; negative in the ground."""
    if ground.flat:
        return nodes[ground.contacts[i], kinematics.P_WN + 2]
    return frames[i, terrain.GAP]


@inlined
def normal_force(depth: Real, depth_rate: Real, law: NormalForce) -> Real:
    """Normal force (N) on a node by Eq. 1 with n = 1.

    `depth` (m) is the node's depth in the ground, `depth_rate` (m/s) its rate. The ground never
    pulls.
    """
    force = law.stiffness * depth + law.damping * depth * depth_rate
    return select(depth > 0.0, maximum(force, 0.0), 0.0)


@inlined
def sliding(
    nodes: Table, modes: Table, ground: Ground, frames: Table, i: int
) -> tuple[friction.Slide, Real]:
    """Motion of contact node i along the ground, and the rate (m/s) of its gap."""
    node = ground.contacts[i]
    p_WN, v_WN = vector_at(nodes, node, kinematics.P_WN), vector_at(nodes, node, kinematics.V_WN)
    deflection = difference(p_WN, vector_at(modes, i, STICK_POINT))
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
    """Updates `modes` for the nodes of a state. Returns True in lanes where a mode changed.

    A node that lands sticks where it lands. A node that sticks again does so at its present
    position; this is the reset of the reset integrator.
    """
    changed = False
    for i in range(ground.contacts.size):
        touched, touches = modes[i, CONTACT] != 0.0, gap(nodes, ground, frames, i) <= 0.0
        if not any_lane(touched | touches):
            continue
        slide, _ = sliding(nodes, modes, ground, frames, i)
        before = slide.t1.mode, slide.t2.mode
        after = friction.next_mode(slide, touched & touches, ground.friction)
        lands = touches & not_(touched)
        if any_lane(lands):
            set_heading(state, ground, frames, i, lands, modes)
        begins_1, begins_2 = friction.begins_to_stick(before, after, ground.friction)
        sticks_here = lands | begins_1, lands | begins_2
        move_stick_point(nodes, ground, frames, i, sticks_here, slide, modes)
        modes[i, CONTACT] = select(touches, 1.0, 0.0)
        modes[i, MODE], modes[i, MODE + 1] = after
        changed = changed | (touched ^ touches)
        changed = changed | (after[0] != before[0]) | (after[1] != before[1])
    return changed


@inlined
def move_stick_point(
    nodes: Table,
    ground: Ground,
    frames: Table,
    i: int,
    along: tuple[Truth, Truth],
    slide: friction.Slide,
    modes: Table,
) -> None:
    """Moves the stick point of a contact node to the node. `along` says, for t1 and t2, whether the
    stick point moves along this tangent."""
    p_x, p_y, p_z = vector_at(nodes, ground.contacts[i], kinematics.P_WN)
    stick_x, stick_y, stick_z = vector_at(modes, i, STICK_POINT)
    if ground.flat:
        modes[i, STICK_POINT] = select(along[0], p_x, stick_x)
        modes[i, STICK_POINT + 1] = select(along[1], p_y, stick_y)
        return
    x_1 = select(along[0], slide.t1.deflection, 0.0)
    x_2 = select(along[1], slide.t2.deflection, 0.0)
    x, y, z = terrain.to_world(x_1, x_2, 0.0, frames, i, False)
    both = along[0] & along[1]
    modes[i, STICK_POINT] = select(both, p_x, stick_x + x)
    modes[i, STICK_POINT + 1] = select(both, p_y, stick_y + y)
    modes[i, STICK_POINT + 2] = select(both, p_z, stick_z + z)


@inlined
def set_heading(
    state: Table, ground: Ground, frames: Table, i: int, where: Truth, modes: Table
) -> None:
    """Stores the heading of a contact node's body: its x axis, projected into the tangent plane."""
    forward = kinematics.forward_axis(state, ground.carriers[i])
    h_1, h_2, _ = terrain.to_frame(forward, frames, i, ground.flat)
    per_length = inverse_sqrt(maximum(h_1 * h_1 + h_2 * h_2, 1e-30))
    modes[i, HEADING] = select(where, h_1 * per_length, modes[i, HEADING])
    modes[i, HEADING + 1] = select(where, h_2 * per_length, modes[i, HEADING + 1])
