"""The agreement of the two engines on gaits that were evaluated on both."""

import dataclasses

import numpy as np
import pandas
from engines import both_engines, distances_on_both
from helpers.synthetic_run import write_run

from tetra_drake.evolution.tables import load_run


def test_the_figure_shows_every_gait_with_median_and_percentile():
    compiled = np.linspace(-5.0, 8.0, 40)
    both = pandas.DataFrame({"compiled_in": compiled, "drake_in": compiled + 0.02})
    scatter, shares = both_engines(both).axes
    (dots,) = [line for line in scatter.lines if line.get_linestyle() == "None"]
    np.testing.assert_array_equal(dots.get_xydata(), both)
    marks = [line.get_xydata()[0] for line in shares.lines[1:]]
    np.testing.assert_allclose(marks, [(0.02, 50.0), (0.02, 95.0)])


def test_distances_on_both_are_those_of_reevaluated_gaits(tmp_path):
    trial = [[(2.0, 0), (1.0, 1), (None, 2)], [(3.0, 1), (1.0, None)]]
    run = load_run(write_run(tmp_path / "run", [trial]))
    assert distances_on_both(run).empty
    again = run.evaluations.head(4).drop(columns="placed")
    found = distances_on_both(dataclasses.replace(run, reevaluations=again))
    assert found["index"].tolist() == [0, 1, 2, 3]
    np.testing.assert_allclose(found["compiled_in"], [1.0, 0.5, np.nan, 1.5])
    np.testing.assert_array_equal(found["drake_in"], found["compiled_in"])
