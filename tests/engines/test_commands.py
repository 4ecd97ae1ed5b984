"""Robots that follow commands, on every engine: the same samples give the same walk."""

import numpy as np
import pytest

from tetra_drake.engines.simulate import simulate
from tetra_drake.robot.command import Command
from tetra_drake.robot.gait import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import load_scenario

DRIVEN = 8


@pytest.fixture(scope="module")
def brief():
    """The robot under Coulomb friction for 3 s."""
    settings = {"simulation.duration": "3 s", "simulation.steady_from": "1 s"}
    return load_scenario("coulomb").with_changes(settings)


def waves(mean: float, amplitude: float, *, rate: float = 100.0) -> Command:
    """Sines of 1 Hz that run along the robot, left and right alike, after half a second."""
    times = np.arange(0.0, 3.0, 1.0 / rate)[:, np.newaxis]
    phases = 2.0 * np.pi * (times - 0.2 * (np.arange(DRIVEN) // 2))
    grown = np.clip(times - 0.5, 0.0, 1.0)
    return Command("waves", 1.0 / rate, mean + amplitude * grown * np.sin(phases))


def distance(scenario, command) -> float:
    return simulate(scenario=scenario, command=command).metrics.distance_in


@pytest.mark.parametrize("engine", ["drake", "compiled"])
def test_a_command_acts_from_the_start_and_is_held(brief, engine):
    # The scenario's start-up of 1.25 s is the network's.
    short = {"simulation.duration": "0.3 s", "simulation.steady_from": "0.1 s"}
    scenario = brief.with_changes(short | {"engine": f"!{engine.capitalize()}"})
    command = Command("steps", 0.1, np.array([[1.0], [2.0]]) * np.ones(DRIVEN))
    result = simulate(scenario=scenario, command=command, record=True)
    signal = result.trajectory.signal.sel(oscillator="T1-T2 outer bottom_left")
    assert signal.sel(time=[0.0, 0.05, 0.1], method="nearest").values == pytest.approx(1.0)
    assert signal.sel(time=[0.11, 0.2, 0.3], method="nearest").values == pytest.approx(2.0)


def test_dense_samples_of_the_signals_are_the_gait(brief):
    gait, robot = seeded_gait(brief), Robot.of(brief)
    finely = brief.with_changes({"simulation.sample_period": "0.5 ms"})
    signal = simulate(scenario=finely, gait=gait, record=True).trajectory.signal.values
    command = Command("dense", 0.5e-3, signal[:, robot.structure.cables["signal"][robot.driven]])
    walked = simulate(scenario=brief, gait=gait).metrics.distance_in
    # Half a millisecond late, at less than 1 in/s.
    assert distance(brief, command) == pytest.approx(walked, abs=0.002)


@pytest.mark.parametrize(
    ("what", "key"),
    [
        ({}, "gait"),
        ({"gait": 1, "command": 1}, "command"),
        ({"command": 1, "steering": 0.5}, "command"),
    ],
)
def test_a_robot_follows_a_gait_or_a_command(brief, what, key, refused):
    chosen = {"gait": seeded_gait(brief), "command": waves(0.0, 1.0), "steering": 0.5}
    with refused("simulate", key, ""):
        simulate(scenario=brief, **{name: chosen[name] for name in what})
