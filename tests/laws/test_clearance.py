"""The clearance of struts, against hand-made pairs and a search for the nearest points."""

import itertools

import numpy as np
import pytest
from helpers.states import disturbed, strut_clearance

from tetra_drake.laws.kinematics import NODE_COLUMNS, P_WN
from tetra_drake.laws.struts import Struts, strut_distance
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import node_positions
from tetra_drake.scenario.load import load_scenario

PAIR = Struts(
    *map(np.array, ([0, 2], [1, 3], [0, 2], [1, 3], [0, 1, 2])),
    length=np.full(2, 2.0),
    radius=np.full(2, 0.1),
)
"""Two struts of length 2, of two bodies."""


SEGMENTS = [([(-1, 0, 0), (1, 0, 0)], [(0, -1, 2), (0, 1, 2)], 2.0)]  # they cross
SEGMENTS += [([(-1, 0, 0), (1, 0, 0)], [(0.5, 1, 0), (2.5, 1, 0)], 1.0)]  # parallel, side by side
SEGMENTS += [([(-1, 0, 0), (1, 0, 0)], [(0.5, 0, 0), (2.5, 0, 0)], 0.0)]  # on one line
SEGMENTS += [([(-1, 0, 0), (1, 0, 0)], [(0, -1, 0), (0, 1, 0)], 0.0)]  # they meet


@pytest.mark.parametrize(("first", "second", "distance"), SEGMENTS)
def test_segments_are_as_far_apart_as_their_nearest_points(first, second, distance):
    for ends in ([*first, *second], [*first[::-1], *second], [*first, *second[::-1]]):
        nodes = np.zeros((4, NODE_COLUMNS))
        nodes[:, P_WN : P_WN + 3] = ends
        for pair in ((0, 1), (1, 0)):
            assert strut_distance(PAIR, nodes, *pair) == pytest.approx(distance, abs=1e-12)


def least_distance(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> float:
    """Of segments from a to b from segments from c to d (k, 3), by going to the nearest point along
    one and the other in turns."""
    u, v, t = b - a, d - c, np.zeros((len(a), 1))
    for _ in range(300):
        s = np.clip(((c + t * v - a) * u).sum(1) / (u * u).sum(1), 0.0, 1.0)[:, np.newaxis]
        t = np.clip(((a + s * u - c) * v).sum(1) / (v * v).sum(1), 0.0, 1.0)[:, np.newaxis]
    return float(np.linalg.norm(a + s * u - c - t * v, axis=1).min())


@pytest.mark.parametrize("name", ["thesis", "six_bar", "mast"])
def test_the_clearance_is_the_least_distance_of_struts_of_different_bodies(name):
    # The robot as it starts, then bodies that are turned and moved more and more: in the end,
    # they are all over each other, and any strut may be the nearest.
    robot, generator = Robot.of(load_scenario(name)), np.random.default_rng(3)
    structure = robot.structure
    first, second = np.array([*itertools.combinations(structure.struts, 2)]).swapaxes(0, 1)
    apart = structure.carriers[first[:, 0]] != structure.carriers[second[:, 0]]
    nodes = [*first[apart].T, *second[apart].T]
    for size in [0.0, *np.repeat([0.01, 0.02, 0.04, 0.1], 3)]:
        state = disturbed(structure, int(generator.integers(1000)), pose=size, speed=0.0)
        p_WN = node_positions(structure, state)
        expected = least_distance(*(p_WN[each] for each in nodes))
        assert strut_clearance(robot, state) == pytest.approx(expected, abs=1e-6)


def test_what_is_farther_than_the_least_so_far_changes_nothing(robot):
    state = robot.structure.initial_state
    least = strut_clearance(robot, state)
    assert strut_clearance(robot, state, 0.99 * least) == 0.99 * least
    assert strut_clearance(robot, state, 1.01 * least) == least
