"""Figures of a walking robot: distances, time lapses and one step."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tetra_drake.figures.style import (
    BELOW,
    LINE_COLOURS,
    OKABE_ITO,
    WIDTH_IN,
    Units,
    common_style,
    figure_of,
    inches,
    legend_below,
    line_style,
    name_panel,
    page,
    shown_part,
    split,
    spread,
    units_named,
    write_beside,
)
from tetra_drake.formatting import fixed, signed
from tetra_drake.results import measures
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.ground import ground_heights
from tetra_drake.robot.path import CentrePath
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import Structure, followed_nodes, node_positions
from tetra_drake.scenario.units import INCH

X, Y, Z = range(3)

OVERHEAD, SIDE = Y, Z  # World axis that a view shows up the page; across it is X

# Metres of the robot's world.
_MARGIN = 0.6 * INCH  # free space around a robot
_PROFILE = 0.05 * INCH  # distance between points of the ground's profile

# Inches on paper.
_ROOM = (WIDTH_IN - 0.3, 6.8)  # for time lapses on a page of their own
_TITLE, _GAP = 0.25, 0.12  # above each robot of a time lapse, and between two
_EDGES = 1.05  # above and below all of them
_NUMBERS = 0.5  # left of paths
_LETTER, _NAME_HEIGHT = 0.075, 0.15  # of the name of a body
_SQUARE = 5.0  # largest height of a path

_PATHS = 6  # largest number of panels of paths side by side
_ARROW = 0.08  # length of an arrow over that of the path
_STRAIGHT = 0.05  # a path is straight if it is narrower than this share of its length
_TALL = 0.6  # height over width of a robot, from which on instants of a step are beside each other
_CLEARANCE = 0.02  # from which on a body is off the ground, as a share of the robot's height

_ON_GROUND, _LIFTED = "0.2", OKABE_ITO["vermillion"]
_PATH: Any = {"color": OKABE_ITO["blue"], "linewidth": 1.1, "linestyle": "-"}
_GROUND: Any = {"color": "0.6", "linewidth": 0.8, "linestyle": "-"}
_SECONDS: Any = {"color": "0.4", "marker": "o", "linestyle": "", "markersize": 1.8}
_START: Any = {"color": "black", "marker": "o", "linestyle": "", "markerfacecolor": "white"}
_END: Any = {"color": "black", "marker": "s", "linestyle": ""}
_HEADING: Any = {
    "color": OKABE_ITO["vermillion"],
    "zorder": 2.5,
    "width": 0.004,
    "angles": "xy",
    "scale_units": "xy",
    "scale": 1.0,
}
_HEADING_MARK: Any = {"color": OKABE_ITO["vermillion"], "marker": ">", "linestyle": "-"}
_BEFORE: Any = {"color": "0.5", "linewidth": 1.3, "linestyle": "-"}
_AFTER: Any = {"color": OKABE_ITO["blue"], "linewidth": 1.6, "linestyle": "-"}


@common_style()
def relative_distances(
    result: SimulationResult,
    *,
    axes: Axes | None = None,
    time: tuple[float, float] | None = None,
    units: str = "in",
) -> Figure:
    """Distances along x from the first body to each other, between centres of mass, over time.

    Grey lines: the distances at the start."""
    unit, trajectory = units_named(units), shown_part(result.trajectory, time)
    distances = measures.relative_distances(trajectory) / unit.length
    first, *names = distances.body.values
    panel = page(axes, height_in=1.5 + min(0.6 * len(names), 5.0))
    for i, name in enumerate(names):
        line = distances.sel(body=name)
        panel.axhline(float(line[0]), color="0.6", linewidth=0.7)
        panel.plot(line.time, line, label=name, **line_style(i))
    low, high = panel.get_ylim()
    least = _NAME_HEIGHT / inches(panel)[1] * (high - low)
    places = spread(distances.sel(body=names).values[-1], least)
    for i, (name, end) in enumerate(zip(names, places, strict=True)):
        write_beside(panel, end, name, color=line_style(i)["color"])
    panel.set(xlabel="time (s)", ylabel=f"distance from {first} ({unit.length_name})")
    panel.set_title(f"Distance of each body from {first}", loc="left")
    return figure_of(panel)


@common_style()
def before_and_after(
    initial: SimulationResult,
    best: SimulationResult,
    *,
    axes: Axes | None = None,
    time: tuple[float, float] | None = None,
    units: str = "in",
) -> Figure:
    """Distance walked over time by a run's best gait, and by the best gait of the first iteration
    of the same trial."""
    unit = units_named(units)
    host = page(axes, height_in=3.8)
    before, after = (textwrap.shorten(result.name, 80) for result in (initial, best))
    looks = {f"before: {before}": _BEFORE, f"after: {after}": _AFTER}
    panel = split(host, below=legend_below(host, looks))[0, 0]
    ends = []
    for result, style in zip((initial, best), (_BEFORE, _AFTER), strict=True):
        part = shown_part(result.trajectory, time)
        walked = _distance_walked(result, unit).sel(time=part.time)
        panel.plot(walked.time, walked, **style)
        ends.append(float(walked[-1]))
    low, high = panel.get_ylim()
    places = spread(np.array(ends), _NAME_HEIGHT / inches(host)[1] * 1.3 * (high - low))
    for end, place, style in zip(ends, places, (_BEFORE, _AFTER), strict=True):
        text = f"{fixed(end, unit.digits)} {unit.length_name}"
        write_beside(panel, place, text, color=style["color"])
    panel.set(xlabel="time (s)", ylabel=f"distance ({unit.length_name})")
    host.set_title("Distance walked, before and after evolution", loc="left")
    return figure_of(host)


@common_style()
def time_lapse(
    result: SimulationResult,
    *,
    axes: Axes | None = None,
    time: tuple[float, float] | None = None,
    units: str = "in",
    instants: int = 6,
) -> Figure:
    """The robot from above at some instants, to scale, with the distance walked. Forward is to the
    right. The line is the path of its centre so far, with a dot at each full second."""
    structure, unit = result.robot.structure, units_named(units)
    trajectory = shown_part(result.trajectory, time)
    first, last = (float(trajectory.time[i]) for i in (0, -1))
    samples = _nearest(trajectory, np.linspace(first, last, instants))
    nodes, walked = trajectory.p_WN.values / unit.length, _distance_walked(result, unit)
    centre = structure.node_shares @ nodes
    wide, high = _extents(np.concatenate([nodes[samples].reshape(-1, 3), centre]), OVERHEAD, unit)
    room = _ROOM if axes is None else inches(axes)
    columns = _columns(instants, wide=np.ptp(wide), high=np.ptp(high), room=room)
    rows = math.ceil(instants / columns)
    width = room[0] / columns - _GAP
    host = page(axes, height_in=rows * (width * np.ptp(high) / np.ptp(wide) + _TITLE) + _EDGES)
    panels = _lapse_panels(host, rows, columns)
    for sample, panel in zip(samples, panels.ravel(), strict=False):
        now = float(trajectory.time[sample])
        colours = [LINE_COLOURS[i % len(LINE_COLOURS)] for i in range(len(structure.bodies))]
        _draw_struts(panel, nodes[sample][:, [X, Y]], structure, colours)
        seconds = _nearest(trajectory, np.arange(math.ceil(first), now + 1e-9))
        panel.plot(centre[: sample + 1, X], centre[: sample + 1, Y], **_PATH)
        panel.plot(centre[seconds, X], centre[seconds, Y], **_SECONDS)
        way = signed(float(walked.sel(time=now)), unit.digits)
        name_panel(panel, f"{now:.4g} s: {way} {unit.length_name}")
        panel.set(xlim=wide, ylim=high, aspect="equal")
    for panel in panels.ravel()[instants:]:
        panel.remove()
    _name_bodies(panels[0, 0], nodes[samples[0]][:, [X, Y]], structure, width_in=width)
    for panel in panels[-1]:
        panel.set_xlabel(f"x, forward ({unit.length_name}) →")
    host.set_title("Time lapse from above: time and distance walked", loc="left")
    return figure_of(host)


@common_style()
def path_of_the_centre(
    result: SimulationResult,
    *,
    axes: Axes | None = None,
    time: tuple[float, float] | None = None,
    units: str = "in",
    instants: int = 9,
) -> Figure:
    """The path of the robot's centre: from above and to scale, with arrows where a row heads; or,
    if it is straight, its height along x."""
    structure, unit = result.robot.structure, units_named(units)
    trajectory = shown_part(result.trajectory, time)
    path = measures.path_of_centre(trajectory, structure)
    points = path.centre / unit.length
    if np.ptp(points[:, Y]) < _STRAIGHT * np.ptp(points[:, X]):
        return _draw_height(page(axes, height_in=2.6), points, result.robot, unit)
    arrow = _ARROW * max(*np.ptp(points[:, :2], axis=0), _MARGIN / unit.length)
    ratio = np.ptp(points[:, Y]) / max(np.ptp(points[:, X]), arrow)
    host = page(axes, height_in=min((_ROOM[0] - _NUMBERS) * ratio, _SQUARE) + 1.4)
    looks = {"start": _START, f"after {path.times[-1]:.4g} s": _END}
    if structure.is_row:
        looks["heading"] = _HEADING_MARK
    panel = split(host, below=legend_below(host, looks))[0, 0]
    panel.plot(points[:, X], points[:, Y], **_PATH)
    if structure.is_row:
        samples = _nearest(trajectory, np.linspace(path.times[0], path.times[-1], instants))
        _draw_headings(panel, path, points, arrow, samples)
    panel.plot(points[0, X], points[0, Y], **_START)
    panel.plot(points[-1, X], points[-1, Y], **_END)
    panel.margins(0.1)
    panel.set_aspect("equal", adjustable="datalim")
    panel.set(xlabel=f"x ({unit.length_name})", ylabel=f"y ({unit.length_name})")
    host.set_title("Path of the centre from above", loc="left")
    return figure_of(host)


def _draw_headings(
    panel: Axes, path: CentrePath, points: np.ndarray, length: float, samples: np.ndarray
) -> None:
    """Arrows along the heading at some samples."""
    heading = path.heading[samples]
    ways = length * np.column_stack([np.cos(heading), np.sin(heading)])
    panel.quiver(points[samples, X], points[samples, Y], ways[:, X], ways[:, Y], **_HEADING)


def _draw_height(panel: Axes, points: np.ndarray, robot: Robot, unit: Units) -> Figure:
    """Heights of a path (samples, 3) along x, and of uneven ground below it."""
    panel.plot(points[:, X], points[:, Z], **_PATH)
    if not robot.ground.flat:
        heights = ground_heights(points[:, :2] * unit.length, robot.ground) / unit.length
        panel.plot(points[:, X], heights, **_GROUND)
    panel.set(xlabel=f"x ({unit.length_name})", ylabel=f"height ({unit.length_name})")
    panel.margins(x=0.02, y=0.1)
    panel.set_title("Height of the centre along its path", loc="left")
    return figure_of(panel)


@common_style()
def one_step(
    result: SimulationResult,
    *,
    axes: Axes | None = None,
    time: tuple[float, float] | None = None,
    units: str = "in",
    instants: int = 5,
) -> Figure:
    """One step from above and from the side, to scale; bodies off the ground stand out.

    A body is off the ground if its feet are above it by 2 % of the robot's height. Below: the path
    of one bottom node per body, or of the centre. If no signal has two periods in the second half,
    the last quarter is shown."""
    robot, unit = result.robot, units_named(units)
    structure = robot.structure
    ends = time or measures.last_step(result.trajectory)
    title = "One step"
    if ends is None:
        end = float(result.trajectory.time[-1])
        ends, title = (0.75 * end, end), "The last quarter"
    step = shown_part(result.trajectory, ends)
    nodes, (lifted, least) = step.p_WN.values / unit.length, _clear_of_ground(step, robot)
    samples = _nearest(step, np.linspace(*ends, instants))
    profiles = [_profile(step.p_WN.values, sample, robot) / unit.length for sample in samples]
    views = _views(nodes, np.concatenate([nodes.reshape(-1, 3), *profiles]), unit)
    wide, tall = (float(np.ptp(limits)) for limits in views[SIDE])
    names = structure.bodies if structure.is_row else (structure.followed,)
    # The instants of a tall robot are beside each other, of another one below each other.
    rows, columns = (2, instants) if tall > _TALL * wide else (instants, 2)
    width = (_ROOM[0] - _NUMBERS) / columns - _GAP
    heights = [rows * (width * tall / wide + _TITLE) + 0.6, 0.95 * math.ceil(len(names) / _PATHS)]
    host = page(axes, height_in=sum(heights) + 1.4)
    looks = {
        f"over {least / unit.length:.1g} {unit.length_name} off the ground": {"color": _LIFTED},
        "on the ground": {"color": _ON_GROUND},
        f"path of the {structure.followed}": _PATH,
    }
    below = legend_below(host, looks)
    above, paths = split(host, heights=heights, gap_y=18.0, below=below)[:, 0]
    grid = _lapse_panels(above, rows, columns)
    panels = grid if columns == 2 else grid.T
    followed = followed_nodes(nodes, structure)
    for sample, profile, row in zip(samples, profiles, panels, strict=True):
        colours = [_LIFTED if up else _ON_GROUND for up in lifted[sample]]
        row[1].plot(profile[:, X], profile[:, Z], **_GROUND)
        for (view, limits), panel in zip(views.items(), row, strict=True):
            panel.plot(followed[: sample + 1, :, X], followed[: sample + 1, :, view], **_PATH)
            _draw_struts(panel, nodes[sample][:, [X, view]], structure, colours)
            panel.set(xlim=limits[0], ylim=limits[1], aspect="equal")
        name_panel(row[0], f"{float(step.time[sample]) - ends[0]:.2f} s")
    for view, panel in zip(views, panels[0], strict=True):
        _name_view(panel, view, beside=columns == 2)
        _name_bodies(panel, nodes[samples[0]][:, [X, view]], structure, width_in=width)
    for panel in grid[-1]:
        panel.set_xlabel(f"x ({unit.length_name})")
    if not structure.is_row:
        lifted = np.all(lifted, axis=1, keepdims=True)
    _draw_paths(paths, names, followed[:, ::2], lifted, robot, unit)  # of the left nodes
    host.set_title(f"{title}, {ends[0]:.2f} to {ends[1]:.2f} s", loc="left")
    return figure_of(host)


def _name_view(panel: Axes, view: int, *, beside: bool) -> None:
    """Names a view above a panel if the other one is beside it, else to its left."""
    name = "from above" if view == OVERHEAD else "from the side"
    if beside:
        panel.set_title(name, loc="right", fontsize="medium", pad=3.0)
    else:
        panel.set_ylabel(name)


def _views(
    nodes: np.ndarray, with_ground: np.ndarray, unit: Units
) -> dict[int, tuple[tuple[float, float], tuple[float, float]]]:
    """Limits across and up the page of each view, all of one size."""
    above, side = _extents(nodes, OVERHEAD, unit), _extents(with_ground, SIDE, unit)
    tall = max(np.ptp(above[1]), np.ptp(side[1]))
    views = {}
    for view, (_, limits) in ((OVERHEAD, above), (SIDE, side)):
        middle = sum(limits) / 2
        views[view] = above[0], (float(middle - tall / 2), float(middle + tall / 2))
    return views


def _clear_of_ground(trajectory: xarray.Dataset, robot: Robot) -> tuple[np.ndarray, float]:
    """(samples, bodies): whether all feet of a body are well above the ground; and how far (m)."""
    structure = robot.structure
    start, contacts = node_positions(structure, structure.initial_state), structure.contacts
    feet, least = trajectory.p_WN.values[:, contacts], _CLEARANCE * float(np.ptp(start[:, Z]))
    clear = feet[..., Z] - ground_heights(feet[..., :2], robot.ground) > least
    bodies, of_foot = range(len(structure.bodies)), structure.carriers[contacts]
    return np.stack([clear[:, of_foot == body].all(axis=1) for body in bodies], axis=1), least


def _profile(nodes: np.ndarray, sample: int, robot: Robot) -> np.ndarray:
    """Points (points, 3) of the ground along x wherever nodes (samples, nodes, 3) are, at their
    mean y in a sample; in m."""
    x = np.arange(nodes[..., X].min() - _MARGIN, nodes[..., X].max() + _MARGIN, _PROFILE)
    y = np.full_like(x, nodes[sample, ..., Y].mean())
    return np.column_stack([x, y, ground_heights(np.column_stack([x, y]), robot.ground)])


def _draw_paths(
    host: Axes,
    names: Sequence[str],
    paths: np.ndarray,
    lifted: np.ndarray,
    robot: Robot,
    unit: Units,
) -> None:
    """Paths (samples, names, 3), enlarged, and where they are `lifted` (samples, names)."""
    columns = min(len(names), _PATHS)
    rows = math.ceil(len(names) / columns)
    panels = split(host, heights=[1.0] * rows, widths=[1.0] * columns, gap_y=18.0, share_y=True)
    for i, panel in enumerate(panels.ravel()):
        if i >= len(names):
            panel.remove()
            continue
        path = paths[:, i]
        x, z = path[:, X] - path[0, X], path[:, Z]
        if not robot.ground.flat:
            below = ground_heights(path[:, :2] * unit.length, robot.ground) / unit.length
            z, below = z - below[0], below - below[0]
            panel.plot(x, below, **_GROUND)
        panel.plot(x, z, **_PATH)
        panel.plot(x, np.where(lifted[:, i], z, np.nan), color=_LIFTED, linewidth=1.6)
        panel.plot(x[0], z[0], "o", color="black")
        panel.margins(0.08)
        least = _MARGIN / 6 / unit.length  # even if nothing moves
        panel.update_datalim([(-least, z.min()), (least, z.min() + least)])
        panel.xaxis.set_major_locator(
            MaxNLocator(nbins=4 if columns > 2 else 8, steps=[1, 2, 5, 10])
        )
        name_panel(panel, names[i])
    for panel in panels[-1]:
        panel.set_xlabel(f"forward ({unit.length_name})")
    panels[0, 0].set_ylabel(f"height ({unit.length_name})")


def _distance_walked(result: SimulationResult, unit: Units) -> xarray.DataArray:
    """(time,): distance walked since the start of the simulation."""
    trajectory = result.trajectory
    walked = measures.distance_walked(trajectory, result.robot.structure) / unit.length
    return xarray.DataArray(walked, dims="time", coords={"time": trajectory.time})


def _nearest(trajectory: xarray.Dataset, times: np.ndarray) -> np.ndarray:
    """Indices of the samples nearest to times in s."""
    return np.abs(trajectory.time.values - times[:, np.newaxis]).argmin(axis=1)


def _extents(
    points: np.ndarray, view: int, unit: Units
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Range of points (..., 3) across and up the page, with a margin and room for names of bodies
    above."""
    margin = _MARGIN / unit.length
    ranges = []
    for axis in (X, view):
        values = points[..., axis]
        ranges.append((float(values.min()) - margin, float(values.max()) + margin))
    across, (low, high) = ranges
    return across, (low, high + margin)


def _columns(count: int, *, wide: float, high: float, room: tuple[float, float]) -> int:
    """Number of columns in which `count` pictures are drawn largest in a room on paper."""
    scales = []
    for columns in range(1, count + 1):
        width, height = room[0] / columns - _GAP, room[1] / math.ceil(count / columns) - _TITLE
        scales.append(min(width / wide, height / high))
    return 1 + int(np.argmax(scales))


def _lapse_panels(host: Axes, rows: int, columns: int) -> np.ndarray:
    """Panels of a time lapse, whose y axis has the scale of the x axis and no numbers."""
    size: Any = {"heights": [1.0] * rows, "widths": [1.0] * columns}
    gaps: Any = {"gap_x": 72.0 * _GAP, "gap_y": 72.0 * _TITLE}
    panels = split(host, **size, **gaps, above=15.0, below=BELOW)
    for panel in panels.ravel():
        panel.tick_params(axis="y", left=False, labelleft=False)
        panel.grid(visible=False, axis="y")
        panel.spines[:].set_color("0.8")
        nbins = min(7, 15 // columns)
        panel.xaxis.set_major_locator(MaxNLocator(nbins=nbins, steps=[1, 2, 5, 10]))
    return panels


def _draw_struts(
    panel: Axes, points: np.ndarray, structure: Structure, colours: Sequence[str]
) -> None:
    """The struts between points (nodes, 2), in a colour for each body."""
    bodies = structure.carriers[structure.struts[:, 0]]
    lines = LineCollection(
        list(points[structure.struts]), colors=[colours[body] for body in bodies], linewidths=1.2
    )
    panel.add_collection(lines, autolim=False)


def _name_bodies(panel: Axes, nodes: np.ndarray, structure: Structure, *, width_in: float) -> None:
    """Names bodies above the uppermost of their nodes (nodes, 2) in a panel that is `width_in`
    inches wide, but those whose names would overlap with others'."""
    left, right = panel.get_xlim()
    per_paper_inch = (right - left) / width_in
    longest = max(len(name) for name in structure.bodies)
    width, height = longest * _LETTER * per_paper_inch, _NAME_HEIGHT * per_paper_inch
    places: list[tuple[float, float]] = []
    for body, name in enumerate(structure.bodies):
        of_body = nodes[structure.carriers == body]
        x, y = of_body[of_body[:, 1].argmax()].tolist()
        x = min(max(x, left + width / 2), right - width / 2)
        if all(abs(x - a) >= width or abs(y - b) >= height for a, b in places):
            offset: Any = {"xytext": (0, 1), "textcoords": "offset points", "fontsize": 7.5}
            panel.annotate(name, (x, y), ha="center", **offset)
            places.append((x, y))
