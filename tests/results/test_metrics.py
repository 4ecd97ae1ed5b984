"""The metrics and the thesis's fitness (Eq. 10)."""

import pytest

from tetra_drake.results.metrics import Metrics, compute_fitness, compute_metrics
from tetra_drake.robot.structure import Structure, node_positions
from tetra_drake.scenario.schema import Scenario

INCH = 0.0254


def test_metrics_are_the_displacements_of_figure_13(structure: Structure) -> None:
    start = node_positions(structure, structure.initial_state)
    steady, end = start.copy(), start.copy()
    steady[0, 0] += 0.1  # x1 after the transients
    end[0] += [0.5, -0.025, 0.0]  # x1, y1 at the end
    end[1, 0] += 0.45  # x2
    end[19, 0] += 0.6  # x3, the tip of T5
    metrics = compute_metrics(structure, start=start, steady=steady, end=end)
    assert metrics.distance == pytest.approx(0.5)
    assert metrics.steady_distance == pytest.approx(0.4)
    assert metrics.twist == pytest.approx(0.05)
    assert metrics.lateral_drift == pytest.approx(0.025)
    # At the start the tip is four spacings and the height of a tetrahedron, 6 sqrt(2/3) in, ahead.
    ahead = (4 * 2.94 + 6.0 * (2.0 / 3.0) ** 0.5) * INCH
    assert metrics.lead == pytest.approx(ahead + 0.6 - 0.5)
    assert metrics.distance_in == pytest.approx(0.5 / INCH)
    assert metrics.in_inches()["twist_in"] == pytest.approx(0.05 / INCH)


def test_fitness_is_equation_10_with_the_constants_of_table_7(scenario: Scenario) -> None:
    # In inches: 1 * 4 - 10 * 0.5 + 0 * 7 - 1 * 0.25
    inches = {"distance": 5.0, "steady_distance": 4.0, "twist": 0.5, "lead": 7.0}
    inches["lateral_drift"] = 0.25
    metrics = Metrics(**{name: value * INCH for name, value in inches.items()})
    assert compute_fitness(metrics, scenario.fitness) == pytest.approx(-1.25)
    scenario.fitness.direction = 2.0
    assert compute_fitness(metrics, scenario.fitness) == pytest.approx(12.75)
