"""Robots that are small, large, light or fast."""

import math

import numpy as np
import pytest
from helpers.anchored import HUNG, scenario_of

from tetra_drake.engines.mujoco import INSTALL, installed
from tetra_drake.engines.simulate import simulate
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.gait import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.scenario import Scenario

G = 9.80665

POWERS = {"stiffness": 2, "damping": 2.5, "ground.damping": 1.5, "dissipation": -0.5, "gain": 3}
POWERS |= dict.fromkeys(("diameter", "node_diameter", "free_length"), 1)
POWERS |= dict.fromkeys(("duration", "steady_from", "sample_period"), 0.5)
POWERS |= dict.fromkeys(("start_up", "listing_step", "tau_a_min", "tau_a_max"), 0.5)
"""Powers of the length by which numbers of a scenario grow, by the ends of their keys, if forces
grow as weights do (Froude's similarity)."""


@pytest.fixture(params=["!Compiled", "!Drake", "!Mujoco"])
def engine(request) -> str:
    if request.param == "!Mujoco" and not installed():
        pytest.skip(INSTALL)
    return request.param


def simulated(scenario: Scenario, engine: str) -> SimulationResult:
    return simulate(scenario.with_changes({"engine": engine}), seeded_gait(scenario), record=True)


def similar(scenario: Scenario, length: float) -> Scenario:
    """The scenario for a robot that is `length` times as long."""
    numbers = scenario.numbers()
    for key, number in numbers.items():
        power = POWERS.get(key, POWERS.get(key.rpartition(".")[2], 0))
        numbers[key] = number * length**power
    nodes = {name: [length * x for x in p] for name, p in scenario.robot.nodes.items()}
    scaled = scenario.with_numbers(numbers)
    return scaled.with_sections(robot=scaled.robot.model_copy(update={"nodes": nodes}))


def test_a_robot_of_another_size_moves_as_its_model(engine):
    times = {"duration": "2.5 s", "steady_from": "1 s", "sample_period": "0.1 s"}
    # The only bristle that MuJoCo knows is a stiff one.
    prism = load_scenario("prism").with_changes(
        {"friction.stiffness": "0 N/m", "cpg.start_up": "0.3 s", "simulation": times}
    )
    model, *others = (
        simulated(similar(prism, length), engine).trajectory.p_WB.values / length
        for length in (1.0, 0.01, 10.0)
    )
    for other in others:
        np.testing.assert_allclose(other, model, atol=2e-4)
    assert np.ptp(model, axis=0).max() > 0.005


def test_a_robot_that_falls_from_seven_metres_lands(engine):
    high = {"robot.offsets": [[0.0, 0.0, "7 m"]] * 3, "friction.stiffness": "0 N/m"}
    times = {"duration": "1.4 s", "steady_from": "1 s", "sample_period": "10 ms"}
    prism = load_scenario("prism").with_changes(high | {"simulation": times})
    found = simulated(prism, engine).trajectory
    fastest = float(-found.v_WN.sel(axis="z").min())
    assert fastest > 11.5 and fastest == pytest.approx(math.sqrt(2.0 * G * 7.0), rel=0.1)
    assert float(found.p_WN.sel(axis="z")[-1].max()) < 1.0


def test_a_light_bar_is_as_fast_as_its_cable_makes_it(engine):
    stretched = HUNG | {"masses": {}, "offsets": [[0.0, 0.0, -0.5]]}
    scenario = scenario_of(stretched, 0.012, **{"friction.stiffness": "0 N/m"})
    scenario = scenario.with_changes({"simulation.sample_period": "1 ms"})
    rate = math.sqrt(200.0 / Robot.of(scenario).structure.mass.sum())
    found = simulated(scenario, engine).trajectory
    speed, expected = found.v_WN.values[:, 0, 2], 0.5 * rate * np.sin(rate * found.time.values)
    np.testing.assert_allclose(speed, expected, atol=0.01 * expected.max())
    assert expected.max() > 60.0
