"""How far the engines agree, and the figure of it."""

import numpy as np
import pandas
import pytest

from tetra_drake.evolution.record import REEVALUATIONS, trial_folder
from tetra_drake.evolution.tables import load_run
from tetra_drake.experiment.engines import (
    agreement,
    draw_engines,
    figure_engines,
    initial_distances,
)


def both(compiled, drake):
    return pandas.DataFrame({"compiled_in": compiled, "drake_in": drake})


def test_agreement_is_of_the_absolute_differences():
    compiled = np.linspace(1.0, 2.0, 101)
    found = agreement(both(compiled, compiled + np.linspace(-1.0, 1.0, 101)))
    assert (found.gaits, found.failed) == (101, 0)
    assert found.median_in == pytest.approx(0.5, abs=0.011)
    assert found.percentile_95_in == pytest.approx(0.95, abs=0.011)
    assert found.share_close == pytest.approx(0.1, abs=0.02)


def test_gaits_that_failed_on_one_engine_are_counted_and_left_out():
    found = agreement(both([1.0, np.nan, 3.0], [1.25, 2.0, np.nan]))
    assert (found.gaits, found.failed, found.median_in) == (1, 2, 0.25)


def test_gaits_that_go_opposite_ways_are_counted():
    assert agreement(both([-1.0, -1.0, 1.0, 2.0], [-2.0, 0.5, 1.0, 3.0])).share_direction == 0.75


def test_the_figure_shows_every_gait_and_names_median_and_percentile():
    compiled = np.linspace(-5.0, 8.0, 40)
    figure = figure_engines(both(compiled, compiled + 0.02))
    scatter, shares = figure.axes
    (dots,) = [line for line in scatter.lines if line.get_linestyle() == "None"]
    np.testing.assert_array_equal(dots.get_xdata(), compiled)
    np.testing.assert_array_equal(dots.get_ydata(), compiled + 0.02)
    assert [text.get_text() for text in shares.texts] == ["50 %: 0.02 in", "95 %: 0.02 in"]


def test_the_figure_of_a_run_is_of_its_initial_gaits(runs, tmp_path):
    folder = trial_folder(runs / "thesis", 0)
    first, second, failed, best, _ = (folder / "evaluations.jsonl").read_text().splitlines()
    (folder / REEVALUATIONS).write_text("\n".join([first, second, failed, best, ""]))
    run = load_run(runs / "thesis")
    assert initial_distances(run)["index"].tolist() == [0, 1, 2]
    assert draw_engines(run, tmp_path)
    assert {path.name for path in tmp_path.glob("engines.*")} == {"engines.svg", "engines.png"}


def test_no_figure_is_drawn_of_gaits_that_were_evaluated_once_only(runs, tmp_path):
    assert not draw_engines(load_run(runs / "thesis"), tmp_path / "figures")
    assert not (tmp_path / "figures").exists()
