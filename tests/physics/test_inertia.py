"""Moments of inertia: rods and spheres in World, what no rotation changes, and Drake's."""

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
