"""A tetrahedron that stays on an incline, and one that slips under directional friction.

For the centre of mass on level ground, whatever the nodes' loads and however it rocks: friction
that is mu times the normal force at every node gives m dv_t = -mu dP and m dv_n = dP - m g dt, P
the impulse of the normal forces. So v_t + mu v_n falls by mu g t exactly, while all nodes slip.
"""

import math

import numpy as np
import pytest
import tetrahedron_on_incline as incline
from one_tetrahedron import BASE, let_go, weight

from tetra_drake.laws.friction import Coulomb
from tetra_drake.scenario.load import load_scenario


def slips(motion):
    """(samples,): whether all nodes slip."""
    return (motion.modes[:, :, 1:] != 0.0).any(axis=2).all(axis=1)


def test_below_the_coefficient_it_stays():
    # What is left after t decays with k / c: exp(-62.5 / s t), 1e-8 in 0.3 s.
    scenario = incline.on_incline(incline.GENTLE)
    motion = incline.simulate(scenario, duration=0.35)
    assert not slips(motion).any()
    assert motion.travel[-1] == pytest.approx(-incline.deflection(scenario), rel=1e-6)
    assert abs(motion.velocity[-1]) < 1e-6 * incline.creep_speed(scenario)
    assert motion.friction_ratio[-1] == pytest.approx(math.tan(incline.GENTLE), rel=1e-6)
    # Rigid, so that the nodes move alike but for its tilt: each bears a third, whatever its load.
    third = incline.parts_of_weight(scenario)[0] / 3.0
    np.testing.assert_allclose(motion.friction_forces[-1, :, 0], third, rtol=2e-5)


FACTORS = {"forward": 1.5, "backward": 2.0, "lateral": 0.5}


# On the ellipse: 1 / sqrt((cos / a_f)^2 + (sin / a_l)^2).
ASLANT = 1.0 / math.hypot(0.5 / 2.0, math.sqrt(0.75) / 0.5)


@pytest.mark.parametrize(("degrees", "factor"), [(0.0, 1.5), (90.0, 0.5), (120.0, ASLANT)])
def test_friction_has_the_factor_of_the_direction_of_slip(degrees, factor):
    # It lands and is thrown with its heading along x. On level ground friction opposes the
    # velocity, so the path is straight, but for a yaw while it rocks.
    law = Coulomb(static=0.3, kinetic=0.3, **FACTORS)
    scenario = load_scenario("thesis").with_changes({"friction": law})
    way = np.array([math.cos(math.radians(degrees)), math.sin(math.radians(degrees)), 0.0])
    depth = weight(scenario) / (len(BASE) * scenario.ground.stiffness)
    motion = let_go(scenario, height=-depth, velocity=incline.SPEED * way, duration=0.1)
    mu, v = 0.3 * factor, motion.v_WN.mean(axis=1)
    expected = incline.SPEED - mu * scenario.robot.gravity * motion.times
    np.testing.assert_allclose(v @ way + mu * v[:, 2], expected, atol=1e-9 * incline.SPEED)
    sideways = v @ np.array([-way[1], way[0], 0.0])
    np.testing.assert_allclose(sideways, 0.0, atol=1e-7 * incline.SPEED)
