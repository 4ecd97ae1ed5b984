"""Distances of gaits that were evaluated on both engines, and the figure of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas
from helpers.synthetic_run import write_run

from tetra_drake.evolution.record import REEVALUATIONS, trial_folder
from tetra_drake.evolution.tables import load_run
from tetra_drake.figures.engines import both_engines, distances_on_both


def test_the_figure_shows_every_gait_with_median_and_percentile() -> None:
    compiled = np.linspace(-5.0, 8.0, 40)
    both = pandas.DataFrame({"compiled_in": compiled, "drake_in": compiled + 0.02})
    scatter, shares = both_engines(both).axes
    (dots,) = [line for line in scatter.lines if line.get_linestyle() == "None"]
    np.testing.assert_array_equal(dots.get_xdata(), compiled)
    np.testing.assert_array_equal(dots.get_ydata(), compiled + 0.02)
    marks = [line.get_xydata()[0] for line in shares.lines[1:]]
    np.testing.assert_allclose(marks, [(0.02, 50.0), (0.02, 95.0)])


def test_distances_on_both_are_those_of_reevaluated_gaits(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run", [[[(2.0, 0), (1.0, 1), (None, 2)], [(3.0, 1), (1.0, None)]]])
    assert distances_on_both(load_run(run)).empty
    folder = trial_folder(run, 0)
    lines = (folder / "evaluations.jsonl").read_text().splitlines()
    (folder / REEVALUATIONS).write_text("\n".join([*lines[:4], ""]))
    found = distances_on_both(load_run(run))
    assert found["index"].tolist() == [0, 1, 2, 3]
    np.testing.assert_allclose(found["compiled_in"], [1.0, 0.5, np.nan, 1.5])
    np.testing.assert_array_equal(found["drake_in"], found["compiled_in"])
