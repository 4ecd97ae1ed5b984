"""A tetrahedron let go from just above the ground (thesis Fig. 5).

The three nodes it lands on share its weight and move alike.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from tetra_drake import thesis
from tetra_drake.parts.single_tetrahedron import Motion, let_go
from tetra_drake.robot.structure import BOTTOM_LEFT
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.units import INCH

IMPACT_SPEED = thesis.SETTLING_IMPACT_SPEED_IN_S * INCH
"""m/s."""

DURATION = 0.04  # s

NODE = BOTTOM_LEFT
"""The node that is looked at."""


def settle(
    scenario: Scenario, *, impact_speed: float = IMPACT_SPEED, duration: float = DURATION
) -> Motion:
    """Lets the tetrahedron go at rest, from where it falls to `impact_speed` (m/s)."""
    height = impact_speed * _fall_time(scenario, impact_speed) / 2.0
    return let_go(scenario, height=height, velocity=[0.0, 0.0, 0.0], duration=duration)


def bounce(
    scenario: Scenario, *, impact_speed: float = IMPACT_SPEED, duration: float = DURATION
) -> Motion:
    """The same impact without weight, which is the impact that Eq. 2 is about.

    It meets the ground when the tetrahedron of settle() does.
    """
    weightless = dataclasses.replace(scenario.robot, gravity=0.0)
    return let_go(
        dataclasses.replace(scenario, robot=weightless),
        height=impact_speed * _fall_time(scenario, impact_speed),
        velocity=[0.0, 0.0, -impact_speed],
        duration=duration,
    )


def first_contact(motion: Motion) -> tuple[float, float]:
    """Speed (m/s) at which the first node meets the ground and at which it leaves it again;
    nan for what does not happen."""
    height, rate = motion.p_WN[:, NODE, 2], motion.v_WN[:, NODE, 2]
    below = np.flatnonzero(height <= 0.0)
    if below.size == 0:
        return math.nan, math.nan
    above = np.flatnonzero(height[below[0] :] > 0.0)
    rebound = float(rate[below[0] + above[0]]) if above.size else math.nan
    return -float(rate[below[0]]), rebound


def _fall_time(scenario: Scenario, speed: float) -> float:
    """How long (s) a fall from rest to `speed` takes; 0 without gravity, where nothing falls."""
    return speed / scenario.robot.gravity if scenario.robot.gravity > 0.0 else 0.0
