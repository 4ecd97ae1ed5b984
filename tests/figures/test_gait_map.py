"""The figure of a run's map of gaits."""

import numpy as np
import pytest
from helpers.synthetic_run import write_map
from matplotlib.collections import QuadMesh

from tetra_drake.evolution.run import load_run
from tetra_drake.figures.gait_map import map_of_gaits


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
    assert "3 of 6" in figure.axes[0].get_title("left")


def test_lucky_gaits_are_crosses_and_the_share_of_draws_is_beside(draw):
    figure = draw({0: 1.0, 1: 0.4, 2: 0.5})
    fitness, kept = cells(figure)
    np.testing.assert_array_equal(fitness, [[2.0, np.nan, np.nan], [np.nan, np.nan, 3.0]])
    np.testing.assert_allclose(kept, [[100.0, 40.0, np.nan], [np.nan, np.nan, 50.0]])
    (crosses,) = figure.axes[0].lines
    np.testing.assert_allclose(crosses.get_xydata(), [[1.5, 0.25]])
    assert "0 of 6" in draw({0: 0.0, 1: 0.0, 2: 0.0}).axes[0].get_title("left")
