"""Forces of cables, ground, anchors, loads and gravity on a robot in a given state."""

from __future__ import annotations

import functools
from typing import Annotated, NamedTuple, Self, TypeAlias

import numpy as np

from tetra_drake.kernels.compiling import compiled, inlined
from tetra_drake.kernels.lanes import Real, Table, any_lane, inverse_sqrt, maximum, named, select
from tetra_drake.kernels.packed import Packed, allocate, unpacked
from tetra_drake.laws import actuator, cable, capsules, contact, dry_friction, kinematics, terrain
from tetra_drake.laws.contact import NormalForce
from tetra_drake.laws.friction import friction_force
from tetra_drake.laws.inertia import INERTIA_COLUMNS, times_inertia, turn_inertia
from tetra_drake.laws.model import Model
from tetra_drake.laws.vectors import (
    Vector3,
    add_vector,
    cross,
    difference,
    dot,
    put_vector,
    scaled,
    sum_of,
    vector_at,
)


class Forces(NamedTuple):
    """Tables to which kernels write the motions of the nodes of a robot and the forces on it, in
    one state."""

    nodes: Annotated[Table, "nodes", kinematics.NODE_COLUMNS]
    frames: Annotated[Table, "contacts", terrain.FRAME_COLUMNS]
    """Tangent frames of the ground at the contact nodes; see laws.terrain."""
    cable_forces: Annotated[Table, "cables", cable.CABLE_FORCE_COLUMNS]
    route_slopes: Annotated[Table, "route_nodes", 3]
    """Derivative of a routed cable's length by the position of each node of its path."""
    rings: Annotated[Table, "route_nodes", dry_friction.RING_COLUMNS]
    """Pieces of the cables with friction at rings; see laws.dry_friction."""
    slip_slopes: Annotated[Table, "route_nodes", 3]
    """Derivative of the slip at a ring by the position of each node of its path."""
    ground_forces: Annotated[Table, "contacts", contact.GROUND_FORCE_COLUMNS]
    inertia: Annotated[Table, "bodies", INERTIA_COLUMNS]
    """Inertia of the bodies along the world's axes; unused if they are isotropic."""
    drives: Annotated[Table, "drives", actuator.DRIVE_COLUMNS]
    """States of the actuators and their rates, in the order of the driven cables. Column DRIVE is
    input, the other columns are output; see laws.actuator."""
    near_struts: capsules.NearStruts

    @classmethod
    def of(cls, robot: Model) -> Self:
        """New tables for a robot's motions and forces."""
        return allocate(cls, sizes_of(robot))


def sizes_of(robot: Model) -> dict[str, int]:
    """Numbers of a robot's bodies, nodes, contacts and so on, by name, such as {"bodies": 3, ...}.
    allocate() makes tables of these lengths."""
    drivers, has_drive = robot.cables.signal, actuator.has_drive(robot.actuator)
    near = capsules.near_sizes(robot.struts)
    if not robot.strut_contact.acts:
        near = dict.fromkeys(near, 0)
    bodies = len(robot.bodies.mass)
    return near | {
        "touches": min(near["strut_pairs"], 3 * bodies),
        "bodies": bodies,
        "nodes": len(robot.p_BN) + int(np.count_nonzero(robot.ground.radius)),
        "contacts": robot.ground.contacts.size,
        "cables": drivers.size,
        "route_nodes": robot.cables.routes.nodes.size,
        "drives": int(np.count_nonzero(drivers != cable.PASSIVE)) if has_drive else 0,
    }


Parts: TypeAlias = Packed[tuple[Model, Forces]] | tuple[Model, Forces]
"""A Model and its Forces, as one argument for kernels that Python calls often."""


@inlined
def move_robot(robot: Model, state: Table, forces: Forces) -> None:
    """Writes what depends only on the state to `forces`: positions and velocities of the nodes and
    of the lowest points of round feet, ground frames, and inertia along the world's axes.

    `state` is [q; v] (13*bodies,). A ground frame is the gap, normal and tangents of the ground
    below a contact node. Sets the forces on nodes and feet to zero.
    """
    move_contacts(robot, state, forces)
    if not robot.isotropic:
        turn_inertia(state, robot.bodies.inertia, forces.inertia)


@inlined
def move_contacts(robot: Model, state: Table, forces: Forces) -> None:
    """Writes positions and velocities of the nodes and of the lowest points of round feet, and
    ground frames, for a state [q; v] (13*bodies,) to `forces`.

    A ground frame is the gap, normal and tangents of the ground below a contact node. Sets the
    forces on nodes and feet to zero.
    """
    kinematics.move_nodes(state, robot.p_BN, robot.first_node, forces.nodes)
    contact.meet_ground(robot.ground, state, forces.nodes, forces.frames)


@inlined
def pull_of_cable(
    robot: Model, i: int, length: Real, rate: Real, signals: Table, drives: Table
) -> tuple[Real, Real]:
    """Tension (N) of cable i, and its derivative by the rate of the length (N s/m).

    `length` is in m, `rate`, the rate of the length, in m/s, `signals` (signals,) in N. An
    actuation force also acts on a cable that is slack.

    `drives` has a row for each actuator with a state, such as a winch. Its state is read; the
    state's rate and the other columns are written.
    """
    driver, signal = robot.cables.signal[i], 0.0
    law = cable.law_of(robot.cables, i)
    if driver != cable.PASSIVE:
        signal = law.intact * signals[driver]
    if driver == cable.PASSIVE or not actuator.has_drive(robot.actuator):
        if not robot.slack:
            return cable.cable_tension(length, rate, signal, law), law.damping
        elastic = cable.elastic_tension(length - law.free_length, law)
        tension, tension_per_rate = cable.slack_tension(elastic, rate, law)
        tension += signal
        return maximum(tension, 0.0), select(tension > 0.0, tension_per_rate, 0.0)
    drive = robot.cables.drive[i]
    driven = actuator.actuator_force(
        robot.actuator, drives[drive, actuator.DRIVE], length, rate, signal, law
    )
    drives[drive, actuator.RATE] = driven.rate
    drives[drive, actuator.LIMITED] = driven.limited
    drives[drive, actuator.BESIDE] = driven.beside
    return driven.tension, driven.tension_per_rate


@inlined
def add_cable_forces(robot: Model, signals: Table, write_parts: bool, forces: Forces) -> None:
    """Adds the forces of all cables to the forces on the nodes, in `forces.nodes`, which has the
    nodes' positions and velocities.

    `signals` (signals,) are in N. Also writes the rates of the actuators' states to
    `forces.drives`, and with `write_parts` direction, length and tension of each cable to
    `forces.cable_forces`.
    """
    nodes, drives, parts = forces.nodes, forces.drives, forces.cable_forces
    routes = robot.cables.routes
    for i in range(parts.shape[0]):
        if routes.first[i] < routes.first[i + 1]:
            continue
        a, b = robot.cables.node_a[i], robot.cables.node_b[i]
        direction, length, rate = span(nodes, a, b)
        tension, tension_per_rate = pull_of_cable(robot, i, length, rate, signals, drives)
        add_vector(scaled(tension, direction), a, kinematics.FORCE, nodes)
        add_vector(scaled(-tension, direction), b, kinematics.FORCE, nodes)
        if write_parts:
            put_vector(direction, i, cable.DIRECTION, parts)
            parts[i, cable.LENGTH], parts[i, cable.TENSION] = length, tension
            parts[i, cable.TENSION_PER_RATE], parts[i, cable.RATE] = tension_per_rate, rate
    if routes.nodes.size:
        add_routed_cables(robot, signals, write_parts, forces)


@inlined
def between(nodes: Table, a: int, b: int) -> tuple[Vector3, Vector3]:
    """Position (m) and velocity (m/s) of node b relative to node a, in the world frame. `nodes` is
    the table of laws.kinematics."""
    p_AB = difference(vector_at(nodes, b, kinematics.P_WN), vector_at(nodes, a, kinematics.P_WN))
    v_AB = difference(vector_at(nodes, b, kinematics.V_WN), vector_at(nodes, a, kinematics.V_WN))
    return p_AB, v_AB


@inlined
def span(nodes: Table, a: int, b: int) -> tuple[Vector3, Real, Real]:
    """Direction from node a to node b, their distance (m) and its rate (m/s). `nodes` is the table
    of laws.kinematics. Nodes nearer than MEETING have the length that cable.MEETING tells, and its
    gradient as direction."""
    p_AB, v_AB = between(nodes, a, b)
    square = dot(p_AB, p_AB)
    per_length = inverse_sqrt(maximum(square, cable.MEETING * cable.MEETING))
    direction, length = scaled(per_length, p_AB), square * per_length
    return direction, maximum(length, 0.5 * (length + cable.MEETING)), dot(v_AB, direction)


@functools.partial(compiled, nogil=True)  # a call of its own: inlined, it slows other robots
def add_routed_cables(robot: Model, signals: Table, write_parts: bool, forces: Forces) -> None:
    """Adds the forces of the cables that run over rings; see add_cable_forces(). Also writes
    `forces.route_slopes` and `forces.rings`."""
    nodes, routes, slopes = forces.nodes, robot.cables.routes, forces.route_slopes
    parts = forces.cable_forces
    for i in range(parts.shape[0]):
        first, last = routes.first[i], routes.first[i + 1] - 1
        if last < first:
            continue
        length = rate = 0.0
        put_vector((0.0, 0.0, 0.0), first, 0, slopes)
        for k in range(first, last):
            direction, part, part_rate = span(nodes, routes.nodes[k], routes.nodes[k + 1])
            length += part
            rate += part_rate
            add_vector(scaled(-1.0, direction), k, 0, slopes)
            put_vector(direction, k + 1, 0, slopes)
        tension, tension_per_rate = pull_of_cable(robot, i, length, rate, signals, forces.drives)
        for k in range(first, last + 1):
            pull = scaled(-tension, vector_at(slopes, k, 0))
            add_vector(pull, routes.nodes[k], kinematics.FORCE, nodes)
        if any_lane(robot.cables.law.mu[i] > 0.0):
            add_ring_friction(robot, i, length, rate, maximum(tension, 0.0), forces)
        if write_parts:
            put_vector(scaled(-1.0, vector_at(slopes, first, 0)), i, cable.DIRECTION, parts)
            parts[i, cable.LENGTH], parts[i, cable.TENSION] = length, tension
            parts[i, cable.TENSION_PER_RATE], parts[i, cable.RATE] = tension_per_rate, rate


@inlined
def add_ring_friction(
    robot: Model, i: int, length: Real, rate: Real, tension: Real, forces: Forces
) -> None:
    """Adds what the pieces of routed cable i pull more or less than its mean `tension` (N) to the
    forces on the nodes; see laws.dry_friction. Also writes `forces.rings`.

    `length` is in m, `rate`, the rate of the length, in m/s.
    """
    routes, nodes, rings, cables = robot.cables.routes, forces.nodes, forces.rings, robot.cables
    stretches, first, last = rate, routes.first[i], routes.first[i + 1] - 1
    if cables.signal[i] != cable.PASSIVE and actuator.has_drive(robot.actuator):
        winds = forces.drives[cables.drive[i], actuator.RATE]
        stretches = rate - actuator.wound(robot.actuator, winds, 0.0 * rate)
    before = before_rate = mean = 0.0 * length
    share = 1.0 + before
    for k in range(first, last):
        along, part, part_rate = span(nodes, routes.nodes[k], routes.nodes[k + 1])
        if k > first:
            slip = before_rate - before * stretches
            turn = dry_friction.turn_between(vector_at(rings, k, dry_friction.ALONG), along)
            ratio, damping = dry_friction.capstan(slip, cables.law.mu[i] * turn, tension)
            share = share / ratio
            rings[k, dry_friction.BEFORE], rings[k, dry_friction.DAMPING] = before, damping
        put_vector(along, k + 1, dry_friction.ALONG, rings)
        rings[k + 1, dry_friction.SHARE] = share
        before += part / length
        before_rate += part_rate
        mean += share * part / length
    for k in range(first, last):
        more = tension * (rings[k + 1, dry_friction.SHARE] / mean - 1.0)
        pull = scaled(more, vector_at(rings, k + 1, dry_friction.ALONG))
        add_vector(pull, routes.nodes[k], kinematics.FORCE, nodes)
        add_vector(scaled(-1.0, pull), routes.nodes[k + 1], kinematics.FORCE, nodes)


@inlined
def put_slip_slopes(first: int, ring: int, last: int, forces: Forces) -> None:
    """Writes the derivatives of the slip at a ring to `forces.slip_slopes`, for the path from row
    `first` to row `last`. `ring` is its row in `forces.rings`, which add_ring_friction() wrote."""
    rings, slopes = forces.rings, forces.slip_slopes
    put_vector((0.0, 0.0, 0.0), first, 0, slopes)
    for k in range(first + 1, last + 1):
        weight = (1.0 if k <= ring else 0.0) - rings[ring, dry_friction.BEFORE]
        along = scaled(weight, vector_at(rings, k, dry_friction.ALONG))
        add_vector(scaled(-1.0, along), k - 1, 0, slopes)
        put_vector(along, k, 0, slopes)


@functools.partial(compiled, nogil=True)  # a call of its own, as for routed cables
def add_joint_friction(robot: Model, state: Table, generalized: Table) -> None:
    """Adds the friction of joints to the generalized force (6*bodies,): see laws.dry_friction.
    `state` is [q; v] (13*bodies,)."""
    joints = robot.joints
    for i in range(joints.node_a.size):
        if any_lane(joints.friction[i] > 0.0):
            w = joint_spin(robot, state, i)
            per_spin, _ = dry_friction.spin_friction(w, joints.friction[i])
            for axis in range(3):
                generalized[6 * joints.body_a[i] + axis] += per_spin * w[axis]
                generalized[6 * joints.body_b[i] + axis] -= per_spin * w[axis]


@inlined
def joint_spin(robot: Model, state: Table, i: int) -> Vector3:
    """Angular velocity (rad/s) of the second body of joint i relative to the first, in the world
    frame. `state` is [q; v] (13*bodies,)."""
    w_WA = kinematics.angular_velocity(state, robot.joints.body_a[i])
    return difference(kinematics.angular_velocity(state, robot.joints.body_b[i]), w_WA)


@inlined
def add_ground_forces(
    robot: Model, state: Table, modes: Table, write_parts: bool, forces: Forces
) -> None:
    """Adds the forces of the ground to the forces on nodes and round feet, in `forces.nodes`.

    `state` is [q; v] (13*bodies,). `modes` (contacts, 12) says which nodes touch and stick, and is
    only read; see laws.contact. With `write_parts`, also writes friction and normal force of each
    contact to `forces.ground_forces`. move_contacts() must have been called for the same state.
    """
    ground, nodes, frames, parts = robot.ground, forces.nodes, forces.frames, forces.ground_forces
    for i in range(parts.shape[0]):
        touches = modes[i, contact.CONTACT] != 0.0
        if not any_lane(touches | (contact.gap(nodes, ground, frames, i) <= 0.0)):
            if write_parts:
                put_vector((0.0, 0.0, 0.0), i, contact.FRICTION_1, parts)
            continue
        slide, _ = contact.sliding(state, nodes, modes, ground, frames, i)
        f_1, f_2 = friction_force(ground.friction, slide)
        f_1, f_2 = select(touches, f_1, 0.0), select(touches, f_2, 0.0)
        if write_parts:
            put_vector((f_1, f_2, slide.normal), i, contact.FRICTION_1, parts)
        force = terrain.to_world(f_1, f_2, slide.normal, frames, i, ground.flat)
        add_vector(force, ground.contacts[i], kinematics.FORCE, nodes)


@inlined
def compute_forces(
    robot: Model,
    state: Table,
    modes: Table,
    signals: Table,
    write_parts: bool,
    forces: Forces,
    generalized: Table,
) -> None:
    """Writes the generalized force of cables, ground, touching struts, anchors, loads, gravity and
    gyroscopic torques to `generalized` (6*bodies,): torque and force [t_W; f_W] at each body's
    origin.

    move_robot() must have been called for the same `state`. `modes` (contacts, 12) are the contact
    and friction modes, and are only read. `signals` are in N. With `write_parts`, also writes
    `forces.cable_forces` and `forces.ground_forces`. (To write always takes the compiled engine 7 %
    longer.)
    """
    add_cable_forces(robot, signals, write_parts, forces)
    add_ground_forces(robot, state, modes, write_parts, forces)
    add_state_forces(robot, state, forces)
    gather_forces(robot, forces.nodes, generalized)
    if robot.joints.node_a.size:
        add_joint_friction(robot, state, generalized)
    bodies = generalized.size // 6
    for body in range(bodies):
        generalized[6 * body + 5] -= robot.bodies.weight[body]
    if robot.isotropic:
        return
    for body in range(bodies):
        w_WB = kinematics.angular_velocity(state, body)
        torque = cross(times_inertia(forces.inertia, body, w_WB), w_WB)  # gyroscopic, -w x (I w)
        for axis in range(3):
            generalized[6 * body + axis] += torque[axis]


@inlined
def gather_forces(robot: Model, nodes: Table, generalized: Table) -> None:
    """Sums the forces on the nodes and round feet of each body, and writes them to `generalized`
    (6*bodies,): torque and force [t_W; f_W] at each body's origin. `nodes` has the forces."""
    kinematics.gather_forces(nodes, robot.first_node, generalized)
    ground = robot.ground
    if not ground.is_round:
        return
    for i in range(ground.contacts.size):
        foot, g = ground.contacts[i], 6 * ground.carriers[i]
        if foot == ground.centres[i]:
            continue
        force = vector_at(nodes, foot, kinematics.FORCE)
        torque = cross(vector_at(nodes, foot, kinematics.P_BN_W), force)
        for axis in range(3):
            generalized[g + axis] += torque[axis]
            generalized[g + 3 + axis] += force[axis]


@inlined
def add_state_forces(robot: Model, state: Table, forces: Forces) -> None:
    """Adds the forces of touching struts, anchors (springs to the world), joints and loads
    (constant forces) to the forces on the nodes, in `forces.nodes`. They need neither signals nor
    modes. `state` is [q; v] (13*bodies,)."""
    nodes, anchors, joints, loads = forces.nodes, robot.anchors, robot.joints, robot.loads
    add_strut_forces(robot, state, forces)

    for i in range(anchors.nodes.size):
        node = anchors.nodes[i]
        p_WN = vector_at(nodes, node, kinematics.P_WN)
        p_x, p_y, p_z = difference(p_WN, vector_at(anchors.places, i, 0))
        v_x, v_y, v_z = vector_at(nodes, node, kinematics.V_WN)
        k_x, k_y, k_z = vector_at(anchors.stiffness, i, 0)
        c_x, c_y, c_z = vector_at(anchors.damping, i, 0)
        force = -k_x * p_x - c_x * v_x, -k_y * p_y - c_y * v_y, -k_z * p_z - c_z * v_z
        add_vector(force, node, kinematics.FORCE, nodes)

    for i in range(joints.node_a.size):
        a, b = joints.node_a[i], joints.node_b[i]
        p_AB, v_AB = between(nodes, a, b)
        force = sum_of(scaled(joints.stiffness[i], p_AB), scaled(joints.damping[i], v_AB))
        add_vector(force, a, kinematics.FORCE, nodes)
        add_vector(scaled(-1.0, force), b, kinematics.FORCE, nodes)

    for i in range(loads.nodes.size):
        add_vector(vector_at(loads.forces, i, 0), loads.nodes[i], kinematics.FORCE, nodes)


@inlined
def add_strut_forces(robot: Model, state: Table, forces: Forces) -> None:
    """Adds the forces between struts that touch to the forces on the nodes, in `forces.nodes`,
    which has the nodes' positions and velocities. `state` is [q; v] (13*bodies,).

    Finds the near pairs anew, into `forces.near_struts`, if a node has moved far since the latest
    search; see capsules.find_near_struts().
    """
    law, nodes, near = robot.strut_contact, forces.nodes, forces.near_struts
    if not law.acts:
        return
    search, normal = named(capsules.StrutSearch, law.search), named(NormalForce, law.normal)
    farthest = 0.0 * search.drift
    for node in range(near.p_WN.shape[0]):
        moved = difference(vector_at(nodes, node, kinematics.P_WN), vector_at(near.p_WN, node, 0))
        farthest = maximum(farthest, dot(moved, moved))
    if any_lane(farthest > search.drift * search.drift):
        radius = robot.bodies.radius
        capsules.find_near_struts(robot.struts, search.near, radius, state, nodes, near)
    for k in range(near.count[0]):
        i, j = near.pairs[k, 0], near.pairs[k, 1]
        capsules.add_contact_force(robot.struts, normal, nodes, i, j)


@compiled
def compute_cable_forces(parts: Parts, state: Table, signals: Table, generalized: Table) -> float:
    """Writes the generalized force of all cables to `generalized` (6*bodies,): torque and force
    [t_W; f_W] at each body's origin.

    `parts` is a Model and its Forces. `state` is [q; v] (13*bodies,), `signals` are in N. Also
    writes `nodes`, `cable_forces` and the rates of the actuators' states to the Forces. Returns the
    sum of all numbers in `generalized`: it is finite only if all forces are, and so serves as a
    check.
    """
    robot, forces = unpacked(parts)
    kinematics.move_nodes(state, robot.p_BN, robot.first_node, forces.nodes)
    add_cable_forces(robot, signals, True, forces)
    kinematics.gather_forces(forces.nodes, robot.first_node, generalized)
    total = 0.0
    for i in range(generalized.size):
        total += generalized[i]
    return total


@compiled
def compute_ground_forces(parts: Parts, state: Table, modes: Table, generalized: Table) -> None:
    """Writes the generalized force of the ground to `generalized` (6*bodies,): torque and force
    [t_W; f_W] at each body's origin.

    `parts` is a Model and its Forces. `state` is [q; v] (13*bodies,). `modes` (contacts, 12) says
    which nodes touch the ground and stick; it is only read. Also writes nodes, ground frames and
    `ground_forces` to the Forces.
    """
    robot, forces = unpacked(parts)
    move_contacts(robot, state, forces)
    add_ground_forces(robot, state, modes, True, forces)
    gather_forces(robot, forces.nodes, generalized)


@compiled
def compute_state_forces(parts: Parts, state: Table, generalized: Table) -> None:
    """Writes the generalized force of touching struts, anchors (springs to the world), joints and
    loads (constant forces) to `generalized` (6*bodies,): torque and force [t_W; f_W] at each body's
    origin.

    `parts` is a Model and its Forces. `state` is [q; v] (13*bodies,). Also writes nodes to the
    Forces.
    """
    robot, forces = unpacked(parts)
    kinematics.move_nodes(state, robot.p_BN, robot.first_node, forces.nodes)
    add_state_forces(robot, state, forces)
    kinematics.gather_forces(forces.nodes, robot.first_node, generalized)
    if robot.joints.node_a.size:
        add_joint_friction(robot, state, generalized)


@compiled
def compute_strut_forces(parts: Parts, state: Table, horizon: float, generalized: Table) -> float:
    """Writes the generalized force of touching struts to `generalized` (6*bodies,): torque and
    force [t_W; f_W] at each body's origin.

    `parts` is a Model and its Forces. `state` is [q; v] (13*bodies,). Returns the longest step (s),
    at most `horizon` (s), that cannot carry a strut through another; see capsules.time_to_pass().
    Also writes nodes to the Forces.
    """
    robot, forces = unpacked(parts)
    nodes, law, near = forces.nodes, robot.strut_contact, forces.near_struts
    kinematics.move_nodes(state, robot.p_BN, robot.first_node, nodes)
    add_strut_forces(robot, state, forces)
    kinematics.gather_forces(nodes, robot.first_node, generalized)
    return capsules.time_to_pass(robot.struts, law, nodes, near, horizon)


def forces_of_motion(
    robot: Model, states: np.ndarray, modes: np.ndarray, signals: np.ndarray, drives: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Node motions, cable forces and ground forces at each of the k times of a recorded motion.

    The motion has states [q; v] (k, 13*bodies), contact and friction modes (k, contacts,
    MODE_COLUMNS), signals (k, m) in N, and actuator states `drives` (k, drives). Returns the tables
    `nodes` (k, nodes, NODE_COLUMNS), without the lowest points of round feet, `cable_forces` (k,
    cables, CABLE_FORCE_COLUMNS) and `ground_forces` (k, contacts, GROUND_FORCE_COLUMNS).
    """
    return forces_along(Packed((robot, Forces.of(robot))), states, modes, signals, drives)


@compiled
def forces_along(
    parts: Parts, states: Table, modes: Table, signals: Table, drives: Table
) -> tuple[Table, Table, Table]:
    """The tables of forces_of_motion(); `parts` is a Model and its Forces, the other arguments are
    the same."""
    robot, forces = unpacked(parts)
    samples, contacts = states.shape[0], modes.shape[1]
    nodes = np.empty((samples, robot.p_BN.shape[0], kinematics.NODE_COLUMNS))
    cable_forces = np.empty((samples, forces.cable_forces.shape[0], cable.CABLE_FORCE_COLUMNS))
    ground_forces = np.empty((samples, contacts, contact.GROUND_FORCE_COLUMNS))
    for k in range(samples):
        compute_forces_at(robot, states[k], modes[k], signals[k], drives[k], forces)
        copy_rows(forces.nodes, nodes[k])
        copy_rows(forces.cable_forces, cable_forces[k])
        copy_rows(forces.ground_forces, ground_forces[k])
    return nodes, cable_forces, ground_forces


@inlined
def compute_forces_at(
    robot: Model, state: Table, modes: Table, signals: Table, drives: Table, forces: Forces
) -> None:
    """Writes all tables of `forces` for a state [q; v] (13*bodies,), contact and friction modes
    (contacts, 12), signals (N) and actuator states `drives` (drives,)."""
    generalized = np.empty(6 * robot.bodies.mass.size)
    move_robot(robot, state, forces)
    for i in range(drives.size):
        forces.drives[i, actuator.DRIVE] = drives[i]
    compute_forces(robot, state, modes, signals, True, forces, generalized)


@inlined
def copy_rows(table: Table, rows: Table) -> None:
    """Copies the first rows of `table` to the table `rows`, as many as `rows` has. Copies the first
    columns only, if `rows` has fewer."""
    for i in range(rows.shape[0]):
        for c in range(rows.shape[1]):
            rows[i, c] = table[i, c]
