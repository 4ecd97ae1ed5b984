"""Figures 16, 17, 22 and 23 and Table 8 show what the record says."""

import dataclasses
import math

import numpy as np
import pytest
from helpers.synthetic_run import PER_DISTANCE, iterations_with_means, tiny_scenario, write_run
from matplotlib.container import BarContainer, ErrorbarContainer

from tetra_drake import thesis
from tetra_drake.evolution.tables import load_run
from tetra_drake.figures.evolution import (
    average_over_trials,
    figure_16_initial_distances,
    figure_17_initial_fitness,
    figure_22_mean_fitness,
    figure_23_best_worst_average,
    share_backward,
    table_8_two_best,
)
from tetra_drake.figures.style import line_style


@pytest.fixture
def run_of(tmp_path):
    """run_of(trial, ...): the tables of a run made up of these trials."""

    def load(*trials, **options):
        return load_run(write_run(tmp_path / "run", trials, **options))

    return load


def initial(*fitnesses):
    return [[(fitness, place) for place, fitness in enumerate(fitnesses)]]


def series(axes):
    """The plotted lines, by their labels."""
    return {line.get_label(): line.get_xydata() for line in axes.lines}


# Figure 16


def bars(figure):
    best, worst = (c for c in figure.axes[0].containers if isinstance(c, BarContainer))
    return [bar.get_height() for bar in best], [bar.get_height() for bar in worst]


def test_fig_16_bars_are_the_distances_of_the_fittest_and_the_least_fit(run_of):
    run = run_of(initial(4.0, -6.0, 1.0), [*initial(2.0, 3.0), [(9.0, 0)]])
    figure = figure_16_initial_distances(run)
    assert bars(figure) == ([4.0 / PER_DISTANCE, 3.0 / PER_DISTANCE], [-3.0, 1.0])
    assert figure.axes[0].get_xticks().tolist() == [0, 1]
    assert "best of all: 2.0 inches" in figure.get_suptitle()
    dashed = figure.axes[0].lines[-1]
    assert dashed.get_ydata()[0] == thesis.BEST_INITIAL_DISTANCE_IN


def test_fig_16_leaves_out_what_failed(run_of):
    run = run_of(initial(None, 2.0, 4.0), initial(None, None), initial(1.0, None))
    figure = figure_16_initial_distances(run)
    assert bars(figure) == ([2.0, 0.5], [1.0, 0.5])
    assert figure.axes[0].get_xticks().tolist() == [0, 2]


# Figure 17


def test_fig_17_counts_the_gaits_that_go_forward_and_backward(run_of):
    fitnesses = np.random.default_rng(2).normal(0.5, 2.0, 40).tolist()
    run = run_of(initial(1.0), initial(*fitnesses, None))
    figure = figure_17_initial_fitness(run, 1)
    forward, backward = (c for c in figure.axes[0].containers if isinstance(c, BarContainer))
    edges = [bar.get_x() for bar in forward]
    edges.append(edges[-1] + forward[0].get_width())
    values = np.array(fitnesses)
    for container, chosen in ((forward, values[values >= 0.0]), (backward, values[values < 0.0])):
        assert [bar.get_height() for bar in container] == np.histogram(chosen, edges)[0].tolist()
    assert abs(min(edges, key=abs)) < 1e-12
    share = (values < 0.0).mean()
    assert share_backward(run, 1) == share
    assert f"{100 * share:.0f} % go backward (thesis: nearly half); 1 failed" in (
        figure.get_suptitle()
    )
    texts = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert texts == [f"{(values >= 0).sum()} go forward", f"{(values < 0).sum()} go backward"]


def test_fig_17_can_be_of_a_single_gait(run_of):
    figure = figure_17_initial_fitness(run_of(initial(2.5)), 0)
    assert sum(bar.get_height() for c in figure.axes[0].containers for bar in c) == 1


def test_nobody_goes_backward_where_all_have_failed(run_of):
    assert math.isnan(share_backward(run_of(initial(None, None)), 0))


# Figure 22


def test_fig_22_lines_are_the_recorded_means(run_of):
    run = run_of(
        iterations_with_means([1.0, 2.0, 5.0]),
        iterations_with_means([3.0, 3.5]),
        [[(None, 0)], [(7.0, 0)], [(8.0, 0)]],
        [[(None, 0)], [(None, 0)]],
    )
    figure = figure_22_mean_fitness(run)
    assert {label: xy.tolist() for label, xy in series(figure.axes[0]).items()} == {
        "trial 2": [[1, 7.0], [2, 8.0]],
        "trial 0": [[0, 1.0], [1, 2.0], [2, 5.0]],
        "trial 1": [[0, 3.0], [1, 3.5]],
    }
    # The legend's order is that of the lines' ends.
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert texts == ["trial 2", "trial 0", "trial 1"]
    assert "rises in 3 of 3 (thesis: in all ten)" in figure.get_suptitle()


def test_fig_22_trials_keep_their_look_whatever_their_rank(run_of):
    run = run_of(*(iterations_with_means([float(n), n + 1.0]) for n in range(10)))
    turned = run.iterations.assign(mean_fitness=-run.iterations["mean_fitness"])
    for tables in (run, dataclasses.replace(run, iterations=turned)):
        lines = figure_22_mean_fitness(tables).axes[0].lines
        colours = {line.get_label(): line.get_color() for line in lines}
        assert colours == {f"trial {n}": line_style(n)["color"] for n in range(10)}


# Figure 23


def test_fig_23_shows_best_worst_and_average_with_deviation(run_of):
    means = [[1.0, 4.0, 6.0], [3.0, 3.0, 3.0], [2.0, 5.0, 5.5]]
    figure = figure_23_best_worst_average(run_of(*map(iterations_with_means, means)))
    axes = figure.axes[0]
    lines = {line.get_label(): line.get_ydata().tolist() for line in axes.lines}
    assert lines["best, trial 0"] == means[0]
    assert lines["worst, trial 1"] == means[1]
    (errorbars,) = (c for c in axes.containers if isinstance(c, ErrorbarContainer))
    average, _, (bars_drawn,) = errorbars
    assert average.get_ydata().tolist() == pytest.approx(np.mean(means, axis=0))
    heights = [np.ptp(segment[:, 1]) / 2 for segment in bars_drawn.get_segments()]
    assert heights == pytest.approx(np.std(means, axis=0, ddof=1))
    assert errorbars.get_label() == "average of 3 trials, with standard deviation"


def test_the_average_takes_ended_trials_with_their_last_mean(run_of):
    run = run_of(iterations_with_means([1.0, 2.0]), iterations_with_means([3.0, 4.0, 5.0, 8.0]))
    assert average_over_trials(run)["mean"].tolist() == [2.0, 3.0, 3.5, 5.0]


def test_the_average_ends_where_a_trial_still_goes_on(run_of):
    run = run_of(
        iterations_with_means([1.0, 2.0]),
        iterations_with_means([3.0, 4.0, 5.0]),
        iterations_with_means([5.0, 6.0, 7.0, 9.0]),
        unfinished=(1,),
    )
    assert average_over_trials(run)["mean"].tolist() == [3.0, 4.0, pytest.approx(14.0 / 3.0)]


def test_fig_23_of_one_trial_has_no_average(run_of):
    figure = figure_23_best_worst_average(run_of(iterations_with_means([1.0, 2.0, 4.0])))
    assert list(series(figure.axes[0])) == ["best, trial 0"]
    assert "one trial only" in figure.get_suptitle()
    assert not any(isinstance(c, ErrorbarContainer) for c in figure.axes[0].containers)


def test_a_single_iteration_is_a_visible_dot(run_of):
    run = run_of(initial(1.0, 2.0), initial(3.0))
    for figure in (figure_22_mean_fitness(run), figure_23_best_worst_average(run)):
        for line in figure.axes[0].lines:
            if line.get_label().endswith(("trial 0", "trial 1")):
                assert len(line.get_xydata()) == 1
                assert line.get_marker() == "o"


# Table 8


def test_table_8_is_the_difference_of_the_two_best(run_of):
    scenario = tiny_scenario()
    scenario.robot.tetrahedra = 5
    run = run_of([*initial(1.0, 4.0, 2.5), [(5.0, 1), (3.0, None)]], scenario=scenario)
    table = table_8_two_best(run, 0)
    assert table.index.tolist() == ["fitness", *(f"w{i}" for i in range(1, 25)), "tau_A", "tau_B"]
    genomes = run.evaluations[
        ["fitness", *(f"weight_{i}" for i in range(1, 25)), "tau_a_s", "tau_b_s"]
    ].to_numpy(dtype=float)
    assert table["best"].tolist() == genomes[3].tolist()
    assert table["second"].tolist() == genomes[2].tolist()
    assert table["difference"].tolist() == np.abs(genomes[3] - genomes[2]).tolist()
    theirs = table["thesis"]
    assert (theirs["fitness"], theirs["w1"], theirs["w20"], theirs["w24"]) == (
        *(0.0006, 0.0594, 0.3806, 0.1322),
    )
    assert theirs[["tau_A", "tau_B"]].tolist() == [0.0, 0.0]


def test_table_8_of_another_robot_has_no_numbers_of_the_thesis(run_of):
    table = table_8_two_best(run_of(initial(1.0, 2.0)), 0)
    assert len(table) == 1 + 4 + 2
    assert table["thesis"].isna().all()
    assert table["difference"]["fitness"] == 1.0


def test_there_is_no_table_8_without_two_gaits(run_of):
    assert table_8_two_best(run_of(initial(1.0, None)), 0) is None
