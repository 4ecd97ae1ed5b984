"""The path of the centre: its curvature and the heading along it."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tetra_drake.laws.curves import curvature
from tetra_drake.robot.measures import follow
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import load_scenario

RADIUS = 0.2  # m
TURN = 2.0 * math.pi


def circle(angles, radius=RADIUS):
    """Points somewhere in the plane, passed in the order of angles in rad."""
    return np.column_stack([1.0 + radius * np.cos(angles), radius * np.sin(angles) - 3.0])


@pytest.mark.parametrize("turns", [0.15, 0.4, 1.5])
def test_a_circle_has_its_curvature_positive_to_the_left_even_if_the_robot_sways(turns):
    angles, phase = 0.7 + np.linspace(0.0, turns * TURN, 50), np.arange(50) * 2.1
    along = angles + 0.02 * turns * TURN * np.sin(phase)
    assert (np.diff(along) < 0.0).any(), "it goes back at times"
    for passed, sign in ((angles, 1.0), (-angles, -1.0), (along, 1.0)):
        assert curvature(circle(passed)) == pytest.approx(sign / RADIUS, rel=1e-3)
    across = circle(angles, RADIUS + 0.002 * np.sin(phase))
    assert curvature(across) == pytest.approx(1.0 / RADIUS, rel=0.1)


@pytest.mark.parametrize("direction", [0.0, 1.0, 0.5 * math.pi])
def test_a_line_has_no_curvature_however_it_is_passed(direction):
    way = np.arange(50.0) * 5e-3
    for along in (way, -way, way + 0.03 * np.sin(way * 1e3), 0.1 * np.sin(way * 1e3), way[:2]):
        points = np.outer(along, [math.cos(direction), math.sin(direction)])
        assert curvature(points + 2.0) == pytest.approx(0.0, abs=1e-9)


def test_a_robot_that_stands_has_no_curvature():
    assert curvature(np.full((50, 2), 0.1)) == 0.0
    assert curvature(np.array([[0.3, 0.2]])) == 0.0
    for size in (1e-12, 1e-9, 1e-7, 1e-5, 5e-5):
        jitter = np.random.default_rng(0).normal(scale=size, size=(50, 2))
        assert abs(curvature(jitter + 0.2)) < 0.01
    assert abs(curvature(circle(np.linspace(0.0, 3 * TURN, 50), 1e-3))) < 0.01  # sways in circles


@pytest.mark.parametrize("turns", [1.7, -1.7])
def test_the_heading_of_a_row_counts_whole_turns_and_its_centre_is_that_of_mass(turns):
    row = Robot.of(load_scenario("thesis").with_changes({"robot.tetrahedra": 3})).structure
    headings = np.linspace(0.4, 0.4 + turns * TURN, 30)
    poses, along = np.zeros((30, 3, 7)), np.arange(3) / 3.0
    for body, pitch in enumerate((-0.3, 0.0, 0.3)):  # turned about z after pitching about y
        angles = np.stack([headings, np.full(30, pitch)], axis=1)
        poses[:, body, :4] = Rotation.from_euler("ZY", angles).as_quat()[:, [3, 0, 1, 2]]
    poses[..., 4] = np.outer(np.cos(headings), along)
    poses[..., 5] = np.outer(np.sin(headings), along)
    poses[..., 6] = [0.0, 0.0, 0.3]
    path = follow(np.arange(30.0), poses, row)
    np.testing.assert_allclose(path.heading, headings, atol=1e-12)
    expected = [np.cos(headings) / 3.0, np.sin(headings) / 3.0, 0.1 + 0.0 * headings]
    np.testing.assert_allclose(path.centre, np.transpose(expected), atol=1e-12)
    np.testing.assert_array_equal(path.times, np.arange(30.0))
