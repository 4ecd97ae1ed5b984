"""Figures of one trajectory show its data, for any structure."""

import functools
import itertools

import numpy as np
import pytest
from helpers import prism
from helpers.made_up_walk import HEIGHT, LOAD, PERIOD, SPEED, make_row, make_walk
from matplotlib.colors import to_hex
from matplotlib.text import Text

from tetra_drake.figures.forces import ground_forces, signals_and_tensions
from tetra_drake.figures.motion import (
    before_and_after,
    one_step,
    path_of_the_centre,
    relative_distances,
    time_lapse,
)
from tetra_drake.figures.style import OKABE_ITO, common_style
from tetra_drake.results.measures import last_step, lifted
from tetra_drake.robot.ground import ground_heights
from tetra_drake.robot.tetrahedra import STRUTS
from tetra_drake.scenario.friction_kinds import Coulomb
from tetra_drake.scenario.terrain_kinds import Steps
from tetra_drake.scenario.units import INCH, POUND_FORCE

FIGURES = (
    relative_distances,
    time_lapse,
    path_of_the_centre,
    one_step,
    signals_and_tensions,
    ground_forces,
)
DOWNSTAIRS = {
    "robot.contacts": "all",
    "friction": Coulomb(),
    "terrain": Steps(height=-INCH, depth=6.0 * INCH, count=9),
}


ROW = make_row()


def arguments(draw, robot):
    """What a figure needs to know of the robot."""
    if draw in (time_lapse, path_of_the_centre):
        return [robot.structure]
    return [robot] if draw in (one_step, ground_forces) else []


@functools.cache
def walk_of(bodies, duration=9.0):
    """A walk that no test may change."""
    return make_walk(bodies=bodies, duration=duration)


@pytest.fixture
def walk():
    """A walk of five tetrahedra, which no test may change."""
    return walk_of(5)


def labels(figure):
    """Places (labels, 4) on the page, in pixels, of all texts but the numbers at ticks."""
    axes = [axis for panel in figure.axes for axis in (panel.xaxis, panel.yaxis)]
    ticks = {text for axis in axes for text in axis.get_ticklabels(which="both")}
    ticks |= {axis.offsetText for axis in axes}
    texts = [text for text in figure.findobj(Text) if text not in ticks and text.get_text()]
    return np.array([text.get_window_extent().extents for text in texts if text.get_visible()])


@pytest.mark.parametrize(
    ("bodies", "duration"), [(3, 0.5), pytest.param(12, 9.0, marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("draw", FIGURES)
def test_a_walk_is_drawn_on_a_page_of_bearable_size_with_no_label_on_another(
    draw, bodies, duration
):
    check_page(draw(walk_of(bodies, duration), *arguments(draw, make_row(bodies))))


def check_page(figure):
    """Checks that all is on a page of bearable size, and no label on another."""
    with common_style():
        figure.get_layout_engine().execute(figure)  # it settles in the second drawing
        figure.draw_without_rendering()
        (width, height), drawn = figure.get_size_inches(), figure.get_tightbbox()
    assert width <= 9.0 and height <= 11.5
    assert drawn.x0 >= 0.0 and drawn.y0 >= 0.0 and drawn.x1 <= width and drawn.y1 <= height
    for a, b in itertools.combinations(labels(figure), 2):
        overlap = np.minimum(a[2:], b[2:]) - np.maximum(a[:2], b[:2])
        assert overlap.min() <= 0.0


def robots(panel):
    """The lines that draw struts, (instants, bodies, struts)."""
    lines = [line for line in panel.lines if line.get_transform() == panel.transData]
    struts = [line for line in lines if len(line.get_xdata()) == 2 and line.get_marker() == "None"]
    return np.array(struts, dtype=object).reshape(-1, 5, len(STRUTS))


def test_relative_distances_are_in_inches(walk):
    [panel] = relative_distances(walk).axes
    lines = {line.get_label(): line for line in panel.lines}
    for i, name in enumerate(walk.body.values):
        np.testing.assert_allclose(lines[name].get_xdata(), walk.time)
        np.testing.assert_allclose(lines[name].get_ydata(), i * 2.94, rtol=1e-6, atol=1e-12)


def test_the_time_lapse_shows_instants_from_start_to_end(walk):
    [panel] = time_lapse(walk, ROW.structure, instants=4).axes
    lines = robots(panel)
    assert len(lines) == 4
    x = [min(np.concatenate([line.get_xdata() for line in row[0]])) for row in lines]
    np.testing.assert_allclose(x, SPEED * np.array([0.0, 3.0, 6.0, 9.0]) / INCH, atol=1e-9)
    y = [np.mean([line.get_ydata() for line in row[0]]) for row in lines]
    assert (np.diff(y) < -6.0).all()  # one below the other, so that none overlap
    assert panel.get_aspect() == 1.0
    assert len({line.get_color() for line in lines[0, :, 0]}) == 5
    numbers = [label.get_text().replace("in", "").split() for label in panel.get_yticklabels()]
    assert [float(way) for _, _, way in numbers] == [0.0, 1.18, 2.36, 3.54]


def test_the_path_of_the_centre_is_to_scale_with_the_heading_along_it(walk):
    # All bodies go along a circle at SPEED and turn with it.
    radius = 0.05
    angle = SPEED * walk.time.values / radius
    q_WB, p_WB = np.zeros(walk.q_WB.shape), np.zeros(walk.p_WB.shape)
    q_WB[..., 0], q_WB[..., 3] = np.cos(angle / 2)[:, None], np.sin(angle / 2)[:, None]
    x, y = radius * np.sin(angle), radius * (1.0 - np.cos(angle))
    p_WB[..., 0], p_WB[..., 1] = x[:, None], y[:, None]
    turned = walk.assign(q_WB=(walk.q_WB.dims, q_WB), p_WB=(walk.p_WB.dims, p_WB))
    figure = path_of_the_centre(turned, ROW.structure, instants=4)
    [panel] = figure.axes
    assert panel.get_aspect() == 1.0
    path, start, end = panel.lines
    np.testing.assert_allclose(path.get_xydata() * INCH, np.column_stack([x, y]), atol=1e-12)
    assert start.get_xydata().tolist() == path.get_xydata()[:1].tolist()
    assert end.get_xydata().tolist() == path.get_xydata()[-1:].tolist()
    [arrows] = panel.collections
    headings = np.arctan2(arrows.V, arrows.U)
    np.testing.assert_allclose(headings, angle[[0, 300, 600, 900]], atol=1e-9)
    np.testing.assert_allclose(arrows.XY, path.get_xydata()[[0, 300, 600, 900]])
    for shown, drawn in ((panel.get_xlim(), x / INCH), (panel.get_ylim(), y / INCH)):
        assert shown[0] < drawn.min() <= drawn.max() < shown[1]


def test_distances_before_and_after_have_one_scale(walk):
    slow = walk.assign(p_WN=0.5 * walk.p_WN)
    walks = [(r"$\cost$ " + "long " * 100, slow), ("$", walk)]
    figure = before_and_after(walks, ROW.structure)
    before, after = figure.axes
    assert before.get_ylim() == after.get_ylim()
    for panel, speed in ((before, 0.5 * SPEED), (after, SPEED)):
        walked = panel.lines[0].get_ydata()
        np.testing.assert_allclose(walked, speed * walk.time / INCH, atol=1e-9)


def test_in_one_step_tetrahedra_off_the_ground_stand_out(walk):
    start, end = last_step(walk)
    aloft = lifted(walk).sel(time=np.linspace(start, end, 5), method="nearest").values
    figure = one_step(walk, ROW, instants=5)
    assert f"{start:.2f} to {end:.2f} s" in figure.get_suptitle()
    for panel in figure.axes[:2]:
        assert panel.get_aspect() == 1.0
        colours = [[to_hex(line.get_color()) for line in row] for row in robots(panel)[..., 0]]
        np.testing.assert_array_equal(np.array(colours) == OKABE_ITO["vermillion"], aloft)


def test_paths_of_one_step_are_those_of_the_bottom_nodes(walk):
    panels = one_step(walk, ROW).axes[2:]
    assert [panel.get_title("left") for panel in panels] == walk.body.values.tolist()
    for panel in panels:
        path, in_the_air, start = panel.lines
        assert np.ptp(path.get_xdata()) == pytest.approx(SPEED * PERIOD / INCH, rel=0.04)
        assert path.get_ydata().max() == pytest.approx(HEIGHT / INCH, rel=1e-3)
        aloft = np.isfinite(in_the_air.get_ydata())
        np.testing.assert_array_equal(aloft, path.get_ydata() > 1e-9)
        assert start.get_xdata()[0] == 0.0
    # Without a step the end is shown.
    panel = one_step(walk.assign(signal=0.0 * walk.signal), ROW).axes[2]
    shown = 0.25 * float(walk.time[-1]) * SPEED / INCH
    assert np.ptp(panel.lines[0].get_xdata()) == pytest.approx(shown, rel=0.01)


def test_tensions_are_those_of_the_driven_cables(walk):
    panels = signals_and_tensions(walk).axes
    for panel, oscillator in zip(panels, walk.oscillator.values, strict=True):
        tension, signal = panel.lines
        expected = walk.signal.sel(oscillator=oscillator) / POUND_FORCE
        np.testing.assert_allclose(signal.get_ydata(), expected)
        np.testing.assert_allclose(tension.get_ydata(), expected + 3.0 / POUND_FORCE)
        assert panel.get_title("left") == oscillator


def test_a_column_shows_the_signals_of_the_same_cables():
    groups = [["outer top", "inner top"], ["inner bottom_right"], ["inner bottom_left"]]
    driven = {"robot.actuation": groups}
    figure = signals_and_tensions(make_walk(bodies=3, duration=1.0, changes=driven))
    figure.get_layout_engine().execute(figure)
    assert len(figure.axes) == 6
    cables = {}
    for panel in figure.axes:
        _, name = panel.get_title("left").split(" ", 1)
        cables.setdefault(round(panel.get_position().x0, 3), set()).add(name)
    assert [len(names) for names in cables.values()] == [1, 1, 1]


def test_ground_forces_are_those_of_the_last_seconds(walk):
    panels = ground_forces(walk, ROW, seconds=3.0).axes
    names = [f"T{i} bottom left" for i in range(1, 6)]
    assert [panel.get_title("left") for panel in panels] == names
    end = walk.sel(time=slice(6.0, None))
    normal, friction, _ = panels[0].lines
    expected = end.normal_force.sel(contact="T1 bottom_left") / POUND_FORCE
    np.testing.assert_allclose(normal.get_xdata(), end.time)
    np.testing.assert_allclose(normal.get_ydata(), expected)
    np.testing.assert_allclose(friction.get_ydata(), -0.5 * expected)
    assert set(normal.get_ydata()) == {0.0, LOAD / POUND_FORCE}


def test_flights_are_shaded_landings_marked_and_impacts_do_not_set_the_scale(walk):
    four = walk.sel(time=slice(0.0, 4 * PERIOD)).copy(deep=True)
    four.normal_force[int(np.argmin(np.abs(four.time.values - 5.5))), 0] = 100.0 * LOAD
    panel, *_ = ground_forces(four, ROW, seconds=4.0).axes
    spans = [(patch.get_x(), patch.get_x() + patch.get_width()) for patch in panel.patches]
    np.testing.assert_allclose(spans, [(4.0, 5.0), (6.0, 7.0)], atol=0.011)
    assert panel.get_title(loc="right").split()[1] in ("49", "50", "51")
    np.testing.assert_allclose(panel.lines[-1].get_xdata(), [5.0, 7.0], atol=0.011)
    low, high = panel.get_ylim()
    assert low < -0.5 * LOAD / POUND_FORCE
    assert LOAD / POUND_FORCE < high < 2.0 * LOAD / POUND_FORCE
    assert max(panel.lines[0].get_ydata()) > 50.0 * high


def test_one_step_shows_the_ground_in_side_views_if_it_is_not_flat(walk):
    robot = make_row(changes=DOWNSTAIRS)
    figure = one_step(walk, robot, instants=3)
    _, side, *_ = figure.axes
    profiles = [line for line in side.lines if len(line.get_xdata()) > 300]
    assert len(profiles) == 3
    for line in profiles:
        x, z = line.get_xdata(), line.get_ydata()
        expected = ground_heights(np.column_stack([x, 0.0 * x]) * INCH, robot.ground) / INCH
        np.testing.assert_allclose(z - z[0], expected - expected[0], rtol=0, atol=1e-9)
        assert np.ptp(z) > 0.9  # the robot's tip is above the first step down
    assert side.get_ylim()[0] < min(line.get_ydata().min() for line in profiles)


def test_ground_forces_show_all_that_touches_and_where_left_and_right_differ(walk):
    every = walk.drop_vars("contact_body").reindex(contact=walk.node.values, fill_value=0)
    every = every.assign_coords(contact_body=("contact", walk.node_body.values))
    every.normal_force.loc[{"contact": "T2 tip"}][-10:] = LOAD
    every.normal_force.loc[{"contact": "T3 tip"}][:10] = LOAD  # before the time shown
    every.normal_force.loc[{"contact": "T4 bottom_right"}] *= 0.5
    left = [f"T{i} bottom left" for i in range(1, 6)]
    shown = [panel.get_title("left") for panel in ground_forces(every, ROW).axes]
    assert shown == sorted({*left, "T2 tip", "T4 bottom right"})


@pytest.fixture(scope="module")
def carried():
    """A robot that is no row, and its motion."""
    robot = prism.make_prism()
    return robot, prism.slide_prism(robot)


@pytest.mark.parametrize("draw", FIGURES)
def test_figures_of_any_structure_are_drawn_on_a_page(draw, carried):
    robot, motion = carried
    check_page(draw(motion, *arguments(draw, robot)))


def test_bars_are_named_where_they_end(carried):
    robot, motion = carried
    [panel] = time_lapse(motion, robot.structure).axes
    assert [text.get_text() for text in panel.texts] == ["n0 n4", "n1 n5", "n2 n3"]
    upper = motion.p_WN.sel(node=["n4", "n1", "n3"])[0, :, :2] / INCH  # with the greatest y
    apart = np.array([text.xy for text in panel.texts]) - upper.values
    np.testing.assert_allclose(apart[:, 1], 0.0, atol=1e-9)
    assert np.abs(apart[:, 0]).max() < 1.0  # moved into the panel


def test_of_a_structure_that_is_no_row_the_centre_is_shown(carried):
    robot, motion = carried
    way = prism.SPEED * motion.time / INCH
    [panel, _] = before_and_after([("a", motion), ("b", motion)], robot.structure).axes
    np.testing.assert_allclose(panel.lines[0].get_ydata(), way, atol=1e-9)
    [panel] = path_of_the_centre(motion, robot.structure).axes
    assert not panel.collections, "no arrows, as it has no heading"
    *_, panel = one_step(motion, robot).axes
    assert panel.get_title("left") == "centre"
    step = 0.5 * prism.PERIOD
    assert np.ptp(panel.lines[0].get_xdata()) > step * prism.SPEED / INCH


def test_bars_are_drawn_from_node_to_node(carried):
    robot, motion = carried
    [panel] = time_lapse(motion, robot.structure, instants=2).axes
    struts = [line.get_xydata() for line in panel.lines if len(line.get_xdata()) == 2][:3]
    p_WN = motion.p_WN.values[0, :, :2] / INCH
    np.testing.assert_allclose(struts, p_WN.reshape(3, 2, 2), atol=1e-12)


def test_ground_forces_of_bars_are_those_of_nodes_below(carried):
    robot, motion = carried
    shown = [panel.get_title("left") for panel in ground_forces(motion, robot).axes]
    assert shown == ["n0", "n1", "n2"]
    rolled = motion.copy(deep=True)
    rolled.normal_force.loc[{"contact": ["n0", "n2"]}] = 0.0
    rolled.normal_force.loc[{"contact": "n4"}] = 0.2
    shown = [panel.get_title("left") for panel in ground_forces(rolled, robot).axes]
    assert shown == ["n4", "n1", "n2"]
