"""How a robot rests on flat ground while its cables are not actuated."""

from __future__ import annotations

import contextlib
from typing import NamedTuple

import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.physics.cable import LENGTH, PASSIVE, PULL_COLUMNS, TENSION, add_cable_forces
from tetra_drake.physics.contact import (
    MODE_COLUMNS,
    Ground,
    NormalForce,
    add_ground_forces,
    meet_ground,
    update_modes,
)
from tetra_drake.physics.kinematics import NODE_COLUMNS, gather_forces, move_bodies
from tetra_drake.physics.terrain import FRAME_COLUMNS
from tetra_drake.robot.bodies import tetrahedron_inertia
from tetra_drake.robot.ground import make_ground
from tetra_drake.robot.structure import MakeStructure
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.terrain_kinds import Flat
from tetra_drake.simd.compiling import compiled
from tetra_drake.simd.lanes import Table

TOLERANCE = 1e-11
"""Greatest force left over, as a share of the greatest tension or of the robot's weight."""

ITERATIONS = 1000
FIRST_REACH, LONGEST_REACH = 0.05, 0.2
"""How far a step of Newton's method may take a body, as a share of its radius."""

OVERSHOOT = 0.9
"""A step is too long if the forces work against it at its end by more than this share of the work
they began with."""

DIFFERENCE = 1e-7
"""Of finite differences: how far a body moves, as a share of its radius."""

LEAST_STIFFNESS = 1e-9
"""Of a motion for it to count as stable, as a share of the ground's stiffness."""

LENGTH_DIGITS = 9
"""Digits of a settled length (m) behind the point. What follows depends on the processor, as the
linear algebra does, and a walk with feedback would enlarge it."""


class Resting(NamedTuple):
    """What the forces on bodies at rest depend on, in SI units, and room to compute them in."""

    p_BN: Table
    cables: Table
    slack: bool
    ground: Ground
    weight: float
    """Of a body."""
    radius: float
    """Of a body: the lever by which torques count as forces and rotations as displacements."""
    nodes: Table
    frames: Table
    pulls: Table
    """(cables, PULL_COLUMNS), of the state that was last computed; so are `pushes`."""
    pushes: Table
    """(contacts, 3)."""


def settled_state(scenario: Scenario) -> np.ndarray:
    """(13 n,): [q; v] of the bodies at rest on flat ground without actuation, whatever the
    scenario's terrain and offsets.

    It is the minimum of potential energy downhill from the start of an undisturbed robot; friction
    carries nothing. Raises InputError if there is none.
    """
    return _settle(scenario)[0]


def settled_lengths(scenario: Scenario) -> np.ndarray:
    """(cables,): the lengths of the cables in the settled state, in whole nm. Raises as that
    does."""
    return np.round(_settle(scenario)[1].pulls[:, LENGTH], LENGTH_DIGITS)


def _settle(scenario: Scenario) -> tuple[np.ndarray, Resting]:
    """The settled state, and the robot with its tables as they are there."""
    undisturbed = scenario.robot.model_copy(update={"offsets": []})
    state, robot = _start(scenario.with_sections(terrain=Flat(), robot=undisturbed))
    reach = FIRST_REACH * robot.radius
    for _ in range(ITERATIONS):
        force = force_at_rest(robot, state)
        greatest = max(np.abs(robot.pulls[:, TENSION]).max(), robot.weight * force.size / 6)
        if np.abs(force).max() <= TOLERANCE * greatest:
            return state, robot
        step = _newton_step(robot, state, force)
        step *= min(1.0, reach / np.abs(step).max())
        moved = displaced(robot, state, step)
        if force_at_rest(robot, moved) @ step < -OVERSHOOT * (force @ step):
            reach = 0.5 * np.abs(step).max()
        else:
            state, reach = moved, min(2.0 * reach, LONGEST_REACH * robot.radius)
    problem = f"{len(state) // 13} tetrahedra come to no rest on flat ground without actuation"
    raise InputError(scenario.name, "robot", problem)


def _start(scenario: Scenario) -> tuple[np.ndarray, Resting]:
    """Where the robot starts, and the robot, no signal driving its cables."""
    structure = MakeStructure(scenario)
    cables, contacts = structure.cables.copy(), len(structure.contacts)
    cables["signal"] = PASSIVE
    robot = Resting(
        p_BN=structure.p_BN,
        cables=cables,
        slack=scenario.cables.slack,
        ground=make_ground(scenario, structure),
        weight=tetrahedron_inertia(structure).get_mass() * scenario.robot.gravity,
        radius=float(np.linalg.norm(structure.p_BN, axis=1).max()),
        nodes=np.empty((len(structure.node_names), NODE_COLUMNS)),
        frames=np.empty((contacts, FRAME_COLUMNS)),
        pulls=np.empty((len(cables), PULL_COLUMNS)),
        pushes=np.empty((contacts, 3)),
    )
    return structure.initial_state, robot


def _newton_step(robot: Resting, state: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Displacements (6 n,) that bring the force to zero where the potential energy is convex, and
    lead downhill where it is not; the robot as a whole stays where it is."""
    stiffness, held = stiffness_at_rest(robot, state), _free_motions(robot, state)
    hard, shift = NormalForce(*robot.ground.normal).stiffness, 0.0
    stiffness = 0.5 * (stiffness + stiffness.T) + hard * held @ held.T
    while shift < np.inf:
        shifted = stiffness + shift * np.eye(len(force))
        with contextlib.suppress(np.linalg.LinAlgError):  # not positive definite
            if np.linalg.cholesky(shifted).diagonal().min() ** 2 > LEAST_STIFFNESS * hard:
                return np.linalg.solve(shifted, force)
        shift = max(10.0 * shift, LEAST_STIFFNESS * hard)
    return np.full_like(force, np.nan)


def _free_motions(robot: Resting, state: np.ndarray) -> np.ndarray:
    """(6 n, 3): displacements of the whole robot along x, along y, and about z."""
    motions = np.zeros((len(state) // 13, 6, 3))
    p_WB = state[: 7 * len(motions)].reshape(-1, 7)[:, 4:]
    x, y = ((p_WB - p_WB.mean(axis=0)) / robot.radius)[:, :2].T
    motions[:, 3, 0] = motions[:, 4, 1] = motions[:, 2, 2] = 1.0
    motions[:, 3, 2], motions[:, 4, 2] = -y, x
    return motions.reshape(-1, 3)


@compiled
def force_at_rest(robot: Resting, state: Table) -> Table:
    """(6 n,): [t_W / radius; f_W] of all forces at each Bo; contact nodes stick where they are."""
    nodes, ground, frames = robot.nodes, robot.ground, robot.frames
    modes, force = np.zeros((robot.pushes.shape[0], MODE_COLUMNS)), np.empty(state.size // 13 * 6)
    meet_ground(state, robot.p_BN, ground, nodes, frames)
    update_modes(state, nodes, ground, frames, modes)
    add_cable_forces(nodes, np.zeros(1), robot.cables, robot.slack, True, robot.pulls)
    add_ground_forces(nodes, modes, ground, frames, True, robot.pushes)
    gather_forces(nodes, force)
    for body in range(force.size // 6):
        force[6 * body + 5] -= robot.weight
        force[6 * body : 6 * body + 3] /= robot.radius
    return force


@compiled
def displaced(robot: Resting, state: Table, step: Table) -> Table:
    """A state whose bodies have moved by `step`, (6 n,): rotation times radius, translation (m)."""
    moved, motion = state.copy(), step.copy()
    for body in range(step.size // 6):
        motion[6 * body : 6 * body + 3] /= robot.radius
    move_bodies(state, motion, 1.0, moved)
    return moved


@compiled
def stiffness_at_rest(robot: Resting, state: Table) -> Table:
    """(6 n, 6 n), in N/m: minus the derivative of the forces by the displacements."""
    count, half = state.size // 13 * 6, DIFFERENCE * robot.radius
    stiffness, motion = np.empty((count, count)), np.zeros(count)
    for j in range(count):
        motion[j] = half
        ahead = force_at_rest(robot, displaced(robot, state, motion))
        motion[j] = -half
        behind = force_at_rest(robot, displaced(robot, state, motion))
        motion[j] = 0.0
        stiffness[:, j] = (behind - ahead) / (2.0 * half)
    return stiffness
