"""Figures of one gait show its motion, for any structure."""

import numpy as np
import pytest
from helpers import prism
from helpers.drawn import result_of
from helpers.made_up_walk import HEIGHT, PERIOD, SPEED, make_row, make_walk
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex

from tetra_drake.figures.forces import ground_forces, signals_and_tensions
from tetra_drake.figures.gait_diagram import gait_diagram
from tetra_drake.figures.motion import (
    before_and_after,
    one_step,
    path_of_the_centre,
    relative_distances,
    time_lapse,
)
from tetra_drake.figures.style import OKABE_ITO
from tetra_drake.robot.measures import intervals, last_step
from tetra_drake.scenario.robot_tetrahedra import STRUTS
from tetra_drake.settings.units import INCH, POUND_FORCE

ROW = make_row()


@pytest.fixture(scope="module")
def walk():
    """A walk of five tetrahedra, which no test may change."""
    return make_walk()


def row(trajectory):
    return result_of(ROW, trajectory)


def struts(panel):
    """The lines that draw struts (views, struts, 2, 2), and their colours (views, struts)."""
    drawn = [each for each in panel.collections if isinstance(each, LineCollection)]
    views = [each for each in drawn if each.get_linewidths()[0] > 1.0]  # cables are thin
    colours = [[to_hex(colour) for colour in view.get_colors()] for view in views]
    return np.array([view.get_segments() for view in views]), np.array(colours)


def pictures(figure):
    return [panel for panel in figure.axes if panel.get_aspect() == 1.0]


def paths_of(figure):
    return [panel for panel in figure.axes if panel.get_aspect() != 1.0]


def test_stance_bars_show_when_feet_bear_load(walk):
    _, stance, speed = gait_diagram(row(walk)).axes
    start, end = last_step(walk)
    shown = end - 3.0 * (end - start), end
    np.testing.assert_allclose(speed.get_xlim(), shown, atol=0.02)
    feet = [label.get_text() for label in stance.get_yticklabels()]
    expected = [f"T{i} {side}" for i in range(1, 6) for side in ("right", "left")]
    assert feet == expected, "the rear is below; the tip never stands"
    part = walk.sel(time=slice(*speed.get_xlim()))
    for foot, bars, row_of_foot in zip(feet, stance.collections, stance.get_yticks(), strict=True):
        corners = np.array([path.vertices[[0, 2]] for path in bars.get_paths()])
        np.testing.assert_allclose(corners[..., 1].mean(axis=1), row_of_foot)
        load = part.normal_force.sel(contact=foot.replace(" ", " bottom_"))
        spans = intervals(part.time.values, load.values > 0.0)
        np.testing.assert_allclose(np.sort(corners[..., 0], axis=1), spans)
    duties = [float(text.get_text().split()[0]) for text in stance.texts]
    np.testing.assert_allclose(duties, 50.0, atol=2.0)


def test_the_gait_diagram_has_the_forward_speed_and_its_mean(walk):
    for units, length in (("in", INCH), ("SI", 1.0)):
        *_, panel = gait_diagram(row(walk), units=units, time=(2.0, 5.0)).axes
        [speed] = [line for line in panel.lines if len(line.get_xdata()) > 2]
        velocity = walk.v_WN.sel(time=slice(2.0, 5.0), axis="x").values
        np.testing.assert_allclose(speed.get_ydata(), velocity.mean(axis=1) / length)
        assert speed.get_xdata()[[0, -1]].tolist() == [2.0, 5.0]


def test_the_time_lapse_shows_instants_from_start_to_end(walk):
    ways = []
    for panel in pictures(time_lapse(row(walk), instants=4)):
        [lines], [colours] = struts(panel)
        assert len(lines) == 5 * len(STRUTS) and len(set(colours)) == 5
        ways.append(lines[..., 0].min())
    np.testing.assert_allclose(ways, SPEED * np.array([0.0, 3.0, 6.0, 9.0]) / INCH, atol=1e-9)
    part = pictures(time_lapse(row(walk), instants=2, time=(3.0, 6.0), units="SI"))
    assert [panel.get_title("left") for panel in part] == ["3 s: +0.0300 m", "6 s: +0.0600 m"]


def test_the_path_of_the_centre_is_to_scale_with_the_heading_along_it(walk):
    # Of a straight path the height is shown.
    [panel] = path_of_the_centre(row(walk), units="SI").axes
    centre = walk.p_WB.mean("body")
    np.testing.assert_allclose(panel.lines[0].get_xydata(), centre.sel(axis=["x", "z"]))
    # All bodies go along a circle at SPEED and turn with it.
    radius = 0.05
    angle = SPEED * walk.time.values / radius
    q_WB, p_WB = np.zeros(walk.q_WB.shape), np.zeros(walk.p_WB.shape)
    q_WB[..., 0], q_WB[..., 3] = np.cos(angle / 2)[:, None], np.sin(angle / 2)[:, None]
    x, y = radius * np.sin(angle), radius * (1.0 - np.cos(angle))
    p_WB[..., 0], p_WB[..., 1] = x[:, None], y[:, None]
    turned = walk.assign(q_WB=(walk.q_WB.dims, q_WB), p_WB=(walk.p_WB.dims, p_WB))
    [panel] = path_of_the_centre(row(turned), instants=4).axes
    assert panel.get_aspect() == 1.0
    path, start, end = panel.lines
    np.testing.assert_allclose(path.get_xydata() * INCH, np.column_stack([x, y]), atol=1e-12)
    ends = np.concatenate([start.get_xydata(), end.get_xydata()])
    np.testing.assert_array_equal(ends, path.get_xydata()[[0, -1]])
    [arrows] = panel.collections
    headings = np.arctan2(arrows.V, arrows.U)
    np.testing.assert_allclose(headings, angle[[0, 300, 600, 900]], atol=1e-9)
    np.testing.assert_allclose(arrows.XY, path.get_xydata()[[0, 300, 600, 900]])


def test_one_step_has_tetrahedra_off_the_ground_in_red_and_paths_of_bottom_nodes(walk):
    start, end = last_step(walk)
    now = walk.sel(time=np.linspace(start, end, 5), method="nearest")
    lowest = now.p_WN.sel(axis="z").values.reshape(5, 5, 4).min(axis=2)
    least = 0.02 * float(np.ptp(walk.p_WN[0].sel(axis="z").values))
    aloft = lowest > least
    assert aloft.any() and not aloft.all()
    figure = one_step(row(walk), instants=5)
    assert f"{start:.2f} to {end:.2f} s" in figure.get_suptitle()
    colours = np.array([struts(panel)[1] for panel in pictures(figure)])
    for view in (0, 1):
        of_bodies = colours[:, view, :: len(STRUTS)]
        np.testing.assert_array_equal(of_bodies == OKABE_ITO["vermillion"], aloft)
    paths = paths_of(figure)
    assert [panel.get_title("left") for panel in paths] == walk.body.values.tolist()
    for panel in paths:
        path, in_the_air, _ = panel.lines
        assert np.ptp(path.get_xdata()) == pytest.approx(SPEED * PERIOD / INCH, rel=0.04)
        assert path.get_ydata().max() == pytest.approx(HEIGHT / INCH, rel=1e-3)
        in_red = np.isfinite(in_the_air.get_ydata())
        np.testing.assert_array_equal(in_red, path.get_ydata() > least / INCH)


def test_tensions_are_those_of_the_driven_cables(walk):
    shown = signals_and_tensions(row(walk)).axes
    end = walk.sel(time=slice(5.0, None))
    for panel, oscillator in zip(shown, walk.oscillator.values, strict=True):
        _, tension, signal = panel.lines
        expected = end.signal.sel(oscillator=oscillator) / POUND_FORCE
        np.testing.assert_allclose(signal.get_ydata(), expected)
        np.testing.assert_allclose(tension.get_ydata(), expected + 3.0 / POUND_FORCE)
        assert panel.get_title("left") == f"{oscillator} outer bottom left", "the cable"


def test_ground_forces_are_those_of_the_time_shown(walk):
    shown = ground_forces(row(walk), time=(6.0, 9.0)).axes
    names = [f"T{i} left = right" for i in range(1, 6)]
    assert [panel.get_title("left") for panel in shown] == names
    end = walk.sel(time=slice(6.0, None))
    normal, friction, _ = shown[0].lines
    expected = end.normal_force.sel(contact="T1 bottom_left") / POUND_FORCE
    np.testing.assert_allclose(normal.get_xdata(), end.time)
    np.testing.assert_allclose(normal.get_ydata(), expected)
    np.testing.assert_allclose(friction.get_ydata(), -0.5 * expected)


def test_of_a_structure_that_is_no_row_the_centre_is_shown():
    robot = prism.make_prism()
    carried = result_of(robot, prism.slide_prism(robot))
    slow = carried.trajectory.assign(p_WN=0.5 * carried.trajectory.p_WN)
    [panel] = before_and_after(result_of(robot, slow), carried).axes
    for line, share in zip(panel.lines, (0.5, 1.0), strict=True):
        way = share * prism.SPEED * carried.trajectory.time / INCH
        np.testing.assert_allclose(line.get_ydata(), way, atol=1e-9)
    # From (n0 + n4) / 2 to (n1 + n5) / 2 and (n2 + n3) / 2, in m, and where they were at the start.
    [panel] = relative_distances(carried, units="SI").axes
    apart = [line.get_ydata()[0] for line in panel.lines]
    np.testing.assert_allclose(apart, np.repeat([-0.0316987, 0.0116025], 2), atol=1e-6)
    [panel] = paths_of(one_step(carried))
    assert panel.get_title("left") == "centre"
    assert np.ptp(panel.lines[0].get_xdata()) > 0.5 * prism.PERIOD * prism.SPEED / INCH
