"""The figure of a run's map of gaits."""

import numpy as np
import pytest
from helpers.drawn import panels
from helpers.synthetic_run import tiny_scenario, write_run
from matplotlib.collections import QuadMesh

from tetra_drake.evolution.run import load_run
from tetra_drake.figures.gait_map import map_of_gaits
from tetra_drake.scenario.optimizer_kinds import QualityDiversity
from tetra_drake.scenario.units import INCH

PLACES = {2.0: (0.5, 0.1), 4.0: (1.5, 0.1), 3.0: (2.5, 0.9)}
"""Speed in in/s and lifted, by fitness: cells 0 0, 1 0 and 2 1."""


@pytest.fixture
def draw(tmp_path):
    """draw({index: share of draws kept}): the axes of the map of a run."""
    measures = {"speed": [0.0, 3.0 * INCH], "lifted": [0.0, 1.0]}
    kind = QualityDiversity(measures=measures, cells=[3, 2])
    scenario = tiny_scenario().with_changes({"optimizer": kind})
    metrics = {f: {"speed": x * INCH, "lifted": y} for f, (x, y) in PLACES.items()}
    trial = [[(fitness, None) for fitness in PLACES]]
    run = write_run(tmp_path / "run", [trial], scenario=scenario, metrics=metrics)

    def draw(kept):
        (run / "elites.jsonl").unlink(missing_ok=True)
        for index, share in kept.items():
            line = {"trial": 0, "index": index, "kept": share, "mean_distance": 0.1}
            load_run(run).file("elites.jsonl").append([line])
        return map_of_gaits(load_run(run))

    return draw


def cells(figure):
    """The values of the cells by rows, from the lowest, of each panel."""
    meshes = [m for axes in panels(figure) for m in axes.collections if isinstance(m, QuadMesh)]
    return [mesh.get_array().filled(np.nan) for mesh in meshes if mesh.get_array().size == 6]


def test_cells_have_the_fitness_of_their_gaits(draw):
    figure = draw({})
    (fitness,) = cells(figure)
    np.testing.assert_array_equal(fitness, [[2.0, 4.0, np.nan], [np.nan, np.nan, 3.0]])
    axes = panels(figure)[0]
    assert axes.get_xlim() == pytest.approx((0.0, 3.0))
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("speed (in/s)", "lifted")
    # The fittest is next to the corner of low lifted and high speed, too.
    numbers = {text.get_text(): text.get_position() for text in axes.texts}
    assert numbers["1"] == pytest.approx((1.5, 0.25))
    assert "3 of 6" in panels(figure)[0].get_title("left")


def test_lucky_gaits_are_crosses_and_the_share_of_draws_is_beside(draw):
    figure = draw({0: 1.0, 1: 0.4, 2: 0.5})
    fitness, kept = cells(figure)
    np.testing.assert_array_equal(fitness, [[2.0, np.nan, np.nan], [np.nan, np.nan, 3.0]])
    np.testing.assert_allclose(kept, [[100.0, 40.0, np.nan], [np.nan, np.nan, 50.0]])
    (crosses,) = panels(figure)[0].lines
    np.testing.assert_allclose(crosses.get_xydata(), [[1.5, 0.25]])
    assert "0 of 6" in panels(draw({0: 0.0, 1: 0.0, 2: 0.0}))[0].get_title("left")
