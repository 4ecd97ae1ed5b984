"""Figures 19 and 20."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray
from helpers.made_up_walk import LOAD, PERIOD, make_walk

from tetra_drake.figures.forces import figure_19_signal_and_tension, figure_20_ground_forces
from tetra_drake.figures.style import save_figure
from tetra_drake.scenario.units import POUND_FORCE


def test_any_number_of_tetrahedra_can_be_drawn(other_walk: xarray.Dataset, tmp_path: Path) -> None:
    save_figure(figure_19_signal_and_tension(other_walk), tmp_path, "19", kinds=["svg"])
    save_figure(figure_20_ground_forces(other_walk), tmp_path, "20", kinds=["svg"])
    assert all(10_000 < path.stat().st_size < 300_000 for path in tmp_path.iterdir())


class TestFigure19:
    def test_a_panel_for_each_junction_in_pounds(self, walk: xarray.Dataset) -> None:
        panels = figure_19_signal_and_tension(walk).axes
        assert len(panels) == 4
        for panel, junction in zip(panels, walk.junction.values, strict=True):
            tension, signal = panel.lines
            expected = walk.signal.sel(junction=junction) / POUND_FORCE
            np.testing.assert_allclose(signal.get_ydata(), expected)
            np.testing.assert_allclose(tension.get_ydata(), expected + 3.0 / POUND_FORCE)
            np.testing.assert_allclose(tension.get_xdata(), walk.time)
            assert tension.get_color() != signal.get_color()
            assert tension.get_linestyle() != signal.get_linestyle()
            assert panel.get_ylabel() == f"{junction}\n(lbf)"
        assert panels[-1].get_xlabel() == "time (s)"

    def test_the_thesis_beside_ours(self, walk: xarray.Dataset) -> None:
        title = figure_19_signal_and_tension(walk).get_suptitle()
        assert f"{4.0 / POUND_FORCE:.2f} lbf peak to peak (thesis: one pound)" in title


class TestFigure20:
    def test_a_panel_for_each_tetrahedron_and_the_lead_tip(self, walk: xarray.Dataset) -> None:
        panels = figure_20_ground_forces(walk).axes
        labels = [panel.get_ylabel() for panel in panels]
        assert labels == [*(f"T{i} bottom left\n(lbf)" for i in range(1, 6)), "T5 tip\n(lbf)"]
        assert panels[-1].get_xlabel() == "time (s)"

    def test_lines_are_the_forces_of_the_last_seconds(self, walk: xarray.Dataset) -> None:
        end = walk.sel(time=slice(6.0, None))
        panel = figure_20_ground_forces(walk, seconds=3.0).axes[0]
        normal, friction = panel.lines
        expected = end.normal_force.sel(contact="T1 bottom_left") / POUND_FORCE
        np.testing.assert_allclose(normal.get_xdata(), end.time)
        np.testing.assert_allclose(normal.get_ydata(), expected)
        np.testing.assert_allclose(friction.get_ydata(), -0.5 * expected)
        assert set(normal.get_ydata()) == {0.0, LOAD / POUND_FORCE}
        assert normal.get_color() != friction.get_color()

    def test_shading_and_share_say_when_a_node_is_off_the_ground(
        self, walk: xarray.Dataset
    ) -> None:
        figure = figure_20_ground_forces(walk.sel(time=slice(0.0, 4 * PERIOD)), seconds=4.0)
        first, second, *_, tip = figure.axes
        spans = [(patch.get_x(), patch.get_x() + patch.get_width()) for patch in first.patches]
        np.testing.assert_allclose(spans, [(4.0, 5.0), (6.0, 7.0)], atol=0.011)
        spans = [(patch.get_x(), patch.get_x() + patch.get_width()) for patch in second.patches]
        np.testing.assert_allclose(spans, [(5.0, 6.0), (7.0, 8.0)], atol=0.011)
        for panel, share in ((first, 50), (second, 50), (tip, 100)):
            title = panel.get_title(loc="right")
            percent = float(title.removeprefix("off the ground ").split(" %")[0])
            assert percent == pytest.approx(share, abs=1)

    def test_a_trajectory_may_be_shorter_than_what_is_shown(self) -> None:
        normal = figure_20_ground_forces(make_walk(duration=0.5)).axes[0].lines[0]
        assert normal.get_xdata()[0] == 0.0
