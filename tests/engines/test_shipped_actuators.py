"""The shipped robots with actuators, which carry their motors, on both engines."""

import pytest

from tetra_drake.engines.simulate import simulate
from tetra_drake.robot.gait import seeded_gait
from tetra_drake.scenario.load import load_scenario

SHORT = {"simulation.duration": "4 s", "simulation.steady_from": "2 s"}


@pytest.mark.parametrize("name", ["motors", "winch"])
def test_diagram_and_compiled_engine_walk_alike(name):
    scenario = load_scenario(name).with_changes(SHORT)
    gait = seeded_gait(scenario, 3)
    compiled = simulate(scenario=scenario, gait=gait).metrics
    diagram = simulate(scenario=scenario.with_changes({"engine": "!Drake"}), gait=gait).metrics
    assert compiled.distance == pytest.approx(diagram.distance, abs=0.05 * 0.0254)
    assert compiled.peak_actuator_force == pytest.approx(diagram.peak_actuator_force, rel=0.01)
    assert compiled.actuator_limited == pytest.approx(diagram.actuator_limited, abs=0.01)
