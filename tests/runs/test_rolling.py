"""The rover that rolls: the claims of its page."""

import math

import numpy as np
import pytest
import tables

from tetra_drake.engines.simulate import simulate_many
from tetra_drake.evolution.run import load_run
from tetra_drake.robot.command import driven_robot, policy_signals
from tetra_drake.robot.readings import Readings, first_readings
from tetra_drake.scenario.disturbances import disturbed, fresh_draws


@pytest.fixture(scope="module")
def run():
    return load_run(tables.HERE / "rolling")


def test_the_best_policy_rolls_disturbed_rovers(run):
    draws = [disturbed(run.scenario, draw) for draw in fresh_draws(run.scenario, 77, 8)]
    metrics = [each.metrics for each in simulate_many(draws, [run.best_gait()] * 8)]
    ways = [each.distance / each.rolled for each in metrics if each.rolled >= math.tau]
    assert len(ways) >= 7
    # One turn of a ball takes it on by less than the circle through its nodes.
    radius = 0.5 * 0.6604 * math.sqrt(1.25)  # parallel rods are half a rod apart
    assert 0.4 * radius < min(ways) <= max(ways) < radius


def test_a_policy_depends_on_the_shape_alone(run):
    """It neither knows where the rover is nor how far it has rolled by whole periods."""
    robot, clock = driven_robot(run.scenario, run.best_gait()), run.scenario.policy.clock
    readings = Readings(*([values] for values in first_readings(robot.robot)))
    readings = Readings(*map(np.array, readings))
    later = readings._replace(
        p_WN=readings.p_WN + np.array([3.0, -2.0, 0.5]), time=readings.time + 5.0 * clock
    )
    signals = policy_signals([robot.pilot], readings)
    assert np.ptp(signals) > 10.0
    assert policy_signals([robot.pilot], later) == pytest.approx(signals, abs=1e-6)
