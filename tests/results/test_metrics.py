"""The thesis's metrics and fitness (Eq. 10)."""

from __future__ import annotations

import numpy as np
import pytest

from tetra_drake.results.metrics import Metrics, compute_fitness, compute_metrics
from tetra_drake.robot.structure import MakeStructure, node_positions
from tetra_drake.scenario.schema import Scenario


def test_metrics_are_the_displacements_of_figure_13_in_inches(scenario: Scenario) -> None:
    structure = MakeStructure(scenario.robot, scenario.cables)
    start = node_positions(structure, structure.initial_state)
    steady, end = start.copy(), start.copy()
    inch = 0.0254
    steady[0, 0] += 1.0 * inch  # x1 after the transients
    end[0] += np.array([5.0, -0.25, 0.0]) * inch  # x1, y1 at the end
    end[1, 0] += 4.5 * inch  # x2
    end[19, 0] += 6.0 * inch  # x3, the tip of T5
    metrics = compute_metrics(structure, start=start, steady=steady, end=end)
    assert metrics.distance_in == pytest.approx(5.0)
    assert metrics.steady_distance_in == pytest.approx(4.0)
    assert metrics.heading_error_in == pytest.approx(0.5)
    assert metrics.lateral_drift_in == pytest.approx(0.25)
    # At the start the tip is four spacings and the height of a tetrahedron, 6 sqrt(2/3) in, ahead.
    ahead = 4 * 2.94 + 6.0 * (2.0 / 3.0) ** 0.5
    assert metrics.direction_in == pytest.approx(ahead + 6.0 - 5.0)


def test_fitness_is_equation_10_with_the_constants_of_table_7(scenario: Scenario) -> None:
    # 1 * 4 - 10 * 0.5 + 0 * 7 - 1 * 0.25
    metrics = Metrics(
        distance_in=5.0,
        steady_distance_in=4.0,
        heading_error_in=0.5,
        direction_in=7.0,
        lateral_drift_in=0.25,
    )
    assert compute_fitness(metrics, scenario.fitness) == pytest.approx(-1.25)
    scenario.fitness.direction = 2.0
    assert compute_fitness(metrics, scenario.fitness) == pytest.approx(12.75)
