"""Figures of a walking robot: distances, time lapses and one step."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from tetra_drake.figures.style import (
    OKABE_ITO,
    add_grid,
    common_style,
    legend_below,
    line_style,
    make_figure,
)
from tetra_drake.formatting import fixed, signed
from tetra_drake.physics.contact import Ground
from tetra_drake.results import measures
from tetra_drake.robot.ground import ground_heights
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import Structure, followed_nodes
from tetra_drake.scenario.units import INCH

X, Y, Z = range(3)

OVERHEAD, SIDE = Y, Z  # World axis that a view shows up the page; across it is X

# Inches of the robot's world.
_PITCH_IN = 7.3  # least distance between the rows of a time lapse
_MARGIN_IN = 0.6  # free space around a time lapse
_PROFILE_IN = 0.05  # distance between points of the ground's profile

# Inches on paper.
_CHARACTER_WIDTH, _NAME_HEIGHT = 0.11, 0.2  # room for the name of a body
_SHORTEST_NAME = 3  # characters for which there is room, at least
_PATH_WIDTH, _PATH_HEIGHT = 6.0, 5.0  # largest size of the path of the centre

_PATHS = 12  # largest number of panels of paths side by side
_ARROW = 0.08  # length of an arrow over that of the path

_ON_GROUND: Any = {"color": "0.25", "linewidth": 0.8, "linestyle": "-"}
_LIFTED: Any = {"color": OKABE_ITO["vermillion"], "linewidth": 1.6, "linestyle": "-"}
_PATH: Any = {"color": OKABE_ITO["blue"], "linewidth": 1.1, "linestyle": "-"}
_GROUND: Any = {"color": "0.6", "linewidth": 0.7, "linestyle": "-"}
_START: Any = {"color": "black", "marker": "o", "linestyle": "", "markerfacecolor": "white"}
_END: Any = {"color": "black", "marker": "s", "linestyle": ""}
_HEADING: Any = {
    "color": OKABE_ITO["vermillion"],
    "zorder": 2.5,
    "units": "inches",
    "width": 0.02,
    "angles": "xy",
    "scale_units": "xy",
    "scale": 1.0,
}
_FOOTPRINTS: Any = {"color": "0.45", "marker": "o", "linestyle": "", "markersize": 2.5}


@common_style()
def relative_distances(trajectory: xarray.Dataset) -> Figure:
    """Distances along x from the first body to each, between centres of mass, over time.

    Grey lines: the distances at the start."""
    inches = measures.relative_distances(trajectory) / INCH
    names = inches.body.values
    figure, [[panel]] = make_figure(width_in=7.0, height_in=1.5 + min(0.7 * len(names), 7.0))
    for i, name in enumerate(names):
        line, style = inches.sel(body=name), line_style(i)
        panel.axhline(float(line[0]), color="0.6", linewidth=0.7)
        panel.plot(line.time, line, label=name, **style)
        place = {"xy": (1.01, float(line[-1])), "xycoords": ("axes fraction", "data")}
        panel.annotate(name, color=style["color"], va="center", **place)
    panel.set(xlabel="time (s)", ylabel=f"distance from {names[0]} (in)")
    figure.suptitle("Distances between bodies")
    return figure


@common_style()
def before_and_after(walks: Sequence[tuple[str, xarray.Dataset]], structure: Structure) -> Figure:
    """Distance walked over time by a run's best gait and the best initial one of its trial."""
    # `walks`: label and trajectory of the initial gait and of the best one.
    figure, [panels] = make_figure(width_in=8.0, height_in=4.0, columns=2, sharey=True)
    kinds = ("best initial gait of the trial", "best evolved gait")
    for panel, kind, (label, trajectory) in zip(panels, kinds, walks, strict=True):
        walked = measures.distance_walked(trajectory, structure) / INCH
        panel.plot(trajectory.time, walked, color=OKABE_ITO["blue"])
        title = f"{kind}: {fixed(float(walked[-1]))} in\n{textwrap.shorten(label, 60)}"
        panel.set_title(title, parse_math=False)  # a name may hold a dollar sign
        panel.set_xlabel("time (s)")
    panels[0].margins(y=0.08)
    panels[0].set_ylabel("distance (in)")
    figure.suptitle("Distance walked before and after evolution")
    return figure


@common_style()
def time_lapse(trajectory: xarray.Dataset, structure: Structure, *, instants: int = 6) -> Figure:
    """The robot from above at some instants, to scale, with the distance walked.

    Dots: the first body's bottom nodes, or the robot's centre, at each full second."""
    times = np.linspace(trajectory.time.values[0], trajectory.time.values[-1], instants)
    samples = _nearest(trajectory, times)
    inches = trajectory.p_WN.values / INCH
    footprints = followed_nodes(inches, structure)[:, :2]  # of one body
    walked = measures.distance_walked(trajectory, structure) / INCH
    styles = [{**line_style(i), "linestyle": "-"} for i in range(len(structure.bodies))]
    lapse = _Lapse(
        structure,
        labels=[f"{t:.4g} s\n{signed(w)} in" for t, w in zip(times, walked[samples], strict=True)],
        nodes=inches[samples],
        styles=[styles] * instants,
        paths=[footprints[_nearest(trajectory, np.arange(times[0], time))] for time in times],
        path_style=_FOOTPRINTS,
        profiles=np.zeros((instants, 0, 3)),
    )
    width, height = lapse.size(width_in=5.8, height_in=8.5)
    # Wide enough for the title.
    figure, [[panel]] = make_figure(width_in=max(width + 1.0, 4.8), height_in=height + 1.0)
    lapse.draw(panel, OVERHEAD, width_in=width)
    panel.axvline(footprints[0, 0, X], color="0.45", linewidth=0.8)
    of_body = f" of {structure.bodies[0]}" if structure.is_row else ""
    panel.set_ylabel("time, and distance walked")
    figure.suptitle(f"Time lapse from above\ndots: {structure.followed}{of_body} each full second")
    return figure


@common_style()
def path_of_the_centre(
    trajectory: xarray.Dataset, structure: Structure, *, instants: int = 9
) -> Figure:
    """The path of the robot's centre from above, to scale.

    Arrows: where a row heads, at evenly spaced instants."""
    path = measures.path_of_centre(trajectory, structure)
    points = path.centre[:, :2] / INCH
    arrow = _ARROW * max(*np.ptp(points, axis=0), _MARGIN_IN)
    samples = _nearest(trajectory, np.linspace(path.times[0], path.times[-1], instants))
    tails, heading = points[samples], path.heading[samples]
    heads = tails + arrow * np.column_stack([np.cos(heading), np.sin(heading)])
    drawn = np.concatenate([points, heads]) if structure.is_row else points
    left, bottom = drawn.min(axis=0) - arrow
    right, top = drawn.max(axis=0) + arrow
    scale = min(_PATH_WIDTH / (right - left), _PATH_HEIGHT / (top - bottom))
    width, height = scale * (right - left), scale * (top - bottom)
    figure, [[panel]] = make_figure(width_in=max(width, 3.0) + 0.8, height_in=height + 1.5)
    panel.plot(points[:, X], points[:, Y], **_PATH)
    title = "Path of the centre from above"
    if structure.is_row:
        title += "\narrows: heading"
        ways = heads - tails
        panel.quiver(tails[:, X], tails[:, Y], ways[:, X], ways[:, Y], **_HEADING)
    panel.plot(points[0, X], points[0, Y], **_START)
    panel.plot(points[-1, X], points[-1, Y], **_END)
    panel.set(xlim=(left, right), ylim=(bottom, top), aspect="equal")
    panel.set(xlabel="x (in)", ylabel="y (in)")
    end = f"end, after {path.times[-1]:.4g} s"
    legend_below(figure, {"start": _START, end: _END})
    figure.suptitle(title)
    return figure


@common_style()
def one_step(trajectory: xarray.Dataset, robot: Robot, *, instants: int = 5) -> Figure:
    """One step from above and from the side, to scale; lifted bodies stand out.

    Below, the path of one bottom node per body, or of the centre, enlarged. Grey: the ground, where
    it is not flat along the middle of the robot, and below the node. If no signal has two periods
    in the second half of the trajectory, its last quarter is shown."""
    structure, ground = robot.structure, robot.ground
    ends = measures.last_step(trajectory)
    start, end = ends or (float(trajectory.time.quantile(0.75)), float(trajectory.time[-1]))
    title = f"Time lapse of one step, {start:.2f} to {end:.2f} s"
    if ends is None:
        title = f"Time lapse of the end, {start:.2f} to {end:.2f} s\n"
        title += "no step, as no signal has two periods in the second half"
    step = trajectory.sel(time=slice(start, end))
    inches, lifted = step.p_WN.values / INCH, measures.lifted(step).values
    times = np.linspace(step.time.values[0], end, instants)
    followed, samples = followed_nodes(inches, structure), _nearest(step, times)
    lapse = _Lapse(
        structure,
        labels=[f"{time - times[0]:.2f} s" for time in step.time.values[samples]],
        nodes=inches[samples],
        styles=[[_LIFTED if up else _ON_GROUND for up in bodies] for bodies in lifted[samples]],
        paths=[followed[: sample + 1] for sample in samples],
        path_style=_PATH,
        profiles=np.array([_profile(inches, sample, ground) for sample in samples]),
    )
    width, height = lapse.size(width_in=3.6, height_in=6.0)
    names = structure.bodies if structure.is_row else (structure.followed,)
    heights = [height + 0.8, 0.7 + 1.2 * math.ceil(len(names) / _PATHS)]
    legend = 0.4
    figure = Figure(figsize=(max(2 * width + 1.2, 5.8), sum(heights) + legend))
    above, below = figure.subfigures(2, 1, squeeze=False, height_ratios=heights)[:, 0]
    panels: Any = above.subplots(1, 2)
    for panel, view, place in zip(panels, (OVERHEAD, SIDE), ("above", "the side"), strict=True):
        lapse.draw(panel, view, width_in=width)
        panel.set_title(f"from {place}")
    panel.tick_params(left=False, labelleft=False)
    if not structure.is_row:
        lifted = np.all(lifted, axis=1, keepdims=True)
    _draw_paths(below, names, followed[:, ::2], lifted, ground)  # of the left nodes
    lines = {"off the ground": _LIFTED, "on the ground": _ON_GROUND}
    legend_below(figure, {**lines, f"path of the {structure.followed}": _PATH})
    figure.suptitle(title)
    return figure


def _profile(nodes: np.ndarray, sample: int, ground: Ground) -> np.ndarray:
    """Points (points, 3) of the ground along x, in inches, wherever nodes (samples, nodes, 3) are,
    at their mean y in a sample."""
    x = np.arange(nodes[..., X].min() - _MARGIN_IN, nodes[..., X].max() + _MARGIN_IN, _PROFILE_IN)
    y = np.full_like(x, nodes[sample, ..., Y].mean())
    z = ground_heights(np.column_stack([x, y]) * INCH, ground) / INCH
    return np.column_stack([x, y, z])


def _draw_paths(
    figure: SubFigure, names: Sequence[str], paths: np.ndarray, lifted: np.ndarray, ground: Ground
) -> None:
    """Paths (samples, names, 3) in inches, enlarged, and where they are `lifted` (samples, names)
    off the ground."""
    panels = add_grid(figure, names, columns=min(len(names), _PATHS)).values()
    for i, panel in enumerate(panels):
        path = paths[:, i]
        x, z = path[:, X] - path[0, X], path[:, Z]
        if not ground.flat:
            below = ground_heights(path[:, :2] * INCH, ground) / INCH
            z, below = z - below[0], below - below[0]
            panel.plot(x, below, **_GROUND)
        panel.plot(x, z, **_PATH)
        panel.plot(x, np.where(lifted[:, i], z, np.nan), **_LIFTED)
        panel.plot(x[0], z[0], "o", color="black")
        panel.margins(0.08)
        panel.update_datalim([(-0.1, 0.0), (0.1, 0.1)])  # even if nothing moves
    figure.supxlabel("displacement since the start of the time shown (in)")
    figure.supylabel("height (in)" if ground.flat else "height above the\nground at 0 (in)")


def _nearest(trajectory: xarray.Dataset, times: np.ndarray) -> np.ndarray:
    """Indices of the samples nearest to times in s."""
    return np.abs(trajectory.time.values - times[:, np.newaxis]).argmin(axis=1)


@dataclass(frozen=True)
class _Lapse:
    """A time lapse: the robot at some instants, one below the other; positions in inches."""

    structure: Structure
    labels: Sequence[str]
    nodes: np.ndarray
    """(instants, nodes, 3)."""
    styles: Sequence[Sequence[Any]]
    """Line style of each body at each instant."""
    paths: Sequence[np.ndarray]
    """Earlier positions (samples, nodes, 3) of some nodes at each instant."""
    path_style: Any
    profiles: np.ndarray
    """Points (instants, points, 3) of the ground, for views from the side."""

    @property
    def heights(self) -> np.ndarray:
        """All heights of nodes and ground."""
        return np.concatenate([self.nodes[..., Z].ravel(), self.profiles[..., Z].ravel()])

    @property
    def pitch(self) -> float:
        """Distance between instants, with room for what climbs or turns."""
        sideways, upward = np.ptp(self.nodes[..., Y]), np.ptp(self.heights)
        return max(_PITCH_IN, float(upward) + _MARGIN_IN, float(sideways) + _MARGIN_IN)

    def size(self, *, width_in: float, height_in: float) -> tuple[float, float]:
        """Width and height on paper, to scale, within bounds."""
        wide = float(np.ptp(self.nodes[..., X])) + 2 * _MARGIN_IN
        high = self.pitch * len(self.nodes)
        scale = min(width_in / wide, height_in / high)
        return scale * wide, scale * high + _NAME_HEIGHT

    def draw(self, panel: Axes, view: int, *, width_in: float) -> None:
        """Draws the time lapse, `width_in` inches wide on paper."""
        structure, nodes, downs = (
            self.structure,
            self.nodes,
            self.pitch * np.arange(len(self.nodes)),
        )
        body_of_strut = structure.carriers[structure.struts[:, 0]]
        for i, down in enumerate(downs):
            if view == SIDE:
                panel.plot(self.profiles[i, :, X], self.profiles[i, :, Z] - down, **_GROUND)
            panel.plot(self.paths[i][..., X], self.paths[i][..., view] - down, **self.path_style)
            for body, style in enumerate(self.styles[i]):
                ends = nodes[i, structure.struts[body_of_strut == body]]
                panel.plot(ends[..., X].T, ends[..., view].T - down, **style)
        heights = self.heights if view == SIDE else nodes[..., Y]
        middle = (heights.min() + heights.max()) / 2
        left, right = nodes[..., X].min() - _MARGIN_IN, nodes[..., X].max() + _MARGIN_IN
        per_paper_inch = (right - left) / width_in
        top = middle + self.pitch / 2 + _NAME_HEIGHT * per_paper_inch
        bottom = middle - downs[-1] - self.pitch / 2
        panel.set(xlabel="x (in)", xlim=(left, right), ylim=(bottom, top), aspect="equal")
        panel.set_yticks(middle - downs, self.labels)
        panel.grid(visible=False, axis="y")
        _name_bodies(panel, nodes[0][:, [X, view]], structure, per_paper_inch)


def _name_bodies(
    panel: Axes, nodes: np.ndarray, structure: Structure, per_paper_inch: float
) -> None:
    """Names bodies above the uppermost of their nodes (nodes, 2), but those whose names would
    overlap with others'."""
    longest = max(_SHORTEST_NAME, *(len(name) for name in structure.bodies))
    width, height = longest * _CHARACTER_WIDTH * per_paper_inch, _NAME_HEIGHT * per_paper_inch
    left, right = panel.get_xlim()
    places: list[tuple[float, float]] = []
    for body, name in enumerate(structure.bodies):
        of_body = nodes[structure.carriers == body]
        x, y = of_body[of_body[:, 1].argmax()].tolist()
        x = min(max(x, left + width / 2), right - width / 2)
        if all(abs(x - a) >= width or abs(y - b) >= height for a, b in places):
            panel.annotate(name, (x, y), (0, 2), textcoords="offset points", ha="center")
            places.append((x, y))
