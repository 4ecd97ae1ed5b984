"""The figure of what distance is traded against."""

import pytest
from helpers.synthetic_run import PER_DISTANCE, write_run

from tetra_drake.evolution.tables import load_run
from tetra_drake.figures.pareto import pareto
from tetra_drake.figures.style import save_figure

COSTS = {20.0: 5.0, 18.0: 6.0, 16.0: 3.0, 10.0: 2.0, 9.0: 1.0, -30.0: 0.5}
"""Costs of transport by fitness. The front: 20, 16, 10, 9."""


@pytest.fixture
def draw(tmp_path):
    """draw(costs): the figure of a run whose gaits have these costs, by fitness."""

    def draw(costs):
        trial = [[(fitness, place) for place, fitness in enumerate([None, *costs])]]
        metrics = {fitness: {"cost_of_transport": cost} for fitness, cost in costs.items()}
        return pareto(load_run(write_run(tmp_path / "run", [trial], metrics=metrics)))

    return draw


def lines(axes, marker):
    return [line.get_xydata().tolist() for line in axes.lines if line.get_marker() == marker]


def test_the_front_is_stepped_among_all_gaits_that_walk_forward(draw):
    (axes,) = draw(COSTS).axes
    points = {fitness: [cost, fitness / PER_DISTANCE] for fitness, cost in COSTS.items()}
    gaits, front = (sorted(line) for line in lines(axes, "."))
    assert gaits == sorted(points[fitness] for fitness in COSTS if fitness > 0.0)
    assert front == [points[9.0], points[10.0], points[16.0], points[20.0]]
    (step,) = (line for line in axes.lines if line.get_drawstyle() == "steps-pre")
    assert step.get_xydata().tolist() == front[::-1]
    # The fittest and farthest is one gait, under one mark; the cheapest walks half as far.
    assert lines(axes, "o") == [[points[20.0]]]
    assert lines(axes, "s") == [[points[10.0]]]


def test_the_legend_names_trial_and_evaluation(draw):
    figure = draw(COSTS)
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert "fittest and farthest: trial 0, evaluation 1" in texts
    assert "cheapest: trial 0, evaluation 4" in texts


def test_costs_of_gaits_that_hardly_walk_lie_beyond_the_axis(draw):
    costs = {20.0 - i / 100: 2.0 + i / 100 for i in range(60)}
    (axes,) = draw(costs | {0.001: 1e6, 0.002: 1e5}).axes
    low, high = axes.get_xlim()
    assert low < 2.0 < 2.57 < high < 5.0
    assert axes.get_xscale() == "linear"


def test_a_wide_range_of_costs_has_a_logarithmic_axis(draw):
    (axes,) = draw({20.0: 50.0, 18.0: 1.0}).axes
    assert axes.get_xscale() == "log"
    assert axes.get_xlim()[0] < 1.0 < 50.0 < axes.get_xlim()[1]


def test_many_gaits_are_one_picture_within_the_svg(draw, tmp_path):
    # The farthest is the cheapest.
    figure = draw({float(i): 2.0 - i / 1000 for i in range(1, 1000)})
    save_figure(figure, tmp_path, "pareto", kinds=["svg"])
    svg = (tmp_path / "pareto.svg").read_text()
    assert "<image" in svg
    assert svg.count("<use") < 500  # letters, most of them
