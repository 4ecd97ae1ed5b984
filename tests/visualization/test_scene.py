"""The robot as a Meshcat scene: arrows, floor and camera."""

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RotationMatrix

from tetra_drake.visualization.scene import (
    ASPECT,
    FIELD_OF_VIEW,
    Motion,
    aligning_quaternions,
    camera_position,
    floor_corners,
)


def test_aligning_quaternions_turn_z_into_the_direction():
    directions = np.random.default_rng(3).normal(size=(50, 3))
    directions[:3] = [(0.0, 0.0, 2.0), (0.0, 0.0, -3.0), (0.0, 1e-12, -1.0)]
    for q, direction in zip(aligning_quaternions(directions), directions, strict=True):
        z = RotationMatrix(Quaternion(q)).matrix()[:, 2]
        np.testing.assert_allclose(z, direction / np.linalg.norm(direction), rtol=0, atol=1e-9)
    np.testing.assert_array_equal(aligning_quaternions(np.zeros(3)[np.newaxis]), [[1, 0, 0, 0]])


def test_camera_sees_every_point():
    points = np.random.default_rng(4).uniform((0, -0.1, 0), (0.8, 0.1, 0.15), (200, 3))
    target = points.mean(axis=0)
    camera = camera_position(points, target)
    assert camera[2] > 0.15  # looks down on the floor
    assert camera[1] < -0.1  # from the right, so that the robot walks to the right
    rays = points - camera
    forward = (target - camera) / np.linalg.norm(target - camera)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    upward = np.cross(right, forward)
    limit = np.tan(np.deg2rad(FIELD_OF_VIEW / 2))
    assert np.abs(rays @ upward / (rays @ forward)).max() < limit
    assert np.abs(rays @ right / (rays @ forward)).max() < ASPECT * limit


def test_the_floor_reaches_around_every_point_in_whole_inches():
    points = np.array([[[0.0, -0.08, 0.1]], [[0.51, 0.09, 0.0]]])
    np.testing.assert_array_equal(floor_corners(points), [[-2, -6], [23, 6]])


def test_a_matrix_moves_turns_and_stretches():
    quarter_turn_about_x = np.array([[1.0, 1.0, 0.0, 0.0]]) / np.sqrt(2.0)
    motion = Motion("", np.array([[1.0, 2.0, 3.0]]), quarter_turn_about_x, np.array([[4.0, 5, 6]]))
    expected = [[4, 0, 0, 1], [0, 0, -6, 2], [0, 5, 0, 3], [0, 0, 0, 1]]
    np.testing.assert_allclose(motion.matrix(0), expected, rtol=0, atol=1e-12)
