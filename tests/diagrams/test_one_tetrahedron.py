"""A tetrahedron alone on the ground: settling_node.py and sliding_tetrahedron.py."""

import math

import numpy as np
import pytest
from one_tetrahedron import BASE, LEADING, TRAILING, weight
from settling_node import IMPACT_SPEED, bounce, contact_speeds, settle, velocity_correction
from sliding_tetrahedron import flights, slide, slips, travel

from tetra_drake.scenario.load import load_scenario
from tetra_drake.settings.units import INCH

STICKS = [1.0, 0.0, 0.0]


@pytest.fixture(scope="module")
def sliding():
    return slide(load_scenario("thesis-reversal"))


def impulse(forces, times):
    """The integral of the forces of all nodes, (samples, nodes, ...), by the trapezoidal rule."""
    total = forces.sum(axis=1)
    return np.tensordot(np.diff(times), (total[:-1] + total[1:]) / 2.0, axes=1)


def test_it_meets_the_ground_as_asked_for_and_rests_on_its_weight(scenario):
    settling = settle(scenario)
    impact, rebound = contact_speeds(settling)
    assert impact == pytest.approx(IMPACT_SPEED, rel=1e-2)
    assert math.isnan(rebound)
    assert settling.normal_forces[-1].sum() == pytest.approx(weight(scenario), rel=1e-2)
    depth = weight(scenario) / (len(BASE) * scenario.ground.stiffness)
    np.testing.assert_allclose(settling.p_WN[-1, list(BASE), 2], -depth, rtol=1e-2)
    assert np.abs(settling.v_WN[-1]).max() < 1e-3 * IMPACT_SPEED


@pytest.mark.parametrize("inches_per_second", [0.12, 0.3])
def test_restitution_is_that_of_the_law(scenario, inches_per_second):
    # Eq. 1 without weight, m dv/dt = -k x (1 + d v) with d = lambda / k = 3/2 alpha and
    # v = dx/dt, separates: v dv / (1 + d v) = -k/m x dx. The right-hand side gives
    # the same on the way in (v from v_i to 0) and out (0 to -v_o), so
    #   d v_i - ln(1 + d v_i) = -d v_o - ln(1 - d v_o),
    # whatever m and k are. Expanded for small v that is v_o / v_i = 1 - 2/3 d v_i + ...
    # = 1 - alpha v_i (Eq. 2), whose next term is of second order: 2 % below 0.2 in/s.
    speed = inches_per_second * INCH
    bouncing = bounce(scenario, speed=speed)
    impact, rebound = contact_speeds(bouncing)
    assert impact == pytest.approx(speed, rel=1e-6)
    d = scenario.ground.damping / scenario.ground.stiffness
    assert -d * rebound - math.log1p(-d * rebound) == pytest.approx(
        d * impact - math.log1p(d * impact), rel=5e-3
    )
    if inches_per_second < 0.2:
        linear = 1.0 - velocity_correction(scenario) * impact
        assert rebound / impact == pytest.approx(linear, rel=2e-2)
    momentum = weight(scenario) / scenario.robot.gravity * (impact + rebound)
    assert impulse(bouncing.normal_forces, bouncing.times) == pytest.approx(momentum, rel=1e-2)


def test_it_breaks_free_at_the_stiction_range_and_sticks_again(scenario, sliding):
    [(start, end)] = slips(sliding, LEADING)
    way = travel(sliding, LEADING)[sliding.times == start]
    np.testing.assert_allclose(way, scenario.friction.stiction_range, rtol=1e-3)
    assert 0.0 < start < end < 0.6 * sliding.times[-1]
    after = sliding.times > end
    assert sliding.v_WN[after, LEADING, 0][0] <= 0.0  # it has turned round
    assert (sliding.modes[after, LEADING] == STICKS).all()
    [(lifted, landed)] = flights(sliding, TRAILING)
    assert lifted < 1e-3 < landed < end
    slow = slide(load_scenario("thesis-reversal"), speed=3.0 * INCH, duration=0.03)
    assert all(slips(slow, node) == [] for node in BASE)
    assert 0.0 < travel(slow, LEADING)[-1] < scenario.friction.stiction_range
