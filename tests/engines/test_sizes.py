"""Robots of other sizes and speeds."""

import math

import numpy as np
import pytest
from helpers.converged import shortly

from tetra_drake.engines.simulate import simulate
from tetra_drake.robot.command import driven_robot
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.speed_limit import speed_limit
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.scenario import Scenario

POWERS = {"stiffness": 2, "damping": 2.5, "ground.damping": 1.5, "dissipation": -0.5, "gain": 3}
POWERS |= dict.fromkeys(("diameter", "node_diameter", "free_length"), 1)
TIMES = "duration", "steady_from", "sample_period", "start_up", "listing_step"
POWERS |= dict.fromkeys((*TIMES, "tau_a_min", "tau_a_max"), 0.5)
"""Powers of the length by which numbers of a scenario grow, by the ends of their keys, if forces
grow as weights do (Froude's similarity)."""


def similar(scenario: Scenario, length: float) -> Scenario:
    """The scenario for a robot that is `length` times as long."""
    numbers = scenario.numbers()
    for key in numbers:
        numbers[key] *= length ** POWERS.get(key, POWERS.get(key.rpartition(".")[2], 0))
    nodes = {name: [length * x for x in p] for name, p in scenario.robot.nodes.items()}
    scaled = scenario.with_numbers(numbers)
    return scaled.with_sections(robot=scaled.robot.model_copy(update={"nodes": nodes}))


def test_a_robot_of_another_size_moves_as_its_model(engine):
    changes = {"friction.stiffness": "0 N/m", "simulation.sample_period": "0.02 s"}
    prism = shortly(load_scenario("prism"), 0.4, engine=engine, **changes)
    robots = {length: similar(prism, length) for length in (1.0, 0.01, 10.0)}
    model, *others = (
        simulate(robot, seeded_gait(robot, 8), record=True).trajectory.p_WB.values / length
        for length, robot in robots.items()
    )
    for other in others:
        np.testing.assert_allclose(other, model, atol=1e-4)
    assert np.ptp(model, axis=0).max() > 0.003


def limit_of(scenario: Scenario) -> float:
    """The speed limit (m/s) of a robot with a seeded gait."""
    return speed_limit(driven_robot(scenario, seeded_gait(scenario)))


FAST = [({"robot.offsets": [[0.0, 0.0, "50 m"]] * 3}, math.sqrt(2.0 * 9.80665 * 50.0))]
FAST += [({"terrain": "!Incline {slope: -30 deg}"}, 0.5 * 9.80665 * 8.0)]
FAST += [({"cpg.gain": "1 kN", "robot.cables.side.stiffness": "1 MN/m"}, 70.0)]  # 50 J for 20 g


@pytest.mark.parametrize(("changes", "reached"), FAST)
def test_the_speed_limit_is_beyond_what_weight_and_loads_can_give(changes, reached):
    prism = load_scenario("prism")
    limit = limit_of(prism.with_changes(changes))
    assert reached < limit < 3.0 * reached
    given = prism.with_changes({"simulation.max_speed": "2 m/s"} | changes)
    assert limit_of(given) == 2.0
