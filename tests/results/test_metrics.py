"""The metrics and the thesis's fitness (Eq. 10)."""

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from helpers.totals import make_totals

from tetra_drake.results.result import compute_metrics, headline
from tetra_drake.robot.measures import CentrePath
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import node_positions
from tetra_drake.scenario.metrics import (
    LEAST_WAY,
    METRICS,
    Metrics,
    compute_fitness,
    unmet_requirements,
)
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.settings.units import INCH

CIRCLE = CentrePath(
    np.linspace(0.0, 6.0, 25),
    np.array([[math.cos(t), math.sin(t), t] for t in np.linspace(0.0, 6.0, 25)]),
    np.linspace(0.5, -3.5, 25),
)
"""To the left, with a radius of 1 m, but turning to the right."""


STILL = CentrePath(np.linspace(0.0, 15.0, 61), np.zeros((61, 3)), np.zeros(61))
"""12 s after `steady_from` of walked()."""

ROWS = yaml.safe_load(Path(__file__).with_name("metrics.yaml").read_text("utf-8"))
STEADY = {"totals": make_totals(), "signals": np.zeros((49, 4))}


def steady_after(robot: Robot, time: float) -> Robot:
    """The robot in a simulation that counts as steady from a time (s) on."""
    scenario = robot.scenario.with_numbers({"simulation.steady_from": time})
    return dataclasses.replace(robot, scenario=scenario)


def walked(
    robot: Robot, way: float, *, path: CentrePath = STILL, steady_from: float = 3.0, **given: Any
) -> Metrics:
    """Those of a robot all of whose nodes have moved forward by a way (m) in the steady stretch."""
    start = node_positions(robot.structure, robot.structure.initial_state)
    nodes = np.array([start, start, start + np.array([way, 0.0, 0.0])])
    robot = steady_after(robot, steady_from)
    return compute_metrics(robot, nodes=nodes, path=path, **STEADY | given)


def test_metrics_are_the_displacements_of_figure_13(robot: Robot) -> None:
    start = node_positions(robot.structure, robot.structure.initial_state)
    steady, end = start.copy(), start.copy()
    steady[0, 0] += 0.1  # x1 after the transients
    end[0] += [0.5, -0.025, 0.0]  # x1, y1 at the end
    end[1, 0] += 0.45  # x2
    end[19, 0] += 0.6  # x3, the tip of T5
    robot, nodes = steady_after(robot, 0.0), np.array([start, steady, end])
    metrics = compute_metrics(robot, nodes=nodes, path=CIRCLE, **STEADY)
    assert metrics.distance == pytest.approx(0.5)
    assert metrics.steady_distance == pytest.approx(0.4)
    assert metrics.twist == pytest.approx(0.05)
    assert metrics.lateral_drift == pytest.approx(0.025)
    # At the start the tip is four spacings and the height of a tetrahedron, 6 sqrt(2/3) in, ahead.
    ahead = (4 * 2.94 + 6.0 * (2.0 / 3.0) ** 0.5) * INCH
    assert metrics.lead == pytest.approx(ahead + 0.6 - 0.5)


def test_turning_and_bending_count_from_their_instants(robot: Robot) -> None:
    metrics = walked(robot, 0.0, path=CIRCLE, steady_from=2.0)
    assert metrics.heading_change == pytest.approx(-4.0)
    assert [metrics.path_curvature, metrics.path_radius] == pytest.approx([1.0, 1.0], rel=1e-6)
    # Straight until 4 s, the bend after it is the steady stretch's.
    late = CIRCLE.times > 4.0 - 1e-9
    straight = np.where(late[:, None], CIRCLE.centre, CIRCLE.times[:, None] * [1.0, 2.0, 0.0])
    partly = dataclasses.replace(CIRCLE, centre=straight)
    bent = walked(robot, 0.0, path=partly, steady_from=4.0)
    assert bent.path_radius == pytest.approx(1.0, rel=1e-6)
    line = dataclasses.replace(CIRCLE, centre=CIRCLE.times[:, None] * np.array([1.0, 2.0, 0.0]))
    assert walked(robot, 0.0, path=line, steady_from=0.0).path_radius == math.inf


def test_a_cost_of_transport_is_finite_unless_there_is_no_weight(robot: Robot) -> None:
    backward, standing = walked(robot, -0.24), walked(robot, 0.0)
    assert backward.cost_of_transport == pytest.approx(0.3 / (robot.weight * 0.24))
    assert standing.cost_of_transport == pytest.approx(0.3 / (robot.weight * LEAST_WAY))
    floating = Robot.of(robot.scenario.with_numbers({"robot.gravity": 0.0}))
    weightless = walked(floating, 0.24)
    assert weightless.cost_of_transport == math.inf
    assert weightless.to_json()["cost_of_transport"] is None


def test_fitness_is_equation_10_with_the_constants_of_table_7(scenario: Scenario) -> None:
    # In inches: 1 * 4 - 10 * 0.5 + 0 * 7 - 1 * 0.25
    names = "distance", "steady_distance", "twist", "lead", "lateral_drift"
    lengths = dict(zip(names, INCH * np.array([5.0, 4.0, 0.5, 7.0, 0.25]), strict=True))
    metrics = Metrics(**dict.fromkeys(METRICS, 1.0) | lengths)
    assert compute_fitness(metrics, scenario.objective) == pytest.approx(-1.25)
    lead = scenario.with_changes({"objective.lead": "2 /in", "objective.speed": "3 s/m"})
    assert compute_fitness(metrics, lead.objective) == pytest.approx(12.75 + 3.0)


@pytest.mark.parametrize(("changes", "text"), ROWS["headlines"])
def test_the_headline_is_what_the_objective_looks_for_and_where_it_walks(scenario, changes, text):
    metrics = dict.fromkeys(METRICS, 0.0) | {"distance": 2.0 * INCH, "rolled": 0.1}
    metrics["heading_change"] = math.pi
    assert headline(scenario.with_changes(changes), metrics) == text
    backward = headline(scenario, metrics | {"distance": -2.0 * INCH})
    assert backward == "walks 2.0 inches backward in 15 s"
    rolled, asked = metrics | {"rolled": -13.5}, scenario.with_sections(objective={"rolled": 1.0})
    assert headline(scenario, rolled) == "rolls 2.0 inches in 15 s"
    assert headline(asked, rolled) == "rolls 2.1 turns backward, 2.0 inches in 15 s"


@pytest.mark.parametrize(("changes", "text"), ROWS["unmet"])
def test_a_metric_below_its_limit_a_cost_above_it_or_nan_is_unmet(robot, changes, text):
    met = {"lead": 0.0127, "twist": 0.0127}
    metrics = dataclasses.replace(walked(robot, 0.0, path=CIRCLE, steady_from=0.0), **met | changes)
    limits = dict.fromkeys(met, 0.5 * INCH) | {"distance": 0.0}
    assert unmet_requirements(metrics, limits) == ([] if text is None else [text])
