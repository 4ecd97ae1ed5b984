"""Ground contact: normal force (Eq. 1), friction, and the modes of contact nodes.

What a contact node remembers is a row of `modes`, (contacts, 8): whether it touches the ground, its
friction mode along the tangents t1 and t2 (see `friction`), its stick point, a point of World where
its bristle deflection is zero, and the heading of its body at touchdown.

The laws act in the frames of `terrain`: on flat ground these are the axes of World.
"""

from __future__ import annotations

from typing import NamedTuple

from tetra_drake.physics.friction import (
    STICK,
    FrictionLaw,
    Slide,
    TangentSlide,
    friction_force,
    next_mode,
    stuck_along,
)
from tetra_drake.physics.kinematics import (
    FORCE,
    P_WN,
    V_WN,
    forward_axis,
    gather_forces,
    move_nodes,
)
from tetra_drake.physics.terrain import GAP, SurfaceGrid, find_frames, to_frame, to_world
from tetra_drake.physics.vectors import add_vector, difference, put_vector, vector_at
from tetra_drake.simd.compiling import compiled, inlined
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
"""Columns of `modes`: contact (0 or 1), mode (along t1, t2), stick point (x, y, z) in m, heading
(along t1, t2); and their number."""

FRICTION_1, FRICTION_2, NORMAL, PUSH_COLUMNS = range(4)
"""Columns of `pushes`, (contacts, 3), the forces of the ground: friction along t1 and t2, normal
force (N); and their number."""


class NormalForce(NamedTuple):
    """The constants of the normal force (Table 1), SI."""

    stiffness: Real
    damping: Real


class Ground(NamedTuple):
    """The ground as kernels take it, and the nodes that may touch it."""

    contacts: Table
    """(contacts,), the indices of the nodes."""
    carriers: Table
    """(contacts,), the indices of their bodies, ascending."""
    normal: Table
    """The numbers of a NormalForce."""
    friction: FrictionLaw
    flat: bool
    grid: Table
    """The numbers of a SurfaceGrid."""
    heights: Table
    """(points,): the control points of the surface in m, row by row."""


@inlined
def meet_ground(
    state: Table, p_BN: Table, first_node: Table, ground: Ground, nodes: Table, frames: Table
) -> None:
    """Writes the `nodes` of `kinematics` for a state of the bodies, without forces, and where they
    meet the ground: `frames`, (contacts, FRAME_COLUMNS), which flat ground leaves as they are."""
    move_nodes(state, p_BN, first_node, nodes)
    if not ground.flat:
        grid = named(SurfaceGrid, ground.grid)
        find_frames(nodes, ground.contacts, grid, ground.heights, frames)


@inlined
def gap(nodes: Table, ground: Ground, frames: Table, i: int) -> Real:
    """Distance (m) of a contact node from the ground, negative in it."""
    if ground.flat:
        return nodes[ground.contacts[i], P_WN + 2]
    return frames[i, GAP]


@inlined
def normal_force(depth: Real, depth_rate: Real, law: NormalForce) -> Real:
    """Force (N) along the normal on a node `depth` (m) in the ground, which sinks at `depth_rate`
    (m/s).

    Eq. 1 with n = 1; the ground never pulls.
    """
    force = law.stiffness * depth + law.damping * depth * depth_rate
    return select(depth > 0.0, maximum(force, 0.0), 0.0)


@inlined
def sliding(
    nodes: Table, modes: Table, ground: Ground, law: NormalForce, frames: Table, i: int
) -> tuple[Slide, Real]:
    """Sliding of a contact node, and the rate (m/s) at which its gap grows."""
    node = ground.contacts[i]
    deflection = difference(vector_at(nodes, node, P_WN), vector_at(modes, i, STICK_POINT))
    v_1, v_2, v_n = to_frame(vector_at(nodes, node, V_WN), frames, i, ground.flat)
    x_1, x_2, _ = to_frame(deflection, frames, i, ground.flat)
    t1 = TangentSlide(v_1, x_1, modes[i, MODE])
    t2 = TangentSlide(v_2, x_2, modes[i, MODE + 1])
    heading = modes[i, HEADING], modes[i, HEADING + 1]
    normal = normal_force(-gap(nodes, ground, frames, i), -v_n, law)
    return Slide(t1, t2, heading, normal), v_n


@inlined
def add_ground_forces(
    nodes: Table, modes: Table, ground: Ground, frames: Table, keep: bool, pushes: Table
) -> None:
    """Adds the forces of the ground to those on the `nodes` of `kinematics`.

    `modes` is (contacts, MODE_COLUMNS). With `keep`, writes `pushes`.
    """
    law = named(NormalForce, ground.normal)
    for i in range(pushes.shape[0]):
        node, touches = ground.contacts[i], modes[i, CONTACT] != 0.0
        if not any_lane(touches | (gap(nodes, ground, frames, i) <= 0.0)):
            if keep:
                put_vector((0.0, 0.0, 0.0), i, FRICTION_1, pushes)
            continue
        slide, _ = sliding(nodes, modes, ground, law, frames, i)
        f_1, f_2 = friction_force(slide, ground.friction)
        f_1, f_2 = select(touches, f_1, 0.0), select(touches, f_2, 0.0)
        if keep:
            put_vector((f_1, f_2, slide.normal), i, FRICTION_1, pushes)
        force = to_world(f_1, f_2, slide.normal, frames, i, ground.flat)
        add_vector(force, node, FORCE, nodes)


def ground_arguments(
    ground: Ground,
) -> tuple[Table, Table, Table, int, Table, bool, Table, Table]:
    """A ground as ground_forces() takes it: no tuple within it."""
    friction = ground.friction
    return (
        ground.contacts,
        ground.carriers,
        ground.normal,
        friction.kind,
        friction.constants,
        ground.flat,
        ground.grid,
        ground.heights,
    )


@compiled
def ground_forces(
    state: Table,
    modes: Table,
    p_BN: Table,
    first_node: Table,
    contacts: Table,
    carriers: Table,
    normal: Table,
    kind: int,
    constants: Table,
    flat: bool,
    grid: Table,
    heights: Table,
    nodes: Table,
    frames: Table,
    pushes: Table,
    generalized_force: Table,
) -> None:
    """Writes [t_W; f_W] of the ground at each Bo, (6 bodies,), for a state of the bodies; also
    `nodes`, `frames` and `pushes`. From `contacts` to `heights`, the arguments are those of
    ground_arguments(): a call from Python takes a microsecond longer if it has to unpack them."""
    friction = FrictionLaw(kind, constants)
    ground = Ground(contacts, carriers, normal, friction, flat, grid, heights)
    meet_ground(state, p_BN, first_node, ground, nodes, frames)
    add_ground_forces(nodes, modes, ground, frames, True, pushes)
    gather_forces(nodes, first_node, generalized_force)


@inlined
def update_modes(state: Table, nodes: Table, ground: Ground, frames: Table, modes: Table) -> Truth:
    """Brings `modes`, (contacts, MODE_COLUMNS), up to date with the nodes of a state; whether they
    changed.

    A node that lands sticks where it lands; one that sticks again does so where it is
    (the reset of the integrator). The other arguments are those of `add_ground_forces`.
    """
    changed, law = False, named(NormalForce, ground.normal)
    for i in range(ground.contacts.size):
        touched = modes[i, CONTACT] != 0.0
        touches = gap(nodes, ground, frames, i) <= 0.0
        if not any_lane(touched | touches):
            continue
        modes[i, CONTACT] = select(touches, 1.0, 0.0)
        changed = changed | (touched ^ touches)
        lands, stays = touches & not_(touched), touched & touches
        slide, _ = sliding(nodes, modes, ground, law, frames, i)
        mode_1, mode_2 = slide.t1.mode, slide.t2.mode
        next_1, next_2 = next_mode(slide, ground.friction)
        next_1, next_2 = select(stays, next_1, STICK), select(stays, next_2, STICK)
        stuck_1, stuck_2 = stuck_along((mode_1, mode_2), ground.friction)
        sticks_1, sticks_2 = stuck_along((next_1, next_2), ground.friction)
        resets_1 = sticks_1 & (lands | not_(stuck_1))
        resets_2 = sticks_2 & (lands | not_(stuck_2))
        if any_lane(lands):
            set_heading(state, ground, frames, i, lands, modes)
        modes[i, MODE], modes[i, MODE + 1] = next_1, next_2
        changed = changed | (next_1 != mode_1) | (next_2 != mode_2)
        move_stick_point(nodes, ground, frames, i, resets_1, resets_2, slide, modes)
    return changed


@compiled
def modes_after_step(
    state: Table,
    p_BN: Table,
    first_node: Table,
    ground: Ground,
    nodes: Table,
    frames: Table,
    modes: Table,
) -> Truth:
    """Brings `modes` up to date with a state of the bodies, as update_modes() does; writes `nodes`
    and `frames`, too."""
    meet_ground(state, p_BN, first_node, ground, nodes, frames)
    return update_modes(state, nodes, ground, frames, modes)


@inlined
def move_stick_point(
    nodes: Table,
    ground: Ground,
    frames: Table,
    i: int,
    along_1: Truth,
    along_2: Truth,
    slide: Slide,
    modes: Table,
) -> None:
    """Moves the stick point of a contact node to the node, along t1 and along t2."""
    p_x, p_y, p_z = vector_at(nodes, ground.contacts[i], P_WN)
    stick_x, stick_y, stick_z = vector_at(modes, i, STICK_POINT)
    if ground.flat:
        modes[i, STICK_POINT] = select(along_1, p_x, stick_x)
        modes[i, STICK_POINT + 1] = select(along_2, p_y, stick_y)
        return
    x_1 = select(along_1, slide.t1.deflection, 0.0)
    x_2 = select(along_2, slide.t2.deflection, 0.0)
    x, y, z = to_world(x_1, x_2, 0.0, frames, i, False)
    both = along_1 & along_2
    modes[i, STICK_POINT] = select(both, p_x, stick_x + x)
    modes[i, STICK_POINT + 1] = select(both, p_y, stick_y + y)
    modes[i, STICK_POINT + 2] = select(both, p_z, stick_z + z)


@inlined
def set_heading(
    state: Table, ground: Ground, frames: Table, i: int, where: Truth, modes: Table
) -> None:
    """Notes the heading of a contact node's body: its x axis, projected into the tangent plane."""
    forward = forward_axis(state, ground.carriers[i])
    h_1, h_2, _ = to_frame(forward, frames, i, ground.flat)
    per_length = inverse_sqrt(maximum(h_1 * h_1 + h_2 * h_2, 1e-30))
    modes[i, HEADING] = select(where, h_1 * per_length, modes[i, HEADING])
    modes[i, HEADING + 1] = select(where, h_2 * per_length, modes[i, HEADING + 1])
