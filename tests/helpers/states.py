"""States of the robot to test forces and rates on, and the velocities in a trajectory."""

import numpy as np
import xarray
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RotationMatrix
from pydrake.multibody.tree import RotationalInertia

from tetra_drake.physics.model import Model
from tetra_drake.robot.structure import Structure


def body_velocities(walk: xarray.Dataset, structure: Structure) -> tuple[np.ndarray, np.ndarray]:
    """(time, n, 3) each: velocity (m/s) and angular velocity (rad/s) of the bodies, from the nodes:
    sum r x (w x r) = 8/3 r^2 w."""
    bodies = len(structure.bodies)
    p_WN, v_WN = (walk[name].values.reshape(-1, bodies, 4, 3) for name in ("p_WN", "v_WN"))
    v_WB = v_WN.mean(axis=2)
    p_BN, v_BN = p_WN - walk.p_WB.values[:, :, None], v_WN - v_WB[:, :, None]
    return v_WB, np.cross(p_BN, v_BN).sum(axis=2) / (8 / 3 * (structure.p_BN[0] ** 2).sum())


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
    """(6 n, 6 n), of inertias that Drake has turned into World."""
    bodies = robot.bodies
    matrix = np.zeros((6 * len(bodies.mass), 6 * len(bodies.mass)))
    for i, (mass, inertia) in enumerate(zip(bodies.mass, bodies.inertia, strict=True)):
        R_WB = Quaternion(state[7 * i : 7 * i + 4]).rotation()
        turned = RotationalInertia(*inertia).ReExpress(RotationMatrix(R_WB))
        matrix[6 * i : 6 * i + 3, 6 * i : 6 * i + 3] = turned.CopyToFullMatrix3()
        matrix[6 * i + 3 : 6 * i + 6, 6 * i + 3 : 6 * i + 6] = mass * np.eye(3)
    return matrix
