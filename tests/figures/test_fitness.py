"""Figures and tables of a run show what its record holds."""

import dataclasses

import numpy as np
import pytest
from helpers.synthetic_run import PER_DISTANCE, write_run
from matplotlib.container import BarContainer, ErrorbarContainer

from tetra_drake.evolution.run import load_run
from tetra_drake.figures.fitness import (
    fitness_of_trials,
    initial_distances,
    initial_fitness,
)


@pytest.fixture
def run_of(tmp_path):
    """run_of(trial, ...): a recorded run of these trials."""
    return lambda *trials, **options: load_run(write_run(tmp_path / "run", trials, **options))


def initial(*fitnesses):
    return [[(fitness, place) for place, fitness in enumerate(fitnesses)]]


def with_means(*means):
    """A trial whose population of one has these fitnesses, one after the other."""
    return [[(mean, 0)] for mean in means]


def lines(figure):
    """The points of the lines with a label of their own."""
    points = {line.get_label(): line.get_xydata().tolist() for line in figure.axes[0].lines}
    return {label: xy for label, xy in points.items() if not label.startswith("_")}


def bar_groups(figure):
    return [c for c in figure.axes[0].containers if isinstance(c, BarContainer)]


def bars(figure):
    return [[bar.get_height() for bar in group] for group in bar_groups(figure)]


def test_initial_distances_are_those_of_the_fittest_and_least_fit(run_of):
    run = run_of(
        initial(4.0, -6.0, None, 1.0), initial(None, None), [*initial(2.0, 3.0), [(9.0, 0)]]
    )
    figure = initial_distances(run)
    best, worst = bars(figure)
    assert best == pytest.approx([4.0 / PER_DISTANCE, 3.0 / PER_DISTANCE])
    assert worst == pytest.approx([-6.0 / PER_DISTANCE, 2.0 / PER_DISTANCE])
    assert figure.axes[0].get_xticks().tolist() == [0, 2]


def test_initial_fitness_counts_gaits_that_walk_forward_and_backward(run_of):
    fitnesses = np.random.default_rng(2).normal(0.5, 2.0, 40)
    run = run_of(initial(1.0), initial(*fitnesses.tolist(), None))
    figure = initial_fitness(run, 1)
    forward, backward = bars(figure)
    group = bar_groups(figure)[0]
    edges = [bar.get_x() for bar in group]
    edges.append(edges[-1] + group[0].get_width())
    assert forward == np.histogram(fitnesses[fitnesses >= 0.0], edges)[0].tolist()
    assert backward == np.histogram(fitnesses[fitnesses < 0.0], edges)[0].tolist()
    assert abs(min(edges, key=abs)) < 1e-12
    assert f"{100 * (fitnesses < 0.0).mean():.0f} %" in figure.get_suptitle()
    assert sum(map(sum, bars(initial_fitness(run, 0)))) == 1


def test_fitness_lines_are_the_recorded_means_in_the_order_of_their_ends(run_of):
    run = run_of(
        with_means(1.0, 2.0, 5.0),
        with_means(3.0, 3.5),
        with_means(None, 7.0, 8.0),
        with_means(None, None),
    )
    expected = {
        "trial 2": [[1, 7.0], [2, 8.0]],
        "trial 0": [[0, 1.0], [1, 2.0], [2, 5.0]],
        "trial 1": [[0, 3.0], [1, 3.5]],
    }
    figure = fitness_of_trials(run)
    assert lines(figure) == expected
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    assert legend == [*expected, "average"]


def test_the_best_fitness_is_shown_where_the_optimiser_reports_no_mean(run_of):
    run = run_of([[(1.0, 0), (3.0, 1)], [(2.0, 0)], [(4.0, 0)]])
    run = dataclasses.replace(run, iterations=run.iterations.drop(columns="mean_fitness"))
    assert lines(fitness_of_trials(run)) == {"trial 0": [[0, 3.0], [1, 3.0], [2, 4.0]]}


@pytest.mark.parametrize(
    ("means", "unfinished", "average"),
    [
        ([[1.0, 2.0], [3.0, 4.0, 5.0, 8.0]], (), [2.0, 3.0, 3.5, 5.0]),
        ([[1.0, 2.0], [3.0, 4.0, 5.0], [5.0, 6.0, 7.0, 9.0]], (1,), [3.0, 4.0, 14.0 / 3.0]),
    ],
    ids=["ended trials count with their last mean", "the average ends with an unfinished trial"],
)
def test_the_average_over_trials(run_of, means, unfinished, average):
    run = run_of(*(with_means(*trial) for trial in means), unfinished=unfinished)
    axes = fitness_of_trials(run).axes[0]
    (errorbars,) = (c for c in axes.containers if isinstance(c, ErrorbarContainer))
    line, _, (segments,) = errorbars
    assert line.get_ydata().tolist() == pytest.approx(average)
    deviation = np.ptp(segments.get_segments()[0][:, 1]) / 2
    assert deviation == pytest.approx(np.std([mean[0] for mean in means], ddof=1))
