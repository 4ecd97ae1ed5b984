"""A tetrahedron sliding on the ground until it comes to rest (thesis Fig. 6).

It has one node ahead of the other two and starts fast: a node that sticks is braked within
a millisecond, so that it takes 23 in/s to break one free.
"""

from __future__ import annotations

import numpy as np

from tetra_drake.parts.single_tetrahedron import Motion, let_go, weight
from tetra_drake.results.measures import intervals
from tetra_drake.robot.structure import BASE, BOTTOM_LEFT, TOP
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.units import INCH

INITIAL_SPEED = 30.0 * INCH
"""m/s, forward."""

DURATION = 0.1  # s

LEADING, TRAILING = TOP, BOTTOM_LEFT
"""The two nodes that differ; the third moves as the trailing one does."""


def slide(
    scenario: Scenario, *, speed: float = INITIAL_SPEED, duration: float = DURATION
) -> Motion:
    """Gives the tetrahedron, at rest on the ground, a forward `speed` (m/s)."""
    depth = weight(scenario) / (len(BASE) * scenario.ground.stiffness)
    return let_go(scenario, height=-depth, velocity=[speed, 0.0, 0.0], duration=duration)


def slips(motion: Motion, node: int) -> list[tuple[float, float]]:
    """When the contact node slips along x: starts and ends in s."""
    return intervals(motion.times, motion.modes[:, node, 1] != 0.0)


def flights(motion: Motion, node: int) -> list[tuple[float, float]]:
    """When the contact node is off the ground: starts and ends in s."""
    return intervals(motion.times, motion.modes[:, node, 0] == 0.0)


def travel(motion: Motion, node: int) -> np.ndarray:
    """(samples,): how far the node has come along x, in m."""
    return motion.p_WN[:, node, 0] - motion.p_WN[0, node, 0]
