"""Figures of a run show what its record holds."""

import numpy as np
import pytest
from helpers.synthetic_run import PER_DISTANCE, write_map, write_run
from matplotlib.collections import QuadMesh
from matplotlib.container import BarContainer

from tetra_drake.evolution.run import load_run
from tetra_drake.figures.fitness import fitness_of_trials, initial_distances, initial_fitness
from tetra_drake.lab.elites.elites import map_of_gaits


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
    later = [*initial(2.0, 3.0), [(9.0, 0)]]
    run = run_of(initial(4.0, -6.0, None, 1.0), initial(None, None), later)
    best, worst = bars(initial_distances(run))
    assert best == pytest.approx([4.0 / PER_DISTANCE, 3.0 / PER_DISTANCE])
    assert worst == pytest.approx([-6.0 / PER_DISTANCE, 2.0 / PER_DISTANCE])


def test_initial_fitness_counts_gaits_that_walk_forward_and_backward(run_of):
    fitnesses = np.random.default_rng(2).normal(0.5, 2.0, 40)
    figure = initial_fitness(run_of(initial(1.0), initial(*fitnesses.tolist(), None)), 1)
    group = bar_groups(figure)[0]
    edges = [*(bar.get_x() for bar in group), group[-1].get_x() + group[-1].get_width()]
    sides = fitnesses[fitnesses >= 0.0], fitnesses[fitnesses < 0.0]  # forward, backward
    assert bars(figure) == [np.histogram(side, edges)[0].tolist() for side in sides]


def test_fitness_lines_are_the_recorded_means_over_evaluations(run_of):
    run = run_of(
        with_means(1.0, 2.0, 5.0),
        [[(3.0, 0), (3.0, 1)], [(5.0, 0), (5.0, 1)]],  # two evaluations in an iteration
        with_means(None, 7.0, 8.0),
        with_means(None, None),
    )
    assert lines(fitness_of_trials(run)) == {
        "trial 0": [[1, 1.0], [2, 2.0], [3, 5.0]],
        "trial 1": [[2, 3.0], [4, 5.0]],
        "trial 2": [[2, 7.0], [3, 8.0]],
    }


MEANS = [[1.0, 2.0], [3.0, 4.0, 5.0, 8.0], [4.0, 4.0, 4.0, 4.0], [6.0, 7.0, 9.0]]


# Ended trials count with their last mean; the median ends with an unfinished trial.
@pytest.mark.parametrize(
    ("unfinished", "medians"), [((), [3.5, 4.0, 4.5, 6.0]), ((3,), [3.5, 4.0, 4.5])]
)
def test_the_median_over_trials_and_its_quartiles(run_of, unfinished, medians):
    run = run_of(*(with_means(*trial) for trial in MEANS), unfinished=unfinished)
    figure = fitness_of_trials(run)
    assert [y for _, y in lines(figure)["median"]] == pytest.approx(medians)
    [band] = figure.axes[0].collections
    at_start = band.get_paths()[0].vertices
    at_start = at_start[at_start[:, 0] == 1, 1]
    quartiles = np.quantile([trial[0] for trial in MEANS], [0.25, 0.75])
    assert [at_start.min(), at_start.max()] == pytest.approx(quartiles)


@pytest.fixture
def draw(tmp_path):
    """draw({index: share of draws kept}): the figure of the map of a run."""
    return lambda kept: map_of_gaits(load_run(write_map(tmp_path / "run", kept)))


def cells(figure):
    """The values of the cells by rows, from the lowest, of each panel."""
    meshes = [m for axes in figure.axes for m in axes.collections if isinstance(m, QuadMesh)]
    return [mesh.get_array().filled(np.nan) for mesh in meshes if mesh.get_array().size == 6]


def test_cells_have_the_fitness_of_their_gaits(draw):
    figure = draw({})
    (fitness,) = cells(figure)
    np.testing.assert_array_equal(fitness, [[2.0, 4.0, np.nan], [np.nan, np.nan, 3.0]])
    axes = figure.axes[0]
    assert axes.get_xlim() == pytest.approx((0.0, 3.0))
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("speed (in/s)", "lifted")
    # The fittest is next to the corner of low lifted and high speed, too.
    numbers = {text.get_text(): text.get_position() for text in axes.texts}
    assert numbers["1"] == pytest.approx((1.5, 0.25))


def test_lucky_gaits_are_crosses_and_the_share_of_draws_is_beside(draw):
    figure = draw({0: 1.0, 1: 0.4, 2: 0.5})
    fitness, kept = cells(figure)
    np.testing.assert_array_equal(fitness, [[2.0, np.nan, np.nan], [np.nan, np.nan, 3.0]])
    np.testing.assert_allclose(kept, [[100.0, 40.0, np.nan], [np.nan, np.nan, 50.0]])
    (crosses,) = figure.axes[0].lines
    np.testing.assert_allclose(crosses.get_xydata(), [[1.5, 0.25]])
