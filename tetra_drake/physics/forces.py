"""All forces on a robot, by cables, ground and gravity, at a state of its bodies."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np

from tetra_drake.physics.actuator import DIRECT, DRIVE, DRIVE_COLUMNS
from tetra_drake.physics.cable import PASSIVE, PULL_COLUMNS, add_cable_forces
from tetra_drake.physics.contact import PUSH_COLUMNS, add_ground_forces, meet_ground
from tetra_drake.physics.inertia import INERTIA_COLUMNS, gyroscopic_torque, turn_inertia
from tetra_drake.physics.kinematics import NODE_COLUMNS, gather_forces
from tetra_drake.physics.model import Model
from tetra_drake.physics.terrain import FRAME_COLUMNS
from tetra_drake.simd.compiling import compiled, inlined
from tetra_drake.simd.lanes import Table


class Forces(NamedTuple):
    """The forces at a state, as in `physics`, which kernels write."""

    nodes: Table
    """(nodes, NODE_COLUMNS)."""
    frames: Table
    """(contacts, FRAME_COLUMNS): where the nodes meet the ground."""
    pulls: Table
    """(cables, PULL_COLUMNS): of the cables."""
    pushes: Table
    """(contacts, PUSH_COLUMNS): of the ground."""
    inertia: Table
    """(bodies, INERTIA_COLUMNS): of the bodies along World's axes, unless they are isotropic."""
    drives: Table
    """(drives, DRIVE_COLUMNS): of winches or tension motors, in the order of their cables. What
    forces are computed from is given; the rest is written."""

    @classmethod
    def of(cls, robot: Model) -> Self:
        """Room for the forces on a robot."""
        cables, contacts = robot.cables.size, robot.ground.contacts.size
        driven = np.count_nonzero(robot.cables["signal"] != PASSIVE)
        drives = 0 if robot.actuator.kind == DIRECT else driven
        return cls(
            nodes=np.zeros((len(robot.p_BN), NODE_COLUMNS)),
            frames=np.zeros((contacts, FRAME_COLUMNS)),
            pulls=np.zeros((cables, PULL_COLUMNS)),
            pushes=np.zeros((contacts, PUSH_COLUMNS)),
            inertia=np.zeros((len(robot.bodies.mass), INERTIA_COLUMNS)),
            drives=np.zeros((drives, DRIVE_COLUMNS)),
        )


@inlined
def move_robot(robot: Model, state: Table, forces: Forces) -> None:
    """Moves the nodes to where a state (13 bodies,) has them; no forces act on them yet."""
    nodes, frames = forces.nodes, forces.frames
    meet_ground(state, robot.p_BN, robot.first_node, robot.ground, nodes, frames)
    if not robot.isotropic:
        turn_inertia(state, robot.bodies.inertia, forces.inertia)


@inlined
def compute_forces(
    robot: Model,
    state: Table,
    modes: Table,
    signals: Table,
    keep: bool,
    forces: Forces,
    generalized: Table,
) -> None:
    """Writes all forces at a state to which the robot has just been moved, with gravity and
    gyroscopic torques, as (6 bodies,).

    With `keep`, those of the cables and the ground by themselves, too.
    """
    add_cable_forces(
        forces.nodes,
        signals,
        robot.cables,
        robot.actuator,
        robot.slack,
        keep,
        forces.drives,
        forces.pulls,
    )
    add_ground_forces(forces.nodes, modes, robot.ground, forces.frames, keep, forces.pushes)
    gather_forces(forces.nodes, robot.first_node, generalized)
    bodies = generalized.size // 6
    for body in range(bodies):
        generalized[6 * body + 5] -= robot.bodies.weight[body]
    if robot.isotropic:
        return
    for body in range(bodies):
        t, v = 6 * body, 7 * bodies + 6 * body
        w_WB = state[v], state[v + 1], state[v + 2]
        t_x, t_y, t_z = gyroscopic_torque(forces.inertia, body, w_WB)
        generalized[t] += t_x
        generalized[t + 1] += t_y
        generalized[t + 2] += t_z


@compiled
def forces_along(
    robot: Model,
    states: Table,
    modes: Table,
    signals: Table,
    drives: Table,
    forces: Forces,
    pulls: Table,
    pushes: Table,
) -> None:
    """Writes the `pulls` (k, cables, PULL_COLUMNS) and `pushes` (k, contacts, PUSH_COLUMNS) at
    states (k, 13 bodies) with modes (k, contacts, MODE_COLUMNS), signals (k, m) in N and drives
    (k, drives)."""
    generalized = np.empty(6 * (states.shape[1] // 13))
    for k in range(states.shape[0]):
        move_robot(robot, states[k], forces)
        forces.drives[:, DRIVE] = drives[k]
        compute_forces(robot, states[k], modes[k], signals[k], True, forces, generalized)
        pulls[k] = forces.pulls
        pushes[k] = forces.pushes
