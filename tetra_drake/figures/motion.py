"""The thesis's Figures 14, 15, 18 and 21: how the robot moves."""

from __future__ import annotations

import itertools
import math
import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D

from tetra_drake import thesis
from tetra_drake.figures.style import OKABE_ITO, REFERENCE, common_style, line_style, make_figure
from tetra_drake.results.measures import distance_walked, last_step, lifted, relative_distances
from tetra_drake.robot.structure import BOTTOM_LEFT, BOTTOM_RIGHT, STRUTS
from tetra_drake.scenario.units import INCH

if TYPE_CHECKING:
    import xarray

X, Y, Z = range(3)

OVERHEAD, SIDE = (X, Y), (X, Z)
"""The axes that a view shows, across and up the page."""

LAPSE_INSTANTS = 6
STEP_INSTANTS = 5

_PITCH_IN = 7.3
"""From one instant of a time lapse to the next below it, in inches of the robot's world."""

_MARGIN_IN = 0.6
"""Free space around a time lapse, in inches of the robot's world."""

_PANELS_IN_A_ROW = 5

_ON_GROUND: Any = {"color": "0.25", "linewidth": 0.8, "linestyle": "-"}
_LIFTED: Any = {"color": OKABE_ITO["vermillion"], "linewidth": 1.6, "linestyle": "-"}
_PATH: Any = {"color": OKABE_ITO["blue"], "linewidth": 1.1, "linestyle": "-"}
_FOOTPRINTS: Any = {"color": "0.45", "marker": "o", "linestyle": "", "markersize": 2.5}


@common_style()
def figure_14_relative_distances(trajectory: xarray.Dataset) -> Figure:
    """How far the tetrahedra are from T1 in the direction of travel.

    The thesis's Fig. 14: distance in inches over time in s, a line for each tetrahedron,
    here between centres of mass. The grey lines are the distances at the start.
    """
    inches = relative_distances(trajectory) / INCH
    names = inches.tetrahedron.values
    figure, [[panel]] = make_figure(width_in=7.0, height_in=1.5 + 0.7 * len(names))
    for i, name in enumerate(names):
        line, style = inches.sel(tetrahedron=name), line_style(i)
        panel.axhline(float(line[0]), color="0.6", linewidth=0.7)
        panel.plot(line.time, line, label=name, **style)
        place = {"xy": (1.01, float(line[-1])), "xycoords": ("axes fraction", "data")}
        panel.annotate(name, color=style["color"], va="center", **place)
    panel.set_xlabel("time (s)")
    panel.set_ylabel("distance from T1 (in)")
    figure.suptitle("Distances between tetrahedra, with T1 as reference (Fig. 14)")
    return figure


@common_style()
def figure_15_time_lapse(trajectory: xarray.Dataset, *, instants: int = LAPSE_INSTANTS) -> Figure:
    """The walking robot from above at some instants, each below the one before.

    The thesis's Fig. 15: the struts, to scale, over x in inches, each tetrahedron in its own
    colour. Dots trace where T1's bottom nodes were each second.
    """
    times = np.linspace(trajectory.time.values[0], trajectory.time.values[-1], instants)
    samples = _nearest(trajectory, times)
    inches = trajectory.p_WN.values / INCH
    size = _lapse_size(inches[samples], rows=instants, width_in=5.8, height_in=8.5)
    width = max(size[0] + 1.0, 4.8)  # room for the title
    figure, [[panel]] = make_figure(width_in=width, height_in=size[1] + 1.0)
    styles = [{"color": line_style(i)["color"], "linestyle": "-"} for i in range(inches.shape[1])]
    for row, sample in enumerate(samples):
        _draw_robot(panel, inches[sample], view=OVERHEAD, row=row, styles=styles)
        seconds = _nearest(trajectory, np.arange(times[0], times[row]))
        for node in (BOTTOM_LEFT, BOTTOM_RIGHT):
            _draw_path(panel, inches[seconds, 0, node], view=OVERHEAD, row=row, **_FOOTPRINTS)
    walked = distance_walked(trajectory).values[samples] / INCH
    labels = [f"{time:.4g} s\n{way:+.2f} in" for time, way in zip(times, walked, strict=True)]
    _finish_lapse(panel, trajectory, inches[samples], view=OVERHEAD, labels=labels)
    panel.axvline(inches[0, 0, BOTTOM_LEFT, X], color="0.45", linewidth=0.8)
    panel.set_ylabel("time, and distance $x_1$ walked by T1")
    figure.suptitle(
        "Time lapse of locomotion, from above (Fig. 15)\n"
        "dots: where T1's bottom nodes were each second"
    )
    return figure


@common_style()
def figure_18_before_and_after(
    initial: xarray.Dataset, evolved: xarray.Dataset, *, initial_label: str, evolved_label: str
) -> Figure:
    """How far the best gait walks before (left) and after (right) evolution.

    The thesis's Fig. 18: x1 in inches over time in s, on one scale. The broken lines are the
    distances that the thesis reports.
    """
    figure, panels = make_figure(width_in=8.0, height_in=4.0, columns=2, sharey=True)
    for panel, trajectory, label, what, reported in (
        (panels[0, 0], initial, initial_label, "initial", thesis.BEST_INITIAL_DISTANCE_IN),
        (panels[0, 1], evolved, evolved_label, "evolved", thesis.BEST_EVOLVED_DISTANCE_IN),
    ):
        walked = distance_walked(trajectory) / INCH
        panel.plot(walked.time, walked, color=OKABE_ITO["blue"])
        panel.axhline(reported, **REFERENCE)
        panel.annotate(
            f"thesis: {reported:g} in",
            xy=(0.02, reported),
            xycoords=("axes fraction", "data"),
            xytext=(0, 3),
            textcoords="offset points",
        )
        title = f"best {what} gait: {float(walked[-1]):.2f} in\n{textwrap.shorten(label, 60)}"
        panel.set_title(title, parse_math=False)  # a name may hold a dollar sign
        panel.set_xlabel("time (s)")
    panels[0, 0].margins(y=0.08)
    panels[0, 0].set_ylabel("distance $x_1$ (in)")
    figure.suptitle("Distance walked before and after evolution (Fig. 18)")
    return figure


@common_style()
def figure_21_one_step(trajectory: xarray.Dataset, *, instants: int = STEP_INSTANTS) -> Figure:
    """One step late in the walk, from above and from the side, and the nodes' paths.

    The thesis's Fig. 21: the struts, to scale, in inches; tetrahedra off the ground stand out.
    Traced are the bottom nodes; below, their paths enlarged, height over x in
    inches, of one of the two in each tetrahedron. A step is one period of the signals; if
    they do not oscillate, the last quarter of the trajectory is shown.
    """
    ends = last_step(trajectory)
    start, end = ends or (float(trajectory.time.quantile(0.75)), float(trajectory.time[-1]))
    what, why = ("one step", "") if ends else ("the end", "\nno step, as no signal oscillates")
    step = trajectory.sel(time=slice(start, end))
    samples = _nearest(step, np.linspace(start, end, instants))
    inches = step.p_WN.values / INCH
    size = _lapse_size(inches[samples], rows=instants, width_in=3.6, height_in=6.0)
    bodies = inches.shape[1]
    paths_in = 1.5 * math.ceil(bodies / _PANELS_IN_A_ROW)
    width = max(2 * size[0] + 1.2, 5.8)  # room for the legend
    figure = Figure(figsize=(width, size[1] + paths_in + 1.6))
    heights = [size[1] + 0.8, paths_in + 0.4]
    above, below = figure.subfigures(2, 1, squeeze=False, height_ratios=heights)[:, 0]
    _draw_step(above, step, samples)
    _draw_paths(below, step)
    figure.legend(
        handles=[
            Line2D([], [], label="off the ground", **_LIFTED),
            Line2D([], [], label="on the ground", **_ON_GROUND),
            Line2D([], [], label="path of the bottom nodes", **_PATH),
        ],
        loc="outside lower center",
        ncols=3,
    )
    figure.suptitle(f"Time lapse of {what}, {start:.2f} to {end:.2f} s (Fig. 21){why}")
    return figure


def _draw_step(figure: SubFigure, step: xarray.Dataset, samples: np.ndarray) -> None:
    """The time lapse from above and from the side."""
    inches = step.p_WN.values / INCH
    off = lifted(step).values
    seconds = step.time.values[samples] - step.time.values[0]
    panels: Any = figure.subplots(1, 2, squeeze=False)[0]
    for panel, view, nodes in (
        (panels[0], OVERHEAD, (BOTTOM_LEFT, BOTTOM_RIGHT)),
        (panels[1], SIDE, (BOTTOM_LEFT,)),
    ):
        for row, sample in enumerate(samples):
            styles = [_LIFTED if up else _ON_GROUND for up in off[sample]]
            for body, node in itertools.product(range(inches.shape[1]), nodes):
                _draw_path(panel, inches[: sample + 1, body, node], view=view, row=row, **_PATH)
            _draw_robot(panel, inches[sample], view=view, row=row, styles=styles)
        labels = [f"{second:.2f} s" for second in seconds]
        _finish_lapse(panel, step, inches[samples], view=view, labels=labels)
    panels[0].set_title("from above")
    panels[1].set_title("from the side")
    panels[1].tick_params(left=False, labelleft=False)
    for row in range(len(samples)):
        panels[1].axhline(-_PITCH_IN * row, color="0.6", linewidth=0.7)


def _draw_paths(figure: SubFigure, step: xarray.Dataset) -> None:
    """The way of the bottom left node of each tetrahedron in the step, enlarged."""
    names, off = step.tetrahedron.values, lifted(step)
    rows = math.ceil(len(names) / _PANELS_IN_A_ROW)
    columns = math.ceil(len(names) / rows)
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for panel in panels.flat[len(names) :]:
        panel.set_axis_off()
    for panel in panels.flat[len(names) - columns : len(names)]:
        panel.tick_params(labelbottom=True)
    for panel, name in zip(panels.flat, names, strict=False):
        node = step.p_WN.sel(tetrahedron=name).isel(node=BOTTOM_LEFT) / INCH
        x, z = node.sel(axis="x") - node.sel(axis="x")[0], node.sel(axis="z")
        up = off.sel(tetrahedron=name)
        panel.plot(x, z, **_PATH)
        panel.plot(x.where(up), z.where(up), **_LIFTED)
        panel.plot(x[0], z[0], "o", color="black")
        panel.set_title(name)
        panel.margins(0.08)
        panel.update_datalim([(-0.1, 0.0), (0.1, 0.1)])  # even if nothing moves
    figure.supxlabel("way of the bottom left node from where the step starts, the dot (in)")
    figure.supylabel("height (in)")


def _nearest(trajectory: xarray.Dataset, times: np.ndarray) -> np.ndarray:
    """Indices of the samples nearest to times in s."""
    return np.abs(trajectory.time.values - times[:, np.newaxis]).argmin(axis=1)


def _lapse_size(
    inches: np.ndarray, *, rows: int, width_in: float, height_in: float
) -> tuple[float, float]:
    """Width and height on paper of a time lapse (instants, n, 4, 3), to scale, within bounds."""
    wide = float(np.ptp(inches[..., X])) + 2 * _MARGIN_IN
    high = _PITCH_IN * rows
    scale = min(width_in / wide, height_in / high)
    return scale * wide, scale * high


def _draw_robot(
    panel: Axes,
    inches: np.ndarray,
    *,
    view: tuple[int, int],
    row: int,
    styles: Sequence[dict[str, Any]],
) -> None:
    """The struts of the robot with nodes at `inches` (n, 4, 3), a style for each tetrahedron."""
    points = inches[..., view] - [0.0, _PITCH_IN * row]
    for nodes, style in zip(points, styles, strict=True):
        # A gap after each strut makes one line of all six.
        ends = np.pad(nodes[np.array(STRUTS)], ((0, 0), (0, 1), (0, 0)), constant_values=np.nan)
        panel.plot(*ends.reshape(-1, 2).T, **style)


def _draw_path(
    panel: Axes, inches: np.ndarray, *, view: tuple[int, int], row: int, **style: Any
) -> None:
    """The path (samples, 3) of a node."""
    across, up = inches[:, view].T
    panel.plot(across, up - _PITCH_IN * row, **style)


def _finish_lapse(
    panel: Axes,
    trajectory: xarray.Dataset,
    inches: np.ndarray,
    *,
    view: tuple[int, int],
    labels: Sequence[str],
) -> None:
    """Scale, names of the tetrahedra and of the rows; `inches` are the instants' nodes."""
    across, up = inches[..., view[0]], inches[..., view[1]]
    middle = (up.min() + up.max()) / 2
    panel.set_xlim(across.min() - _MARGIN_IN, across.max() + _MARGIN_IN)
    panel.set_ylim(middle - _PITCH_IN * (len(labels) - 0.5), middle + 0.5 * _PITCH_IN + 0.6)
    panel.set_aspect("equal")
    panel.set_yticks(middle - _PITCH_IN * np.arange(len(labels)), labels)
    panel.grid(visible=False, axis="y")
    panel.set_xlabel("x (in)")
    for i, name in enumerate(trajectory.tetrahedron.values):
        highest = up[0, i].argmax()
        place = across[0, i, highest], up[0, i, highest]
        panel.annotate(name, place, (3, 1), textcoords="offset points")
