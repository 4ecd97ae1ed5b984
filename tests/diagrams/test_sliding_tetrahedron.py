"""A tetrahedron sliding on the ground until it comes to rest."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.integral import integral

from tetra_drake.parts.single_tetrahedron import Motion, weight
from tetra_drake.parts.sliding_tetrahedron import INITIAL_SPEED, flights, slide, slips, travel
from tetra_drake.robot.structure import BASE, BOTTOM_LEFT, TOP
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.units import INCH


@pytest.fixture(scope="module")
def motion() -> Motion:
    return slide(load_scenario("thesis"))


def test_breaks_free_at_the_stiction_range_and_sticks_again(
    scenario: Scenario, motion: Motion
) -> None:
    [(start, end)] = slips(motion, TOP)
    way = travel(motion, TOP)[motion.times == start]
    np.testing.assert_allclose(way, scenario.friction.stiction_range, rtol=1e-3)
    assert 0.0 < start < end < 0.6 * motion.times[-1]
    after = motion.times > end
    # It sticks again because it turned round.
    assert motion.v_WN[after, TOP, 0][0] <= 0.0
    assert (motion.modes[after, TOP] == [1.0, 0.0, 0.0]).all()


def test_trailing_nodes_lift_off_and_land(motion: Motion) -> None:
    [(start, end)] = flights(motion, BOTTOM_LEFT)
    [(_, stuck)] = slips(motion, TOP)
    assert start < 1e-3 < end < stuck


def test_ends_at_rest_with_all_nodes_sticking(scenario: Scenario, motion: Motion) -> None:
    assert np.abs(motion.v_WN[-1]).max() < 1e-3 * INCH
    np.testing.assert_array_equal(motion.modes[-1], [[1.0, 0.0, 0.0]] * 3)
    assert motion.normal_forces[-1].sum() == pytest.approx(weight(scenario), rel=1e-2)
    np.testing.assert_allclose(motion.friction_forces[-1], 0.0, atol=1e-3 * weight(scenario))


def test_friction_takes_all_the_momentum(scenario: Scenario, motion: Motion) -> None:
    impulse = integral(motion.friction_forces.sum(axis=1), motion.times)
    start = weight(scenario) / scenario.robot.gravity * INITIAL_SPEED
    np.testing.assert_allclose(impulse, [-start, 0.0], rtol=1e-2, atol=1e-6 * start)


def test_goes_straight(motion: Motion) -> None:
    np.testing.assert_allclose(motion.p_WN[:, TOP, 1], 0.0, atol=1e-9)


def test_a_slow_one_never_breaks_free(scenario: Scenario) -> None:
    motion = slide(scenario, speed=3.0 * INCH, duration=0.03)
    assert all(slips(motion, node) == [] for node in BASE)
    assert 0.0 < travel(motion, TOP)[-1] < scenario.friction.stiction_range
