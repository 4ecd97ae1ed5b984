"""Figures 14, 15, 18 and 21."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray
from helpers.made_up_walk import PERIOD, SPEED, make_walk
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from tetra_drake import thesis
from tetra_drake.figures.motion import (
    figure_14_relative_distances,
    figure_15_time_lapse,
    figure_18_before_and_after,
    figure_21_one_step,
)
from tetra_drake.figures.style import OKABE_ITO, save_figure
from tetra_drake.results.measures import lifted
from tetra_drake.robot.structure import STRUTS
from tetra_drake.scenario.units import INCH

STRUT_ENDS = 3 * len(STRUTS)
"""Vertices of the line that draws a tetrahedron: each strut's ends and a gap."""


def tetrahedra(panel: Axes, bodies: int) -> np.ndarray:
    """The lines that draw tetrahedra, (instants, bodies)."""
    lines = [line for line in panel.lines if len(line.get_xdata()) == STRUT_ENDS]
    return np.array(lines, dtype=object).reshape(-1, bodies)


def draw_all(walk: xarray.Dataset) -> list[Figure]:
    return [
        figure_14_relative_distances(walk),
        figure_15_time_lapse(walk),
        figure_18_before_and_after(walk, walk, initial_label="a", evolved_label="b"),
        figure_21_one_step(walk),
    ]


def test_any_number_of_tetrahedra_can_be_drawn(other_walk: xarray.Dataset, tmp_path: Path) -> None:
    for i, figure in enumerate(draw_all(other_walk)):
        save_figure(figure, tmp_path, str(i), kinds=["svg"])
    assert all(10_000 < path.stat().st_size < 300_000 for path in tmp_path.iterdir())


class TestFigure14:
    def test_lines_are_the_distances_in_inches(self, walk: xarray.Dataset) -> None:
        [panel] = figure_14_relative_distances(walk).axes
        lines = {
            line.get_label(): line for line in panel.lines if line.get_label() in walk.tetrahedron
        }
        assert list(lines) == ["T1", "T2", "T3", "T4", "T5"]
        np.testing.assert_allclose(lines["T3"].get_xdata(), walk.time)
        np.testing.assert_allclose(lines["T3"].get_ydata(), 2 * 2.94, rtol=1e-6)
        assert len({line.get_color() for line in lines.values()}) == 5
        assert (panel.get_xlabel(), panel.get_ylabel()) == ("time (s)", "distance from T1 (in)")


class TestFigure15:
    def test_shows_the_robot_at_instants_from_start_to_end(self, walk: xarray.Dataset) -> None:
        [panel] = figure_15_time_lapse(walk, instants=4).axes
        robots = tetrahedra(panel, 5)
        assert len(robots) == 4
        x = [np.nanmin(robot[0].get_xdata()) for robot in robots]
        np.testing.assert_allclose(x, SPEED * np.array([0.0, 3.0, 6.0, 9.0]) / INCH, atol=1e-9)
        y = [np.nanmean(robot[0].get_ydata()) for robot in robots]
        assert (np.diff(y) < -6.0).all()  # each below the one before, so that none overlap
        assert panel.get_xlabel() == "x (in)"
        assert panel.get_aspect() == 1.0

    def test_rows_say_when_and_how_far(self, walk: xarray.Dataset) -> None:
        [panel] = figure_15_time_lapse(walk, instants=4).axes
        labels = [label.get_text() for label in panel.get_yticklabels()]
        assert labels == ["0 s\n+0.00 in", "3 s\n+1.18 in", "6 s\n+2.36 in", "9 s\n+3.54 in"]

    def test_tetrahedra_differ_in_colour(self, walk: xarray.Dataset) -> None:
        [panel] = figure_15_time_lapse(walk).axes
        assert len({line.get_color() for line in tetrahedra(panel, 5)[0]}) == 5


class TestFigure18:
    def test_one_scale_and_the_thesis_beside_ours(self, walk: xarray.Dataset) -> None:
        slow = walk.assign(p_WN=0.5 * walk.p_WN)
        figure = figure_18_before_and_after(slow, walk, initial_label="old", evolved_label="new")
        before, after = figure.axes
        assert before.get_ylim() == after.get_ylim()
        for panel, way, reported, label in (
            (before, 0.5 * SPEED, thesis.BEST_INITIAL_DISTANCE_IN, "old"),
            (after, SPEED, thesis.BEST_EVOLVED_DISTANCE_IN, "new"),
        ):
            walked, line = panel.lines
            np.testing.assert_allclose(walked.get_ydata(), way * walk.time / INCH, atol=1e-9)
            assert set(line.get_ydata()) == {reported}
            assert [text.get_text() for text in panel.texts] == [f"thesis: {reported:g} in"]
            assert panel.get_title().endswith(label)
            assert panel.get_xlabel() == "time (s)"
        assert before.get_ylabel() == "distance $x_1$ (in)"

    def test_any_name_can_be_drawn(self, walk: xarray.Dataset, tmp_path: Path) -> None:
        name = r"$\cost$ " + "long " * 100
        figure = figure_18_before_and_after(walk, walk, initial_label=name, evolved_label="$")
        save_figure(figure, tmp_path, "figure")
        assert len(figure.axes[0].get_title().splitlines()[1]) <= 60


class TestFigure21:
    def test_shows_one_period_from_above_and_from_the_side(self, walk: xarray.Dataset) -> None:
        above, side, *paths = figure_21_one_step(walk, instants=5).axes
        for panel in (above, side):
            assert len(tetrahedra(panel, 5)) == 5
            assert panel.get_aspect() == 1.0
            assert panel.get_xlabel() == "x (in)"
        seconds = [float(label.get_text()[:-2]) for label in above.get_yticklabels()]
        np.testing.assert_allclose(seconds, [0.0, 0.5, 1.0, 1.5, 2.0], atol=0.02)
        assert [panel.get_title() for panel in paths] == ["T1", "T2", "T3", "T4", "T5"]

    def test_tetrahedra_off_the_ground_stand_out(self, walk: xarray.Dataset) -> None:
        figure = figure_21_one_step(walk, instants=5)
        title = figure.get_suptitle()
        start = float(title.split("step, ")[1].split(" to")[0])
        for panel in figure.axes[:2]:
            for robot, time in zip(tetrahedra(panel, 5), start + np.arange(5) / 2.0, strict=True):
                off = lifted(walk).sel(time=time, method="nearest").values
                marked = [to_hex(line.get_color()) == OKABE_ITO["vermillion"] for line in robot]
                assert marked == off.tolist()

    def test_paths_are_those_of_the_bottom_nodes(self, walk: xarray.Dataset) -> None:
        for panel in figure_21_one_step(walk).axes[2:]:
            path, in_the_air, start = panel.lines
            assert np.ptp(path.get_xdata()) == pytest.approx(SPEED * PERIOD / INCH, rel=0.02)
            assert path.get_ydata().max() == pytest.approx(0.02 / INCH, rel=1e-3)
            aloft = np.isfinite(in_the_air.get_ydata())
            np.testing.assert_array_equal(aloft, path.get_ydata() > 1e-9)
            assert start.get_xdata()[0] == 0.0

    def test_without_a_step_the_end_is_shown(self, walk: xarray.Dataset) -> None:
        still = walk.assign(signal=0.0 * walk.signal)
        title = figure_21_one_step(still).get_suptitle()
        assert "6.75 to 9.00 s" in title
        assert "no signal oscillates" in title

    def test_a_short_trajectory_will_do(self, tmp_path: Path) -> None:
        for i, figure in enumerate(draw_all(make_walk(duration=0.5))):
            save_figure(figure, tmp_path, str(i), kinds=["svg"])
