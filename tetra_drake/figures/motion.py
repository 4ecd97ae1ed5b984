"""Figures of a walking robot: distances, paths, time lapses and one step."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from tetra_drake.figures.style import (
    GIVEN,
    LINE_COLOURS,
    OKABE_ITO,
    Drawn,
    Page,
    figure_function,
    folded,
    legend_below,
    line_style,
    name_panel,
    page_of,
    page_width,
    panels_in_columns,
    shown_part,
    titled,
)
from tetra_drake.formatting import fixed, signed
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot import measures
from tetra_drake.robot.ground import ground_heights
from tetra_drake.robot.measures import Span
from tetra_drake.robot.structure import Structure, followed_nodes, node_positions
from tetra_drake.settings.units import INCH

X, Y, Z = range(3)

_MARGIN = 0.6 * INCH  # m; free space around a robot of usual size
_PROFILE = 0.05 * INCH  # m; distance between points of its ground's profile
_PANEL_NAME, _GAP = 0.27, 0.13  # inches; height of a panel's name, and gap between panels
_PATHS = 6  # largest number of panels of paths side by side
_X_LABEL = "x, forward ({}) →"
_CLEARANCE = 0.02  # a body is off the ground above this share of the robot's height

_CABLES: Any = {"colors": "0.75", "linewidths": 0.5, "zorder": 1.0}
_ON_GROUND, _LIFTED = "0.2", OKABE_ITO["vermillion"]
_PATH: Any = {"color": OKABE_ITO["blue"], "linewidth": 1.1, "linestyle": "-"}
_WAY: Any = _PATH | {"color": "0.6"}  # beside bodies in the colours of lines
_GROUND: Any = {"color": "0.6", "linewidth": 0.8, "linestyle": "-"}
_START: Any = {"color": "black", "marker": "o", "linestyle": "", "markerfacecolor": "white"}
_END: Any = {"color": "black", "marker": "s", "linestyle": ""}
_BEFORE: Any = {"color": "0.5", "linewidth": 1.3, "linestyle": "-"}
_AFTER: Any = {"color": OKABE_ITO["blue"], "linewidth": 1.6, "linestyle": "-"}
_HEADING: Any = {"color": OKABE_ITO["vermillion"], "zorder": 2.5, "width": 0.004, "scale": 18.0}


@figure_function
def relative_distances(result: SimulationResult, *, time: Span | None = None) -> Drawn:
    """Distance along x of each body from the first body, over time. Distances are between centres
    of mass, positive ahead. Grey lines: the distances at the start of the time shown."""
    unit, x = result.scenario.units, shown_part(result.trajectory, time).p_WB.sel(axis="x")
    distances = (x - x.isel(body=0)) / unit.length
    first, *names = distances.body.values
    height = np.clip(1.5 + 0.6 * len(names), 2.4, 6.5)
    page, width = page_of(height_in=height), 0.3 * page_width()
    panel = page.subplots()
    for i, name in enumerate(names):
        line = distances.sel(body=name)
        panel.axhline(float(line[0]), color="0.6", linewidth=0.7)
        panel.plot(line.time, line, label=folded(name, width), **line_style(i))
    y_label = folded(f"distance from {first} ({unit.length_name})", 0.6 * height)
    panel.set(xlabel="time (s)", ylabel=y_label)
    if names:
        page.legend(loc="outside right upper", reverse=True, frameon=False)
    return titled(page, f"Distance of each body from {first}", share=0.6)  # beside the legend


@figure_function
def before_and_after(
    initial: SimulationResult, best: SimulationResult, *, time: Span | None = None
) -> Drawn:
    """Distance over time, before and after evolution: the best gait of the best trial's
    initial population, and the best gait of this trial."""
    unit = best.scenario.units
    page = page_of(height_in=3.8)
    panel = page.subplots()
    legend = {}
    for when, result, look in (("before", initial, _BEFORE), ("after", best, _AFTER)):
        part = shown_part(_with_distance(result), time)
        panel.plot(part.time, part.walked, **look)
        way = f"{fixed(float(part.walked[-1]), unit.decimals + 1)} {unit.length_name}"
        legend[f"{when}: {way}, {result.name}"] = look
    panel.set(xlabel="time (s)", ylabel=f"distance ({unit.length_name})")
    legend_below(page, legend)
    return titled(page, "Distance, before and after evolution")


@figure_function
def time_lapse(result: SimulationResult, *, time: Span | None = None, instants: int = 6) -> Drawn:
    """Time lapse of the robot from above at equally spaced instants, to scale, with the distance
    walked. Forward is to the right. The line is the path of the centre so far, with a dot at each
    full second."""
    structure, unit = result.robot.structure, result.scenario.units
    trajectory = shown_part(_with_distance(result), time)
    first, last = trajectory.time.values[[0, -1]]
    samples = _nearest(trajectory, np.linspace(first, last, instants))
    nodes = trajectory.p_WN.values[..., [X, Y]] / unit.length
    centre = structure.node_shares @ nodes
    shown = np.concatenate([nodes[samples].reshape(-1, 2), centre])
    wide, high = (_range(shown[:, axis], result) for axis in (X, Y))
    columns, height = _fit(instants, wide, high, height_in=6.0)
    page = page_of(height_in=height + 0.9)
    panels = panels_in_columns(page, instants, columns, x_label=_X_LABEL.format(unit.length_name))
    looks = [{"color": LINE_COLOURS[i % len(LINE_COLOURS)]} for i in range(len(structure.bodies))]
    for sample, panel in zip(samples, panels, strict=True):
        now = float(trajectory.time[sample])
        _draw_struts(panel, nodes[sample], structure, [look["color"] for look in looks])
        seconds = _nearest(trajectory, np.arange(math.ceil(first), now + 1e-9))
        panel.plot(*centre[: sample + 1].T, **_WAY)
        panel.plot(*centre[seconds].T, color="0.4", marker="o", linestyle="", markersize=1.8)
        way = signed(float(trajectory.walked[sample]), unit.decimals + 1)
        name_panel(panel, f"{now:.4g} s: {way} {unit.length_name}")
        _to_scale(panel, wide, high)
    legend = {"path of the centre": _WAY}
    if len(looks) <= len(LINE_COLOURS):
        legend = dict(zip(structure.bodies, looks, strict=True)) | legend
    legend_below(page, legend)
    return titled(page, "Time lapse from above: time and distance")


@figure_function
def path_of_the_centre(
    result: SimulationResult, *, time: Span | None = None, instants: int = 9
) -> Drawn:
    """Path of the robot's centre of mass.

    It is drawn from above, to scale, with arrows for the heading at equally spaced instants. If the
    path is straight, its height along x is shown instead."""
    structure, unit = result.robot.structure, result.scenario.units
    trajectory = shown_part(result.trajectory, time)
    path = measures.path_of_centre(trajectory, structure)
    points = path.centre / unit.length
    wide, high, _ = np.ptp(points, axis=0)
    is_straight = high < 0.05 * wide
    ratio = high / max(wide, _margin(result))
    to_scale = min(rcParams["figure.figsize"][0] * ratio, 5.0) + 1.4
    page = page_of(height_in=2.6 if is_straight else to_scale)
    panel = page.subplots()
    panel.set_xlabel(f"x ({unit.length_name})")
    panel.plot(points[:, X], points[:, Z if is_straight else Y], **_PATH)
    if is_straight:
        if not result.robot.ground.flat:
            panel.plot(points[:, X], _heights_below(points, result), **_GROUND)
        panel.set_ylabel(f"height ({unit.length_name})")
        panel.margins(x=0.02, y=0.1)
        return titled(page, "Height of the centre along its path")
    looks = {"start": _START, f"after {path.times[-1]:.4g} s": _END}
    if structure.points_ahead:
        looks["heading"] = {"color": OKABE_ITO["vermillion"], "marker": ">", "linestyle": "-"}
        samples = _nearest(trajectory, np.linspace(path.times[0], path.times[-1], instants))
        heading, arrows = path.heading[samples], points[samples]
        panel.quiver(arrows[:, X], arrows[:, Y], np.cos(heading), np.sin(heading), **_HEADING)
    panel.plot(points[0, X], points[0, Y], **_START)
    panel.plot(points[-1, X], points[-1, Y], **_END)
    panel.margins(0.1)
    panel.set_aspect("equal", adjustable="datalim")
    panel.set_ylabel(f"y ({unit.length_name})")
    legend_below(page, looks)
    return titled(page, "Path of the centre from above")


@figure_function
def one_step(result: SimulationResult, *, time: Span | None = None, instants: int = 6) -> Drawn:
    """Robot to scale from above and from the side, at equally spaced instants of the time in the
    title. Bodies off the ground are red. The lower panels show paths, enlarged.

    The time is the last step. If no signal has two periods in the second half of the simulation, it
    is the last quarter. A body is off the ground if all its feet are higher than 2 % of the robot's
    height. The paths are of one bottom node per body, or of the centre."""
    structure, unit = result.robot.structure, result.scenario.units
    end = float(result.trajectory.time[-1])
    cycle = time or measures.last_step(result.trajectory)
    start, end = cycle or (0.75 * end, end)
    step = shown_part(result.trajectory, (start, end))
    samples = _nearest(step, np.linspace(start, end, instants))
    nodes = step.p_WN.values / unit.length
    lifted, least = _off_ground(step, result)

    # The side view stands below the view from above, in the same panel.
    wide, across = (_range(nodes[..., axis], result) for axis in (X, Y))
    x, y = np.arange(*wide, _PROFILE * structure.scale / unit.length), nodes[..., Y].mean()
    profile = _heights_below(np.column_stack([x, np.full_like(x, y)]), result)
    low, high = _range(np.append(nodes[..., Z], profile), result)
    views = nodes[..., [X, Y]], nodes[..., [X, Z]] + [0.0, across[0] - high]
    tall = across[0] - (high - low), across[1]
    columns, height = _fit(instants, wide, tall, height_in=5.5)
    paths = followed_nodes(nodes, structure)[:, ::2]  # every second node is a left one
    of_paths = 1.1 * math.ceil(paths.shape[1] / _PATHS) + 0.4
    parts = [min(height + 0.4, 5.0 * of_paths), of_paths]
    page = page_of(height_in=sum(parts) + 0.5)
    upper, lower = page.subfigures(2, squeeze=False, height_ratios=parts)[:, 0]

    panels = panels_in_columns(upper, instants, columns, x_label=_X_LABEL.format(unit.length_name))
    for sample, panel in zip(samples, panels, strict=True):
        name_panel(panel, f"{float(step.time[sample]) - start:.2f} s")
        panel.plot(x, profile + across[0] - high, **_GROUND)
        for view in views:
            path = followed_nodes(view[: sample + 1], structure)
            panel.plot(path[..., 0], path[..., 1], **_PATH)
            colours = [_LIFTED if up else _ON_GROUND for up in lifted[sample]]
            _draw_struts(panel, view[sample], structure, colours)
        _to_scale(panel, wide, tall)
    for panel in panels[::columns]:
        panel.set_yticks([sum(across) / 2, tall[0] + (high - low) / 2], ["above", "side"])
    _draw_paths(lower, paths, lifted, result)
    looks = {
        f"over {least:.1g} {unit.length_name} off the ground": {"color": _LIFTED},
        "on the ground": {"color": _ON_GROUND},
        f"path of the {structure.followed}": _PATH,
    }
    legend_below(page, looks)
    title = "One step" if cycle else "The last quarter"
    return titled(page, f"{title}, {start:.2f} to {end:.2f} s")


def _off_ground(trajectory: xarray.Dataset, result: SimulationResult) -> tuple[np.ndarray, float]:
    """Flags (samples, bodies), True if all feet of a body are off the ground; and the height above
    the ground, in the scenario's unit of length, from which a foot counts as off the ground."""
    structure, ground = result.robot.structure, result.robot.ground
    start, contacts = node_positions(structure, structure.initial_state), structure.contacts
    feet, least = trajectory.p_WN.values[:, contacts], _CLEARANCE * float(np.ptp(start[:, Z]))
    clear = feet[..., Z] - ground.radius - ground_heights(feet[..., :2], ground) > least
    bodies, of_foot = range(len(structure.bodies)), structure.carriers[contacts]
    lifted = [clear[:, of_foot == body].all(axis=1) for body in bodies]
    return np.stack(lifted, axis=1), least / result.scenario.units.length


def _draw_paths(
    page: Page, paths: np.ndarray, lifted: np.ndarray, result: SimulationResult
) -> None:
    """Draws, enlarged, the paths in the x-z plane of one node per body, or of the centre of mass,
    in panels on `page`.

    `paths` (samples, paths, 3) are positions in the scenario's unit of length. `lifted` (samples,
    bodies) is True where a body is off the ground. There its path is red; the centre's path is red
    where all bodies are off the ground.
    """
    names, length = result.robot.structure.bodies, result.scenario.units.length_name
    if not result.robot.structure.markers.size:
        names, lifted = (result.robot.structure.followed,), np.all(lifted, axis=1, keepdims=True)
    columns, x_label = min(len(names), _PATHS), f"forward ({length})"
    panels = panels_in_columns(page, len(names), columns, x_label=x_label, sharex=True, sharey=True)
    for i, (name, panel) in enumerate(zip(names, panels, strict=True)):
        path = paths[:, i]
        x, z = path[:, X] - path[0, X], path[:, Z]
        if not result.robot.ground.flat:
            below = _heights_below(path, result)
            z, below = z - below[0], below - below[0]
            panel.plot(x, below, **_GROUND)
        panel.plot(x, z, **_PATH)
        panel.plot(x, np.where(lifted[:, i], z, np.nan), color=_LIFTED, linewidth=1.6)
        panel.plot(x[0], z[0], "o", color="black")
        panel.margins(0.08)
        least = _margin(result) / 6  # a range even for a node that does not move
        panel.update_datalim([(-least, z.min()), (least, z.min() + least)])
        name_panel(panel, name)
    panels[0].set_ylabel(f"height ({length})")


def _with_distance(result: SimulationResult) -> xarray.Dataset:
    """The trajectory with one more variable: `walked` (time,), the distance since the start of the
    simulation, in the scenario's unit of length."""
    walked = measures.distance_walked(result.trajectory, result.robot.structure)
    return result.trajectory.assign(walked=("time", walked / result.scenario.units.length))


def _heights_below(points: np.ndarray, result: SimulationResult) -> np.ndarray:
    """Heights z (...) of the ground below points (..., 2 or 3), given by x and y first. Points and
    heights are in the scenario's unit of length."""
    length = result.scenario.units.length
    return ground_heights(points[..., :2] * length, result.robot.ground) / length


def _nearest(trajectory: xarray.Dataset, times: np.ndarray) -> np.ndarray:
    """Indices (times,) of the samples of a trajectory that are nearest to the given times (s)."""
    return np.abs(trajectory.time.values - times[:, np.newaxis]).argmin(axis=1)


def _margin(result: SimulationResult) -> float:
    """Width of the free space that figures leave around the robot, in the scenario's unit of
    length."""
    return _MARGIN * result.robot.structure.scale / result.scenario.units.length


def _range(values: np.ndarray, result: SimulationResult) -> Span:
    """Range (least, greatest) of coordinates, with the margin of figures on both sides. `values`
    and range are in the scenario's unit of length."""
    margin = _margin(result)
    return float(values.min()) - margin, float(values.max()) + margin


def _fit(count: int, wide: Span, high: Span, *, height_in: float) -> tuple[int, float]:
    """Number of columns for which `count` equal pictures are largest, and the height (in) of all
    rows together.

    `wide` and `high` are the ranges (least, greatest) of x and y that each picture shows, to scale.
    The pictures fill the caller's figure, or a page of the height `height_in` (in).
    """
    page, columns = GIVEN.get(), np.arange(1, count + 1)
    width, rows = page_width(), np.ceil(count / columns)
    height = height_in if page is None else page.bbox.height / page.dpi
    ratio = (high[1] - high[0]) / (wide[1] - wide[0])
    best = np.minimum(width / columns, height / rows / ratio).argmax()
    row = (width / columns[best] - _GAP) * ratio + _PANEL_NAME
    return int(columns[best]), float(row * rows[best])


def _to_scale(panel: Axes, wide: Span, high: Span) -> None:
    """Sets the ranges (least, greatest) of the x axis (`wide`) and the y axis (`high`), with the
    same scale and without numbers on the y axis."""
    panel.set(xlim=wide, ylim=high, aspect="equal", yticks=[])
    panel.tick_params(axis="y", length=0.0)
    panel.grid(visible=False, axis="y")
    panel.spines[:].set_color("0.8")


def _draw_struts(
    panel: Axes, points: np.ndarray, structure: Structure, colours: Sequence[str]
) -> None:
    """Draws the struts of a robot whose nodes are at `points` (nodes, 2), in units of the panel's
    axes, and its cables as thin lines. `colours` has a colour per body."""
    cables = LineCollection(list(points[structure.segments.ends]), **_CABLES)
    panel.add_collection(cables, autolim=False)
    of_struts = [colours[body] for body in structure.carriers[structure.struts[:, 0]]]
    lines = LineCollection(list(points[structure.struts]), colors=of_struts, linewidths=1.5)
    panel.add_collection(lines, autolim=False)
