"""A tetrahedron let go from just above the ground."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers.integral import integral

from tetra_drake.parts.settling_node import IMPACT_SPEED, bounce, first_contact, settle
from tetra_drake.parts.single_tetrahedron import weight
from tetra_drake.robot.structure import BASE
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.units import INCH


def test_rests_on_its_weight(scenario: Scenario) -> None:
    motion = settle(scenario)
    assert motion.normal_forces[-1].sum() == pytest.approx(weight(scenario), rel=1e-2)
    depth = weight(scenario) / (len(BASE) * scenario.ground.stiffness)
    np.testing.assert_allclose(motion.p_WN[-1, list(BASE), 2], -depth, rtol=1e-2)
    assert np.abs(motion.v_WN[-1]).max() < 1e-3 * IMPACT_SPEED


def test_meets_the_ground_at_the_speed_asked_for_and_stays(scenario: Scenario) -> None:
    impact, rebound = first_contact(settle(scenario))
    assert impact == pytest.approx(IMPACT_SPEED, rel=1e-2)
    assert math.isnan(rebound)


@pytest.mark.parametrize("inches_a_second", [0.03, 0.12, 0.3])
def test_restitution_is_that_of_the_law(scenario: Scenario, inches_a_second: float) -> None:
    # Eq. 1 without weight, m dv/dt = -k x (1 + d v) with d = lambda / k = 3/2 alpha and
    # v = dx/dt, separates: v dv / (1 + d v) = -k/m x dx. The right-hand side gives
    # the same on the way in (v from v_i to 0) and out (0 to -v_o), so
    #   d v_i - ln(1 + d v_i) = -d v_o - ln(1 - d v_o),
    # whatever m and k are. Expanded for small v that is v_o / v_i = 1 - 2/3 d v_i + ...
    # = 1 - alpha v_i (Eq. 2), whose next term is of second order: 2 % below 0.2 in/s.
    speed = inches_a_second * INCH
    impact, rebound = first_contact(bounce(scenario, impact_speed=speed))
    assert impact == pytest.approx(speed, rel=1e-6)
    d = scenario.ground.damping / scenario.ground.stiffness
    assert -d * rebound - math.log1p(-d * rebound) == pytest.approx(
        d * impact - math.log1p(d * impact), rel=5e-3
    )
    if inches_a_second < 0.2:
        linear = 1.0 - scenario.ground.velocity_correction * impact
        assert rebound / impact == pytest.approx(linear, rel=2e-2)


def test_normal_forces_turn_the_momentum_around(scenario: Scenario) -> None:
    motion = bounce(scenario)
    impact, rebound = first_contact(motion)
    impulse = integral(motion.normal_forces.sum(axis=1), motion.times)
    mass = weight(scenario) / scenario.robot.gravity
    assert impulse == pytest.approx(mass * (impact + rebound), rel=5e-3)


def test_nothing_meets_the_ground_before_it_fell(scenario: Scenario) -> None:
    motion = bounce(scenario, duration=1e-4)
    assert all(math.isnan(speed) for speed in first_contact(motion))


def test_without_gravity_nothing_falls(scenario: Scenario) -> None:
    scenario = scenario.with_changes({"robot.gravity": 0.0})
    motion = settle(scenario, duration=5e-3)
    np.testing.assert_array_equal(motion.normal_forces, 0.0)
    impact, _ = first_contact(bounce(scenario, duration=5e-3))
    assert impact == pytest.approx(IMPACT_SPEED)
