"""Bodies: their motion, and their moments of inertia in World, against Drake's."""

import numpy as np
import pytest
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RotationMatrix
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.tree import RotationalInertia, SpatialInertia, UnitInertia

from tetra_drake.physics.inertia import (
    INERTIA_COLUMNS,
    XX,
    XY,
    XZ,
    YY,
    YZ,
    ZZ,
    gyroscopic_torque,
    over_inertia,
    times_inertia,
    turn_inertia,
)
from tetra_drake.physics.kinematics import interpolate_state, move_bodies

BODIES = 5


@pytest.fixture
def points() -> np.ndarray:
    """(bodies, points, 3): the places of point masses about their centre, in the bodies' frames."""
    p_BP = np.random.default_rng(1).normal(size=(BODIES, 4, 3))
    return p_BP - p_BP.mean(axis=1, keepdims=True)


@pytest.fixture
def state() -> np.ndarray:
    """(13 bodies,): the bodies are turned any way; their quaternions are not of length 1."""
    return np.random.default_rng(2).normal(size=13 * BODIES)


def rotations(state: np.ndarray) -> list[np.ndarray]:
    """R_WB of the bodies, by Drake."""
    quaternions = state[: 7 * BODIES].reshape(BODIES, 7)[:, :4]
    return [Quaternion(q / np.linalg.norm(q)).rotation() for q in quaternions]


def matrices(inertia: np.ndarray) -> np.ndarray:
    """(bodies, 3, 3) of inertias (bodies, 6)."""
    rows = [[XX, XY, XZ], [XY, YY, YZ], [XZ, YZ, ZZ]]
    return inertia[:, rows]


def of_points(p: np.ndarray) -> np.ndarray:
    """(bodies, 6): inertias of unit masses at points (bodies, points, 3)."""
    x, y, z = np.moveaxis(p, 2, 0)
    columns = y * y + z * z, x * x + z * z, x * x + y * y, -x * y, -x * z, -y * z
    return np.stack(columns, axis=-1).sum(axis=1)


def turned(state: np.ndarray, inertia_B: np.ndarray) -> np.ndarray:
    inertia_W = np.full((BODIES, INERTIA_COLUMNS), np.nan)
    turn_inertia(state, inertia_B, inertia_W)
    return inertia_W


def test_turned_points_have_the_turned_inertia(points, state):
    p_WP = np.array([p_BP @ R_WB.T for p_BP, R_WB in zip(points, rotations(state), strict=True)])
    np.testing.assert_allclose(turned(state, of_points(points)), of_points(p_WP), atol=1e-12)


def test_drake_turns_an_inertia_alike(points, state):
    inertia = of_points(points)
    for R_WB, given, found in zip(
        rotations(state), inertia, matrices(turned(state, inertia)), strict=True
    ):
        expected = RotationalInertia(*given).ReExpress(RotationMatrix(R_WB))
        np.testing.assert_allclose(found, expected.CopyToFullMatrix3(), atol=1e-12)


def test_momentum_and_torque_are_those_of_the_matrix(points):
    inertia, a = of_points(points), (0.3, -1.2, 0.7)
    for body, matrix in enumerate(matrices(inertia)):
        np.testing.assert_allclose(times_inertia(inertia, body, a), matrix @ a, rtol=1e-12)
        found = over_inertia(inertia, body, a)
        np.testing.assert_allclose(found, np.linalg.solve(matrix, a), rtol=1e-12)
        torque = gyroscopic_torque(inertia, body, a)
        np.testing.assert_allclose(torque, -np.cross(a, matrix @ a), rtol=1e-12)


def test_a_free_body_accelerates_as_drakes_does(points, state):
    """No torque acts: I dw/dt is the gyroscopic torque, Drake's bias with the other sign."""
    w, inertia = (0.3, -1.2, 0.7), turned(state, of_points(points))
    for body, matrix in enumerate(matrices(inertia)):
        unit = UnitInertia(*np.diag(matrix), matrix[0, 1], matrix[0, 2], matrix[1, 2])
        M_BBo_W = SpatialInertia(1.0, np.zeros(3), unit)
        momentum = (M_BBo_W * SpatialVelocity(np.array(w), np.zeros(3))).rotational()
        rate = over_inertia(inertia, body, gyroscopic_torque(inertia, body, w))
        np.testing.assert_allclose(matrix @ rate, -np.cross(w, momentum), rtol=1e-11)


def test_bodies_turn_as_drakes_quaternions_do():
    # A turn by angle w t about z: quaternion (cos(w t / 2), 0, 0, sin(w t / 2)).
    state = np.append(1.0, np.zeros(12))
    moved = np.empty(13)
    move_bodies(state, np.array([0.0, 0.0, 3.0, 0.1, 0.2, 0.3]), 0.01, moved)
    np.testing.assert_allclose(moved[:4], [np.cos(0.015), 0, 0, np.sin(0.015)], atol=1e-11)
    np.testing.assert_allclose(moved[4:7], [1e-3, 2e-3, 3e-3], atol=1e-18)


@pytest.mark.parametrize("part", [0.0, 0.3, 0.8, 1.0])
def test_between_two_states_bodies_move_by_cubic_polynomials_and_turn_steadily(part):
    step = 0.01
    turn_rates = np.array([[3.0, -2.0, 1.0], [0.5, 4.0, -6.0]])  # (bodies, axis), rad/s
    shift = (
        np.random.default_rng(3).normal(size=(4, 2, 3)) * np.array([1, 1, 10, 1e3])[:, None, None]
    )

    def state_at(time):
        powers, rates = time ** np.arange(4), np.array([0, 1, 2 * time, 3 * time**2])
        positions, velocities = (np.tensordot(x, shift, 1) for x in (powers, rates))
        speeds = np.linalg.norm(turn_rates, axis=1, keepdims=True)
        angles, axes = 0.5 * time * speeds, turn_rates / speeds
        poses = np.hstack([np.cos(angles), np.sin(angles) * axes, positions])
        return np.append(poses, np.hstack([turn_rates, velocities]))

    before, exact, after = (state_at(x * step) for x in (0.0, part, 1.0))
    found = interpolate_state(before, after, step, part)
    np.testing.assert_allclose(found[:14], exact[:14], rtol=0, atol=1e-9)
    linear = (1.0 - part) * before[14:] + part * after[14:]
    np.testing.assert_allclose(found[14:], linear, rtol=0, atol=1e-14)
