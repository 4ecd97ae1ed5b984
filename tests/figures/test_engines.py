"""Agreement of the engines, and the figure of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas
import pytest
from helpers.synthetic_run import write_run

from tetra_drake.evolution.record import REEVALUATIONS, trial_folder
from tetra_drake.evolution.tables import load_run
from tetra_drake.figures.engines import agreement, both_engines, distances_on_both


def both(compiled: object, drake: object) -> pandas.DataFrame:
    return pandas.DataFrame({"compiled_in": compiled, "drake_in": drake})


def test_agreement_is_of_the_absolute_differences() -> None:
    compiled = np.linspace(1.0, 2.0, 101)
    found = agreement(both(compiled, compiled + np.linspace(-1.0, 1.0, 101)))
    assert (found.gaits, found.failed) == (101, 0)
    assert found.median_in == pytest.approx(0.5, abs=0.011)
    assert found.percentile_95_in == pytest.approx(0.95, abs=0.011)
    assert found.share_close == pytest.approx(0.1, abs=0.02)


def test_failed_gaits_are_left_out_and_directions_compared() -> None:
    found = agreement(both([1.0, np.nan, 3.0], [1.25, 2.0, np.nan]))
    assert (found.gaits, found.failed, found.median_in) == (1, 2, 0.25)
    assert agreement(both([-1.0, -1.0, 1.0, 2.0], [-2.0, 0.5, 1.0, 3.0])).share_direction == 0.75


def test_the_figure_shows_every_gait_with_median_and_percentile() -> None:
    compiled = np.linspace(-5.0, 8.0, 40)
    scatter, shares = both_engines(both(compiled, compiled + 0.02)).axes
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
