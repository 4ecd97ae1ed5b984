"""The clearance of struts, against a search for the nearest points."""

import itertools

import numpy as np
import pytest
from helpers.states import disturbed, strut_clearance
from scipy.optimize import lsq_linear

from tetra_drake.laws.kinematics import P_WN
from tetra_drake.laws.struts import strut_distance
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import moved_nodes
from tetra_drake.scenario.load import load_scenario


def distance(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> float:
    """Of a segment from a to b from one from c to d, by a search for the nearest places on both."""
    nearest = lsq_linear(np.stack([b - a, c - d], axis=1), c - a, bounds=(0.0, 1.0), method="bvls")
    return float(np.sqrt(2.0 * nearest.cost))


@pytest.mark.parametrize("name", ["thesis", "six_bar", "mast"])
def test_struts_are_as_far_apart_as_their_nearest_points(name):
    # The robot as it starts, with many parallel struts, then bodies that are turned and moved more
    # and more: in the end, they are all over each other, and any may be the nearest.
    robot, generator = Robot.of(load_scenario(name)), np.random.default_rng(3)
    structure, struts = robot.structure, robot.structure.strut_table
    pairs = [*itertools.combinations(range(len(structure.struts)), 2)]
    bodies = structure.carriers[structure.struts[:, 0]]
    for size in (0.0, 0.01, 0.02, 0.04, 0.1):
        state = disturbed(structure, int(generator.integers(1000)), pose=size, speed=0.0)
        nodes = moved_nodes(structure, state)
        ends = nodes[structure.struts, P_WN : P_WN + 3]
        expected = np.array([distance(*ends[i], *ends[j]) for i, j in pairs])
        found = [strut_distance(struts, nodes, *pair) for pair in pairs]
        np.testing.assert_allclose(found, expected, atol=1e-7)
        least = expected[[bodies[i] != bodies[j] for i, j in pairs]].min()
        assert strut_clearance(robot, state) == pytest.approx(least, abs=1e-7)
