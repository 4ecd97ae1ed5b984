"""The metrics that an engine tallies, against what the trajectory says."""

import numpy as np
import pytest
from helpers.states import strut_clearance
from helpers.structures import simulated

from tetra_drake.laws.cable import PASSIVE
from tetra_drake.laws.curves import travelling_index
from tetra_drake.robot.measures import off_ground
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import load_scenario


def test_tallied_metrics_are_those_of_the_trajectory():
    # Three tetrahedra on Coulomb friction for 1.2 s.
    changes = {"robot.tetrahedra": 3, "cpg.start_up": "0.2 s", "cpg.gain": "3 lbf"}
    changes |= {"simulation.duration": "1.2 s", "simulation.steady_from": "0.5 s"}
    changes |= {"simulation.sample_period": "1e-3 s", "friction.stiffness": "0 N/m"}
    changes["engine"] = "!Compiled"
    robot = Robot.of(load_scenario("coulomb").with_changes(changes))
    walk, motion = simulated(robot, seed=3)
    structure, metrics = robot.structure, walk.metrics
    steady = walk.trajectory.sel(time=slice(0.5, None))
    driven = structure.cables["signal"] != PASSIVE
    driver = structure.cables["signal"][driven]
    force, length = steady.signal.values[:, driver], steady.length.values[:, driven]
    shortening = -np.diff(length, axis=0)
    work = np.maximum(0.0, 0.5 * (force[1:] + force[:-1]) * shortening).sum()
    assert metrics.actuator_work == pytest.approx(work, rel=1e-3)
    way = steady.p_WB.mean("body").isel(time=[0, -1]).diff("time").values[0, :2]
    expected = work / (robot.weight * np.linalg.norm(way))
    assert metrics.cost_of_transport == pytest.approx(expected, rel=2e-3)
    rate = np.diff(steady.signal.values, axis=0) / 1e-3
    assert metrics.signal_rate == pytest.approx(np.sqrt((rate**2).mean()), rel=1e-3)
    # Peaks are those of the steady stretch; the speed is the greatest at the start of the walk.
    speed = np.abs(np.diff(walk.trajectory.length.values[:, driven], axis=0)).max(axis=1) / 1e-3
    in_steady = speed[walk.trajectory.time.values[1:] > 0.5].max()
    assert metrics.peak_actuator_speed == pytest.approx(in_steady, rel=0.01)
    assert in_steady < 0.9 * speed.max()
    loads = steady.tension.values[:, driven]
    assert metrics.peak_actuator_force == pytest.approx(loads.max(), rel=1e-3)
    assert metrics.mean_actuator_force == pytest.approx(loads.mean(), rel=1e-2)
    mean_speed = np.abs(shortening).mean() / 1e-3
    assert metrics.mean_actuator_speed == pytest.approx(mean_speed, rel=1e-2)
    assert metrics.speed == pytest.approx(way[0] / 0.7, rel=1e-3)
    # A foot may touch and leave within a sample.
    off = off_ground(steady).groupby("contact_body").all("contact")
    shares = off.mean("time").sel(contact_body=steady.body.values).values
    assert metrics.lifted_shares == pytest.approx(shares, abs=5e-3)
    assert metrics.lifted == pytest.approx(shares.mean(), abs=5e-3)
    assert metrics.tension == pytest.approx(walk.trajectory.tension.values.min(), rel=1e-3)
    distances = [strut_clearance(robot, state) for state in motion.states]
    # Looked at every 40 ms or so.
    assert metrics.clearance == pytest.approx(min(distances), abs=1e-4)
    assert metrics.clearance >= min(distances) - 1e-9
    coarse = steady.signal.sel(time=walk.path.times[walk.path.times >= 0.5]).values
    assert metrics.travelling_index == pytest.approx(travelling_index(coarse), rel=1e-6)
