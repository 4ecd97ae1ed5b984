"""States of the robot to test forces and rates on, and the velocities in a trajectory."""

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RotationMatrix
from pydrake.multibody.tree import RotationalInertia

from helpers.structures import poses_of
from tetra_drake.laws.model import Model
from tetra_drake.laws.struts import least_strut_distance
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import Structure, moved_nodes, node_positions


def disturbed(structure: Structure, seed: int, *, pose: float, speed: float) -> np.ndarray:
    """The start (13 n,) with normally distributed errors of all positions (m), quaternions,
    and velocities (m/s, rad/s)."""
    generator = np.random.default_rng(seed)
    state, bodies = structure.initial_state, len(structure.bodies)
    state[: 7 * bodies] += generator.normal(scale=pose, size=7 * bodies)
    state[7 * bodies :] = generator.normal(scale=speed, size=6 * bodies)
    quaternions = state[: 7 * bodies].reshape(bodies, 7)[:, :4]
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    return state


def mass_matrix(robot: Model, state: np.ndarray) -> np.ndarray:
    """Mass matrix (6 n, 6 n) from inertias that Drake has turned into World."""
    bodies = robot.bodies
    matrix = np.zeros((6 * len(bodies.mass), 6 * len(bodies.mass)))
    for i, (mass, inertia) in enumerate(zip(bodies.mass, bodies.inertia, strict=True)):
        R_WB = Quaternion(state[7 * i : 7 * i + 4]).rotation()
        turned = RotationalInertia(*inertia).ReExpress(RotationMatrix(R_WB))
        matrix[6 * i : 6 * i + 3, 6 * i : 6 * i + 3] = turned.CopyToFullMatrix3()
        matrix[6 * i + 3 : 6 * i + 6, 6 * i + 3 : 6 * i + 6] = mass * np.eye(3)
    return matrix


def energy_and_momenta(robot: Robot, state: np.ndarray) -> np.ndarray:
    """Energy of bodies and cables, momentum, and angular momentum about the origin: (7,)."""
    structure, poses = robot.structure, poses_of(state[np.newaxis])[0]
    velocities, cables = state[poses.size :], structure.cables
    wrench = (mass_matrix(robot.model, state) @ velocities).reshape(-1, 6)
    p_WN = node_positions(structure, state)
    lengths = np.linalg.norm(p_WN[cables["node_b"]] - p_WN[cables["node_a"]], axis=1)
    stretch = np.maximum(lengths - cables["free_length"], 0.0)
    energy = 0.5 * (velocities @ wrench.ravel() + cables["stiffness"] @ stretch**2)
    angular = (wrench[:, :3] + np.cross(poses[:, 4:], wrench[:, 3:])).sum(axis=0)
    return np.concatenate([[energy], wrench[:, 3:].sum(axis=0), angular])


def strut_clearance(robot: Robot, state: np.ndarray, least: float = np.inf) -> float:
    """The least distance (m) of struts of different bodies, or `least` if none are that near."""
    nodes, model = moved_nodes(robot.structure, state), robot.model
    radius, first_node = model.bodies.radius, model.first_node
    return least_strut_distance(model.struts, radius, first_node, state, nodes, least)
