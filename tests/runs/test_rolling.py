"""The rover that rolls: the claims of its page."""

import math

import numpy as np
import pytest
import rolling

from tetra_drake.engines.simulation import Simulation


@pytest.fixture(scope="module")
def best():
    return rolling.best_of(rolling.load_policies())


def test_the_best_policy_rolls_disturbed_rovers(best):
    robots = Simulation(rolling.rover(), count=8)
    rolled = rolling.roll(robots, np.tile(best["coefficients"], (8, 1)), seed=77)
    assert sum(map(rolling.rolls, rolled)) >= 7
    # One turn of a ball takes it on by less than the circle through its nodes.
    radius = 0.5 * 0.6604 * math.sqrt(1.25)  # parallel rods are half a rod apart
    ways = [metrics.distance / metrics.rolled for metrics in rolled if rolling.rolls(metrics)]
    assert 0.4 * radius < min(ways) <= max(ways) < radius


def test_a_policy_depends_on_the_shape_alone(best):
    """It neither knows where the rover is nor how far it has rolled by whole periods."""
    robots = Simulation(rolling.rover(), count=1)
    policy = rolling.RollingPolicy.of(robots, np.array(best["coefficients"]))
    readings = robots.state.rows(0)
    shift, later = np.array([3.0, -2.0, 0.5]), readings.time + 5.0 * rolling.PERIOD
    moved = readings._replace(p_WN=readings.p_WN + shift, time=later)
    lengths = policy(readings)
    assert np.ptp(lengths) > 0.01
    np.testing.assert_allclose(policy(moved), lengths, atol=1e-9)
    assert (np.abs(lengths - policy.rest) <= rolling.MOST * policy.rest + 1e-12).all()
