"""Figures 5 and 6."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes

from tetra_drake.figures.contact import figure_05_settling, figure_06_sliding
from tetra_drake.figures.style import save_figure
from tetra_drake.parts.settling_node import bounce, settle
from tetra_drake.parts.single_tetrahedron import Motion
from tetra_drake.parts.sliding_tetrahedron import LEADING, slide, slips, travel
from tetra_drake.robot.structure import BOTTOM_LEFT
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.units import INCH, POUND_FORCE


@pytest.fixture(scope="module")
def settling() -> tuple[Motion, Motion]:
    scenario = load_scenario("thesis")
    return settle(scenario), bounce(scenario)


@pytest.fixture(scope="module")
def sliding() -> Motion:
    return slide(load_scenario("thesis"))


def line(panel: Axes, index: int) -> np.ndarray:
    """(2, samples): x and y of a line of the panel."""
    return np.array(panel.lines[index].get_data())


class TestFigure5:
    def test_lines_are_height_and_normal_force(self, settling: tuple[Motion, Motion]) -> None:
        above, below = figure_05_settling(*settling).axes
        for index, motion in enumerate(settling):
            heights = 1e3 * motion.p_WN[:, BOTTOM_LEFT, 2] / INCH
            forces = motion.normal_forces[:, BOTTOM_LEFT] / POUND_FORCE
            np.testing.assert_allclose(line(above, index), [1e3 * motion.times, heights])
            np.testing.assert_allclose(line(below, index), [1e3 * motion.times, forces])
        assert above.lines[0].get_color() != above.lines[1].get_color()
        assert above.get_ylabel() == "height of the node (0.001 in)"
        assert below.get_ylabel() == "normal force (lbf)"
        assert below.get_xlabel() == "time (ms)"

    def test_the_settling_is_within_the_axes(self, settling: tuple[Motion, Motion]) -> None:
        above, _ = figure_05_settling(*settling).axes
        low, high = above.get_ylim()
        heights = line(above, 0)[1]
        assert low < heights.min() < 0.0 < heights.max() < high

    def test_the_thesis_beside_ours(self, settling: tuple[Motion, Motion]) -> None:
        title = figure_05_settling(*settling).get_suptitle()
        assert "impact at 0.120 in/s (thesis: about 0.12)" in title
        assert "0.92 (thesis: 0.9)" in title

    def test_what_never_rebounds_has_no_restitution(self, settling: tuple[Motion, Motion]) -> None:
        title = figure_05_settling(settling[0], settling[0]).get_suptitle()
        assert "restitution, without weight, none" in title


class TestFigure6:
    def test_lines_are_velocity_friction_and_travel(self, sliding: Motion) -> None:
        panels = figure_06_sliding(sliding, stiction_range=0.004 * INCH).axes
        velocity, friction, way = panels[::2]
        milliseconds = 1e3 * sliding.times
        for panel, values in (
            (velocity, sliding.v_WN[:, LEADING, 0] / INCH),
            (friction, sliding.friction_forces[:, LEADING, 0] / POUND_FORCE),
            (way, 1e3 * travel(sliding, LEADING) / INCH),
        ):
            np.testing.assert_allclose(line(panel, 0), [milliseconds, values])
            assert panel.lines[0].get_color() != panel.lines[1].get_color()
        labels = [panel.get_ylabel() for panel in panels[::2]]
        assert labels == ["velocity (in/s)", "friction force (lbf)", "travel (0.001 in)"]
        assert [panel.get_xlabel() for panel in panels[-2:]] == ["time (ms)", "time (ms)"]

    def test_shading_is_when_the_leading_node_slips(self, sliding: Motion) -> None:
        [(start, end)] = slips(sliding, LEADING)
        for panel in figure_06_sliding(sliding, stiction_range=0.004 * INCH).axes:
            [span] = panel.patches
            assert span.get_x() == pytest.approx(1e3 * start)
            assert span.get_width() == pytest.approx(1e3 * (end - start))

    def test_the_node_breaks_free_at_the_stiction_range(self, sliding: Motion) -> None:
        way = figure_06_sliding(sliding, stiction_range=0.004 * INCH).axes[4]
        np.testing.assert_allclose(way.lines[-1].get_ydata(), 4.0)
        [span] = way.patches
        milliseconds, thousandths = line(way, 0)
        assert np.interp(span.get_x(), milliseconds, thousandths) == pytest.approx(4.0, rel=1e-3)

    def test_one_that_never_slips_can_be_drawn(self, scenario: Scenario, tmp_path: Path) -> None:
        wide = 20.0 * scenario.friction.stiction_range
        scenario = scenario.with_changes({"friction.stiction_range": wide})
        motion = slide(scenario, duration=0.01)
        assert slips(motion, LEADING) == []
        figure = figure_06_sliding(motion, stiction_range=wide)
        save_figure(figure, tmp_path, "figure", kinds=["svg"])
