"""The contact of two struts, against hand-made pairs."""

import itertools

import numpy as np
import pytest
from helpers.states import disturbed

from tetra_drake.laws.capsules import (
    NearStruts,
    add_contact_force,
    find_near_struts,
)
from tetra_drake.laws.contact import NormalForce
from tetra_drake.laws.kinematics import FORCE, NODE_COLUMNS, P_WN
from tetra_drake.laws.struts import Struts, strut_distance
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import moved_nodes
from tetra_drake.scenario.load import load_scenario

LAW = NormalForce(stiffness=1e4, damping=2e4)
RADIUS = 0.01


def forces_between(first, second) -> np.ndarray:
    """Forces (2, 6) of two struts on each other, from the ends of both: force, and torque about the
    origin of World."""
    nodes = np.zeros((4, NODE_COLUMNS))
    nodes[:, P_WN : P_WN + 3] = p_WN = np.array([*first, *second], dtype=float)
    length = np.linalg.norm(p_WN[1::2] - p_WN[::2], axis=1)
    ends = np.array([0, 2]), np.array([1, 3])
    struts = Struts(*ends, *ends, np.array([0, 1, 2]), length, np.full(2, RADIUS))
    add_contact_force(struts, LAW, nodes, 0, 1)
    force = nodes[:, FORCE : FORCE + 3]
    wrenches = np.hstack([force, np.cross(p_WN, force)])
    return wrenches.reshape(2, 2, 6).sum(axis=1)


ALONG_X = [(-1, 0, 0), (1, 0, 0)]


TOUCHING = [([(-1, 0, 0.018), (1, 0, 0.018)], 0.0)]  # parallel, side by side
TOUCHING += [([(0, 0, 0.018), (2, 0, 0.018)], 0.5)]  # parallel, half beyond
TOUCHING += [([(0.7, 0, 0.018), (0.7, 0, 1)], 0.7)]  # an end above
TOUCHING += [([(0.7, -1, 0.018), (0.7, 1, 0.018)], 0.7)]  # across


@pytest.mark.parametrize(("second", "place"), TOUCHING)
def test_struts_touch_where_they_are_nearest_and_parallel_ones_in_the_middle(second, place):
    below, _ = forces_between(ALONG_X, second)
    # Away from their middles, parallel struts count as thinner, here by 0.3 % of both radii.
    force, thinner = LAW.stiffness * 0.002, LAW.stiffness * 0.004 * 2.0 * RADIUS
    np.testing.assert_allclose(below[:2], 0.0, atol=1e-3 * force)
    assert abs(force + below[2]) <= (thinner if place == 0.5 else 1e-3 * force)
    np.testing.assert_allclose(below[4], -place * below[2], atol=2e-3 * force)


def test_all_pairs_of_struts_within_a_limit_are_found():
    structure = Robot.of(load_scenario("six_bar")).structure
    state = disturbed(structure, 3, pose=0.02, speed=0.0)
    struts, nodes = structure.strut_table, moved_nodes(structure, state)
    all_pairs, near = itertools.combinations(range(struts.length.size), 2), NearStruts.of(struts)
    distances = {pair: strut_distance(struts, nodes, *pair) for pair in all_pairs}
    for nearest in [0.0, *distances.values()]:
        limit = nearest + 1e-9
        find_near_struts(struts, limit, structure.radius, state, nodes, near)
        expected = [list(pair) for pair, distance in distances.items() if distance <= limit]
        assert near.pairs[: near.count[0]].tolist() == expected
