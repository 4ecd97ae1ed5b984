"""Equations of motion: free rigid bodies under the forces of cables, ground and gravity.

A vector over bodies has 6 numbers per body, rotation before translation, in the world frame.
"""

from __future__ import annotations

import functools
import itertools
from typing import Annotated, NamedTuple, Self, TypeAlias

import numpy as np

from tetra_drake.engines.lanes.touching import Touching
from tetra_drake.kernels.compiling import compiled, inlined, merged
from tetra_drake.kernels.lanes import Real, Table, any_lane, named, select
from tetra_drake.laws import contact, inertia
from tetra_drake.laws.cable import DIRECTION, TENSION_PER_RATE
from tetra_drake.laws.dry_friction import DAMPING, spin_friction
from tetra_drake.laws.forces import Forces, joint_spin, put_slip_slopes
from tetra_drake.laws.friction import friction_damping
from tetra_drake.laws.kinematics import P_BN_W
from tetra_drake.laws.model import WORLD, Joints, Model, carriers_of
from tetra_drake.laws.sparse import BLOCK, Schedule
from tetra_drake.laws.terrain import to_world
from tetra_drake.laws.vectors import Vector3, cross, dot, put_vector, vector_at

CABLES_AT_ONCE = 6
"""Number of cables of a pair of bodies whose damping is summed at once."""

U, W, D, WEIGHT, LINE_COLUMNS = 0, 3, 6, 9, 10
"""Columns of the table `lines` for a cable: first columns of the vectors u, w and d (see
add_cables()), the damping times the time, and the number of columns."""


BodyPairs: TypeAlias = tuple[tuple[int, int], ...]


class StepMemory(NamedTuple):
    """Memory of a step from `state` to `end`, the states [q; v] (13*bodies,) of the bodies. For its
    stages see ros2."""

    state: Annotated[Table, "13 * bodies"]
    end: Annotated[Table, "13 * bodies"]
    force: Annotated[Table, "6 * bodies"]
    """Force at the beginning of the step."""
    end_force: Annotated[Table, "6 * bodies"]
    end_signals: Annotated[Table, "signals"]
    """Signals (N) at the end of the step."""
    change: Annotated[Table, "6 * bodies"]
    """Change of the force, γ h df/dt."""
    k1: Annotated[Table, "6 * bodies"]
    k2: Annotated[Table, "6 * bodies"]
    velocity: Annotated[Table, "6 * bodies"]
    """Velocity v at the beginning of the step."""
    q1: Annotated[Table, "6 * bodies"]
    mean_rate: Annotated[Table, "6 * bodies"]
    """Mean rate of the positions, 3/2 q1 + 1/2 q2."""
    blocks: Annotated[Table, "blocks", BLOCK, BLOCK]
    """Implicit matrix; see sparse."""
    touching: Touching
    """Contacts of struts in the implicit matrix."""
    lines: Annotated[Table, CABLES_AT_ONCE, LINE_COLUMNS]
    inertia: Annotated[Table, "bodies", inertia.INERTIA_COLUMNS]
    """Inertia at the beginning of the step."""


class Solver(NamedTuple):
    """Positions of the 6 x 6 blocks of the implicit matrix in memory, and the order of elimination
    of the bodies; see implicit_matrix()."""

    schedule: Schedule
    coupled: Table
    """Index of the block of each pair of coupled bodies (pairs,)."""
    fill: Table
    """Indices of all other blocks of two bodies: of joints, routed cables and fill-in."""
    jointed: Table
    """Index of the block of each joint (joints,)."""
    routed: Table
    """Index of the block of each ordered pair of nodes on the path of a routed cable, one cable
    after the other (pairs of path nodes,). -1 if a node is fixed, or if the pair in the other order
    has the block."""

    @classmethod
    def of(cls, robot: Model) -> Self:
        """The solver for a robot, whose bodies are coupled in pairs by cables and joints."""
        couplings, joints, routes = robot.couplings, robot.joints, robot.cables.routes
        carriers = carriers_of(robot.first_node, nodes=len(robot.p_BN))
        paths = np.split(carriers[routes.nodes], routes.first[1:-1])
        on_paths = [pair for path in paths for pair in itertools.product(path.tolist(), repeat=2)]
        return cls._of(
            len(robot.bodies.mass),
            tuple(zip(couplings.first.tolist(), couplings.second.tolist(), strict=True)),
            tuple(zip(joints.body_a.tolist(), joints.body_b.tolist(), strict=True)),
            tuple(on_paths),
        )

    @classmethod
    @functools.lru_cache(maxsize=8)  # most robots of a run have the same couplings
    def _of(cls, bodies: int, coupled: BodyPairs, jointed: BodyPairs, on_paths: BodyPairs) -> Self:
        """The solver for the pairs of bodies that straight cables, joints and paths join."""
        moving = [(a, b) for a, b in on_paths if WORLD < a < b]
        schedule = Schedule.of(bodies, [*coupled, *jointed, *moving])
        blocks = schedule.blocks | {(body, body): body for body in range(bodies)}
        either = {(b, a): block for (a, b), block in blocks.items()} | blocks
        of_pairs = [
            np.array([found.get(pair, -1) for pair in pairs], dtype=np.int64)
            for pairs, found in ((coupled, either), (jointed, either), (on_paths, blocks))
        ]
        fill = np.setdiff1d(np.arange(bodies, len(schedule.later)), of_pairs[0])
        return cls(schedule, of_pairs[0], fill, jointed=of_pairs[1], routed=of_pairs[2])

    def oriented(self, robot: Model) -> Model:
        """The robot for implicit_matrix(). Of the two bodies of a pair or joint, the first one is
        the one that is eliminated first; cables run from it to the other one."""
        couplings, cables, joints = robot.couplings, robot.cables, robot.joints
        position = np.argsort(self.schedule.order)
        turned = position[couplings.first] > position[couplings.second]
        first, second = _swapped(couplings.first, couplings.second, turned)
        of_cables = np.zeros(cables.node_a.size, dtype=bool)
        count = np.diff(couplings.first_cable)
        of_cables[couplings.first_cable[0] :][: count.sum()] = np.repeat(turned, count)
        node_a, node_b = _swapped(cables.node_a, cables.node_b, of_cables)
        of_joints = position[joints.body_a] > position[joints.body_b]
        nodes = _swapped(joints.node_a, joints.node_b, of_joints)
        bodies = _swapped(joints.body_a, joints.body_b, of_joints)
        return robot._replace(
            couplings=couplings._replace(first=first, second=second),
            cables=cables._replace(node_a=node_a, node_b=node_b),
            joints=Joints(*nodes, *bodies, *joints[4:]),
        )


def _swapped(a: np.ndarray, b: np.ndarray, where: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.where(where, b, a), np.where(where, a, b)


@inlined
def accelerate(robot: Model, inertia_W: Table, force: Table, acceleration: Table) -> None:
    """Writes the accelerations (6*bodies,) of bodies under `force` (6*bodies,) to `acceleration`.

    Each body has 6 numbers, rotation before translation, in the world frame. `inertia_W` is
    Forces.inertia: the inertia of each body about the world's axes.
    """
    for body in range(force.size // BLOCK):
        i = BLOCK * body
        per_mass = 1.0 / robot.bodies.mass[body]
        if robot.isotropic:
            per_moment = 1.0 / robot.bodies.inertia[body, inertia.XX]
            turns = force[i] * per_moment, force[i + 1] * per_moment, force[i + 2] * per_moment
        else:
            turns = inertia.over_inertia(inertia_W, body, (force[i], force[i + 1], force[i + 2]))
        acceleration[i], acceleration[i + 1], acceleration[i + 2] = turns
        for j in range(3, BLOCK):
            acceleration[i + j] = force[i + j] * per_mass


@inlined
def momentum(robot: Model, inertia_W: Table, velocity: Table, body: int) -> tuple[Real, ...]:
    """Momentum (6 numbers) of body number `body`: its mass matrix times its part of `velocity`
    (6*bodies,), the velocities of all bodies.

    Each body has 6 numbers, rotation before translation, in the world frame. `inertia_W` is
    Forces.inertia: the inertia of each body about the world's axes.
    """
    i, mass = BLOCK * body, robot.bodies.mass[body]
    if robot.isotropic:
        moment = robot.bodies.inertia[body, inertia.XX]
        turns = moment * velocity[i], moment * velocity[i + 1], moment * velocity[i + 2]
    else:
        w_WB = velocity[i], velocity[i + 1], velocity[i + 2]
        turns = inertia.times_inertia(inertia_W, body, w_WB)
    moves = mass * velocity[i + 3], mass * velocity[i + 4], mass * velocity[i + 5]
    return turns[0], turns[1], turns[2], moves[0], moves[1], moves[2]


@merged
def implicit_matrix(
    robot: Model, solver: Solver, work: StepMemory, modes: Table, forces: Forces, time: Real
) -> None:
    """Writes the implicit matrix of a step, which multiplies the unknown velocity rates, to
    `work.blocks`: mass matrix + time * damping matrix + time² * stiffness of contacts and anchors.

    There is a block per body and per pair of coupled bodies; see module sparse. Of a symmetric
    block only the upper half is written. `work.state` and `modes` are at the beginning of the step,
    and `forces` was computed for them. `time` is in s, a share of the step. The damping of cables,
    normal forces and stiction makes the equations stiff.
    """
    blocks = work.blocks
    for body in range(robot.bodies.mass.size):
        for r in range(BLOCK):
            for c in range(r, BLOCK):
                blocks[body, r, c] = 0.0
    for i in range(solver.fill.size):  # the others are written by add_cables()
        for r in range(BLOCK):
            for c in range(BLOCK):
                blocks[solver.fill[i], r, c] = 0.0
    couplings = robot.couplings
    for pair in range(solver.coupled.size):
        first, last = couplings.first_cable[pair], couplings.first_cable[pair + 1]
        for cable in range(first, last, CABLES_AT_ONCE):
            add_cables(robot, work, forces, time, pair, cable, solver.coupled[pair])
    for i in range(couplings.held.size):  # cables from fixed nodes
        node, body = robot.cables.node_b[i], couplings.held[i]
        damping = time * forces.cable_forces[i, TENSION_PER_RATE]
        x, y, z = vector_at(forces.cable_forces, i, DIRECTION)
        diagonal = damping * x * x, damping * y * y, damping * z * z
        add_diagonal(forces.nodes, node, body, diagonal, blocks)
        across = damping * x * y, damping * x * z, damping * y * z
        add_off_diagonal(forces.nodes, node, body, across, blocks)
    for body in range(robot.bodies.mass.size):
        mass, inertia_W = robot.bodies.mass[body], forces.inertia
        if robot.isotropic:
            for r in range(3):
                blocks[body, r, r] += robot.bodies.inertia[body, inertia.XX]
        else:
            blocks[body, 0, 0] += inertia_W[body, inertia.XX]
            blocks[body, 1, 1] += inertia_W[body, inertia.YY]
            blocks[body, 2, 2] += inertia_W[body, inertia.ZZ]
            blocks[body, 0, 1] += inertia_W[body, inertia.XY]
            blocks[body, 0, 2] += inertia_W[body, inertia.XZ]
            blocks[body, 1, 2] += inertia_W[body, inertia.YZ]
        for r in range(3, BLOCK):
            blocks[body, r, r] += mass
    for i in range(robot.ground.contacts.size):
        if any_lane(modes[i, contact.CONTACT] != 0.0):
            add_contact(robot, work.state, modes, forces, i, time, blocks)
    anchors = robot.anchors
    for i in range(anchors.nodes.size):
        k_x, k_y, k_z = vector_at(anchors.stiffness, i, 0)
        c_x, c_y, c_z = vector_at(anchors.damping, i, 0)
        k = time * (c_x + time * k_x), time * (c_y + time * k_y), time * (c_z + time * k_z)
        add_diagonal(forces.nodes, anchors.nodes[i], anchors.carriers[i], k, blocks)
    if robot.joints.node_a.size or robot.cables.routes.nodes.size:
        add_joints_and_routes(robot, solver, work.state, forces, time, blocks)


@inlined
def add_cables(
    robot: Model, work: StepMemory, forces: Forces, time: Real, pair: int, first: int, block: int
) -> None:
    """Adds the damping of a pair's cables to the implicit matrix, as time * damping * l lᵀ.

    `pair` is the number of a pair of bodies that cables join, `block` the number of their block. At
    most CABLES_AT_ONCE (6) of the pair's cables are added, from cable number `first` of the robot
    on. `time` is in s. The cables' directions and dampings are read from `forces`.

    The 12 numbers of l, times the velocities of both bodies, are the rate of the cable's length.
    With the cable's direction d and its ends p_a and p_b, relative to the origins of their bodies,
    l = (u, -d, w, d), u = d x p_a and w = p_b x d. The sum over cables is a product of two columns
    of `lines`.
    """
    lines, blocks = work.lines, work.blocks
    last, cable_forces = robot.couplings.first_cable[pair + 1], forces.cable_forces
    for j in range(CABLES_AT_ONCE):
        i = first + j
        if i >= last:  # there is no further cable
            for c in range(LINE_COLUMNS):
                lines[j, c] = 0.0
            continue
        direction = vector_at(cable_forces, i, DIRECTION)
        p_a = vector_at(forces.nodes, robot.cables.node_a[i], P_BN_W)
        p_b = vector_at(forces.nodes, robot.cables.node_b[i], P_BN_W)
        put_vector(cross(direction, p_a), j, U, lines)
        put_vector(cross(p_b, direction), j, W, lines)
        put_vector(direction, j, D, lines)
        lines[j, WEIGHT] = time * cable_forces[i, TENSION_PER_RATE]

    rear, front = robot.couplings.first[pair], robot.couplings.second[pair]
    adds = first > robot.couplings.first_cable[pair]  # the block has a sum already
    weights = column(lines, WEIGHT)
    for r in range(3):
        u = weighted(weights, column(lines, U + r))
        w = weighted(weights, column(lines, W + r))
        d = weighted(weights, column(lines, D + r))
        for c in range(r, 3):
            blocks[rear, r, c] += product(u, column(lines, U + c))
            blocks[front, r, c] += product(w, column(lines, W + c))
            dd = product(d, column(lines, D + c))
            blocks[rear, 3 + r, 3 + c] += dd
            blocks[front, 3 + r, 3 + c] += dd
            put(-dd, adds, block, 3 + r, 3 + c, blocks)
            if c > r:
                put(-dd, adds, block, 3 + c, 3 + r, blocks)
        for c in range(3):
            put(product(u, column(lines, W + c)), adds, block, r, c, blocks)
            ud = product(u, column(lines, D + c))
            blocks[rear, r, 3 + c] -= ud
            put(ud, adds, block, r, 3 + c, blocks)
            wd = product(w, column(lines, D + c))
            blocks[front, r, 3 + c] += wd
            put(-wd, adds, block, 3 + c, r, blocks)


@functools.partial(compiled, nogil=True)  # a call of its own: inlined, it slows other robots
def add_joints_and_routes(
    robot: Model, solver: Solver, state: Table, forces: Forces, time: Real, blocks: Table
) -> None:
    """Adds joints, as time * damping + time² * stiffness, and the damping of routed cables and of
    the friction at their rings, as time * damping * l lᵀ, to the implicit matrix `blocks`. `time`
    is in s.

    A body's part of l is the sum of (p x s, s) over its nodes on the path, at p from its origin,
    with the derivative s of the cable's length, or of the slip at a ring, by the node's position.
    """
    joints, nodes = robot.joints, forces.nodes
    for i in range(joints.node_a.size):
        k = time * (joints.damping[i] + time * joints.stiffness[i])
        add_diagonal(nodes, joints.node_a[i], joints.body_a[i], (k, k, k), blocks)
        add_diagonal(nodes, joints.node_b[i], joints.body_b[i], (k, k, k), blocks)
        add_joint(nodes, joints.node_a[i], joints.node_b[i], solver.jointed[i], k, blocks)
        if any_lane(joints.friction[i] > 0.0):
            w = joint_spin(robot, state, i)
            per_spin, less = spin_friction(w, joints.friction[i])
            for r in range(3):
                for c in range(3):
                    added = time * ((per_spin if r == c else 0.0) - less * w[r] * w[c])
                    blocks[joints.body_a[i], r, c] += added
                    blocks[joints.body_b[i], r, c] += added
                    blocks[solver.jointed[i], r, c] -= added
    routes, rings, pair = robot.cables.routes, forces.rings, 0
    for i in range(robot.couplings.first_cable[solver.coupled.size], robot.cables.signal.size):
        first, last = routes.first[i], routes.first[i + 1] - 1
        rubs, begins = any_lane(robot.cables.law.mu[i] > 0.0), pair
        for ring in range(first, last if rubs else first + 1):  # at first the length
            slopes, damping = forces.route_slopes, forces.cable_forces[i, TENSION_PER_RATE]
            if ring > first:
                slopes, damping = forces.slip_slopes, rings[ring, DAMPING]
                put_slip_slopes(first, ring, last, forces)
            damping, pair = time * damping, begins
            for a in range(first, last + 1):
                for b in range(first, last + 1):
                    block = solver.routed[pair]
                    pair += 1
                    if block < 0:
                        continue
                    l_a = of_path(forces, routes.nodes[a], vector_at(slopes, a, 0))
                    l_b = of_path(forces, routes.nodes[b], vector_at(slopes, b, 0))
                    is_own = block < robot.bodies.mass.size
                    for r in range(BLOCK):
                        for c in range(r if is_own else 0, BLOCK):
                            blocks[block, r, c] += damping * l_a[r] * l_b[c]


@inlined
def of_path(forces: Forces, node: int, slope: Vector3) -> tuple[Real, ...]:
    """Part of a node in the rate of a routed cable's length, or in a slip: its product with the
    velocity of the node's body. `slope` is the derivative by the node's position."""
    return *cross(vector_at(forces.nodes, node, P_BN_W), slope), *slope


@inlined
def add_joint(nodes: Table, a: int, b: int, block: int, k: Real, blocks: Table) -> None:
    """Adds -J_aᵀ k J_b of two nodes a and b to the block of their bodies in the implicit matrix.
    For J see add_diagonal()."""
    p_a, p_b = vector_at(nodes, a, P_BN_W), vector_at(nodes, b, P_BN_W)
    across = dot(p_a, p_b)
    for r in range(3):
        for c in range(3):
            blocks[block, r, c] += k * p_b[r] * p_a[c]
        blocks[block, r, r] -= k * across
        blocks[block, 3 + r, 3 + r] -= k
    for r, c, after in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        blocks[block, r, 3 + c] += k * p_a[after]
        blocks[block, c, 3 + r] -= k * p_a[after]
        blocks[block, 3 + r, c] -= k * p_b[after]
        blocks[block, 3 + c, r] += k * p_b[after]


@inlined
def put(value: Real, adds: bool, block: int, r: int, c: int, blocks: Table) -> None:
    """Writes a number to row r and column c of block number `block` of `blocks`, or adds it to the
    number there if `adds`.

    If all blocks were set to zero first, to add only, a step would take 2 to 5 % longer.
    """
    if adds:
        blocks[block, r, c] += value
    else:
        blocks[block, r, c] = value


# Columns of `lines` are tuples, as registers are not filled from loops over six numbers.

Column = tuple[Real, Real, Real, Real, Real, Real]


@inlined
def column(lines: Table, c: int) -> Column:
    """Column c of the table `lines` (6, LINE_COLUMNS) of add_cables(): a number for each of 6
    cables."""
    return lines[0, c], lines[1, c], lines[2, c], lines[3, c], lines[4, c], lines[5, c]


@inlined
def weighted(w: Column, x: Column) -> Column:
    """Column x with each number multiplied by its weight in w."""
    return w[0] * x[0], w[1] * x[1], w[2] * x[2], w[3] * x[3], w[4] * x[4], w[5] * x[5]


@inlined
def product(x: Column, y: Column) -> Real:
    """Scalar product of two columns of add_cables(): a sum over 6 cables."""
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2] + x[3] * y[3] + x[4] * y[4] + x[5] * y[5]


@inlined
def add_contact(
    robot: Model, state: Table, modes: Table, forces: Forces, i: int, time: Real, blocks: Table
) -> None:
    """Adds the contact of a foot to the implicit matrix `blocks`, in lanes where the foot touches.

    The foot is contact node number `i`. What is added is time * damping + time² * stiffness of the
    ground, along its normal and its tangents, with `time` in s. `state`, `modes` and `forces` are
    only read.
    """
    ground, nodes, frames = robot.ground, forces.nodes, forces.frames
    law = named(contact.NormalForce, ground.normal)
    touches, node, body = modes[i, contact.CONTACT] != 0.0, ground.contacts[i], ground.carriers[i]
    depth = -contact.gap(nodes, ground, frames, i)
    slide, _ = contact.sliding(state, nodes, modes, ground, frames, i)
    k_1, k_12, k_2 = friction_damping(ground.friction, slide, time)
    k_1, k_2 = select(touches, k_1, 0.0), select(touches, k_2, 0.0)
    k_12 = select(touches, k_12, 0.0)
    presses = touches & (forces.ground_forces[i, contact.NORMAL] > 0.0)
    k_n = select(presses, time * (law.damping * depth + time * law.stiffness), 0.0)
    # Turns the matrix K of the contact frame into the world frame: R K, then (R K) Rᵀ.
    a = to_world(k_1, k_12, 0.0, frames, i, ground.flat)
    b = to_world(k_12, k_2, 0.0, frames, i, ground.flat)
    c = to_world(0.0, 0.0, k_n, frames, i, ground.flat)
    x = to_world(a[0], b[0], c[0], frames, i, ground.flat)
    y = to_world(a[1], b[1], c[1], frames, i, ground.flat)
    z = to_world(a[2], b[2], c[2], frames, i, ground.flat)
    add_diagonal(nodes, node, body, (x[0], y[1], z[2]), blocks)
    xy, xz, yz = x[1], x[2], y[2]
    if any_lane((xy != 0.0) | (xz != 0.0) | (yz != 0.0)):
        add_off_diagonal(nodes, node, body, (xy, xz, yz), blocks)


@inlined
def add_diagonal(
    nodes: Table, node: int, body: int, k: tuple[Real, Real, Real], blocks: Table
) -> None:
    """Adds Jᵀ diag(k_x, k_y, k_z) J of a node to its body's block of the implicit matrix.

    `node` is the node's row in `nodes`, `body` the number of its body. `k` is (k_x, k_y, k_z),
    along the world's axes. The node is at p from the body's origin, in the world frame. J = [-[p]x
    1] gives the node's velocity from the body's.
    """
    p_x, p_y, p_z = nodes[node, P_BN_W], nodes[node, P_BN_W + 1], nodes[node, P_BN_W + 2]
    k_x, k_y, k_z = k
    blocks[body, 0, 0] += p_y * p_y * k_z + p_z * p_z * k_y
    blocks[body, 1, 1] += p_z * p_z * k_x + p_x * p_x * k_z
    blocks[body, 2, 2] += p_x * p_x * k_y + p_y * p_y * k_x
    blocks[body, 0, 1] -= p_x * p_y * k_z
    blocks[body, 0, 2] -= p_x * p_z * k_y
    blocks[body, 1, 2] -= p_y * p_z * k_x
    blocks[body, 0, 4] -= p_z * k_y
    blocks[body, 0, 5] += p_y * k_z
    blocks[body, 1, 3] += p_z * k_x
    blocks[body, 1, 5] -= p_x * k_z
    blocks[body, 2, 3] -= p_y * k_x
    blocks[body, 2, 4] += p_x * k_y
    blocks[body, 3, 3] += k_x
    blocks[body, 4, 4] += k_y
    blocks[body, 5, 5] += k_z


@inlined
def add_off_diagonal(
    nodes: Table, node: int, body: int, k: tuple[Real, Real, Real], blocks: Table
) -> None:
    """Adds Jᵀ K J of a node to its body's block of the implicit matrix. `k` is k_xy, k_xz and k_yz,
    the elements of the symmetric matrix K beside its diagonal, which is 0 here.

    For J and the other arguments see add_diagonal().
    """
    p_x, p_y, p_z = nodes[node, P_BN_W], nodes[node, P_BN_W + 1], nodes[node, P_BN_W + 2]
    xy, xz, yz = k
    # The rows of [p]x K.
    a = p_y * xz - p_z * xy, p_y * yz, -p_z * yz
    b = -p_x * xz, p_z * xy - p_x * yz, p_z * xz
    c = p_x * xy, -p_y * xy, p_x * yz - p_y * xz
    blocks[body, 0, 0] += p_y * a[2] - p_z * a[1]
    blocks[body, 0, 1] += p_z * a[0] - p_x * a[2]
    blocks[body, 0, 2] += p_x * a[1] - p_y * a[0]
    blocks[body, 1, 1] += p_z * b[0] - p_x * b[2]
    blocks[body, 1, 2] += p_x * b[1] - p_y * b[0]
    blocks[body, 2, 2] += p_x * c[1] - p_y * c[0]
    for column in range(3):
        blocks[body, 0, 3 + column] += a[column]
        blocks[body, 1, 3 + column] += b[column]
        blocks[body, 2, 3 + column] += c[column]
    blocks[body, 3, 4] += xy
    blocks[body, 3, 5] += xz
    blocks[body, 4, 5] += yz
