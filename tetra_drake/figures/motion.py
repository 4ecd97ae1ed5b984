"""Figures of a walking robot: distances, time lapses and one step."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D

from tetra_drake.figures.style import (
    OKABE_ITO,
    common_style,
    draw_reference,
    line_style,
    make_figure,
)
from tetra_drake.formatting import fixed, signed
from tetra_drake.results import measures
from tetra_drake.robot.structure import BOTTOM_LEFT, STRUTS, TOP
from tetra_drake.scenario.units import INCH

if TYPE_CHECKING:
    import xarray

    from tetra_drake.scenario.schema import ReferenceScenario

X, Y, Z = range(3)

OVERHEAD, SIDE = (X, Y), (X, Z)
"""World axes shown by a view, across and up the page."""

_PITCH_IN = 7.3
"""Distance between the rows of a time lapse, in inches of the robot's world."""

_MARGIN_IN = 0.6
"""Free space around a time lapse, in inches of the robot's world."""

_ON_GROUND: Any = {"color": "0.25", "linewidth": 0.8, "linestyle": "-"}
_LIFTED: Any = {"color": OKABE_ITO["vermillion"], "linewidth": 1.6, "linestyle": "-"}
_PATH: Any = {"color": OKABE_ITO["blue"], "linewidth": 1.1, "linestyle": "-"}
_FOOTPRINTS: Any = {"color": "0.45", "marker": "o", "linestyle": "", "markersize": 2.5}


@common_style()
def relative_distances(trajectory: xarray.Dataset) -> Figure:
    """Distances along x from T1 to each tetrahedron, between centres of mass, over time.

    Grey lines: the distances at the start."""
    inches = measures.relative_distances(trajectory) / INCH
    names = inches.tetrahedron.values
    figure, [[panel]] = make_figure(width_in=7.0, height_in=1.5 + 0.7 * len(names))
    for i, name in enumerate(names):
        line, style = inches.sel(tetrahedron=name), line_style(i)
        panel.axhline(float(line[0]), color="0.6", linewidth=0.7)
        panel.plot(line.time, line, label=name, **style)
        place = {"xy": (1.01, float(line[-1])), "xycoords": ("axes fraction", "data")}
        panel.annotate(name, color=style["color"], va="center", **place)
    panel.set(xlabel="time (s)", ylabel="distance from T1 (in)")
    figure.suptitle("Distances between tetrahedra")
    return figure


@common_style()
def time_lapse(trajectory: xarray.Dataset, *, instants: int = 6) -> Figure:
    """The robot from above at some instants, to scale, with the distance walked by T1.

    Dots: T1's bottom nodes at each full second."""
    times = np.linspace(trajectory.time.values[0], trajectory.time.values[-1], instants)
    samples = _nearest(trajectory, times)
    inches = trajectory.p_WN.values / INCH
    size = _lapse_size(inches[samples], width_in=5.8, height_in=8.5)
    width = max(size[0] + 1.0, 4.8)  # room for the title
    figure, [[panel]] = make_figure(width_in=width, height_in=size[1] + 1.0)
    lapse = _Lapse(panel, OVERHEAD)
    styles = [{"color": line_style(i)["color"], "linestyle": "-"} for i in range(inches.shape[1])]
    for row, sample in enumerate(samples):
        lapse.draw_robot(row, inches[sample], styles)
        seconds = _nearest(trajectory, np.arange(times[0], times[row]))
        lapse.draw_paths(row, inches[seconds][:, 0, :TOP], _FOOTPRINTS)
    walked = measures.distance_walked(trajectory).values[samples] / INCH
    labels = [f"{time:.4g} s\n{signed(way)} in" for time, way in zip(times, walked, strict=True)]
    lapse.finish(trajectory.tetrahedron.values, inches[samples], labels)
    panel.axvline(inches[0, 0, BOTTOM_LEFT, X], color="0.45", linewidth=0.8)
    panel.set_ylabel("time, and distance $x_1$ walked by T1")
    figure.suptitle("Time lapse from above\ndots: T1's bottom nodes at each full second")
    return figure


@common_style()
def before_and_after(
    initial: xarray.Dataset,
    best: xarray.Dataset,
    labels: tuple[str, str],
    reference: ReferenceScenario | None = None,
) -> Figure:
    """Distance walked over time by the best gait before and after evolution."""
    figure, panels = make_figure(width_in=8.0, height_in=4.0, columns=2, sharey=True)
    kinds = (("initial", "best_initial_distance"), ("evolved", "best_distance"))
    for i, trajectory in enumerate((initial, best)):
        walked, (kind, reported) = measures.distance_walked(trajectory) / INCH, kinds[i]
        panel: Axes = panels[0, i]
        panel.plot(walked.time, walked, color=OKABE_ITO["blue"])
        draw_reference(panel, reference, reported)
        label = textwrap.shorten(labels[i], 60)
        title = f"best {kind} gait: {fixed(float(walked[-1]))} in\n{label}"
        panel.set_title(title, parse_math=False)  # a name may hold a dollar sign
        panel.set_xlabel("time (s)")
    panels[0, 0].margins(y=0.08)
    panels[0, 0].set_ylabel("distance $x_1$ (in)")
    figure.suptitle("Distance walked before and after evolution")
    return figure


@common_style()
def one_step(trajectory: xarray.Dataset, *, instants: int = 5) -> Figure:
    """One step from above and from the side, to scale; lifted tetrahedra stand out.

    Below, the path of one bottom node per tetrahedron, enlarged. If no signal oscillates, the
    last quarter of the trajectory is shown."""
    ends = measures.last_step(trajectory)
    start, end = ends or (float(trajectory.time.quantile(0.75)), float(trajectory.time[-1]))
    what, why = ("one step", "") if ends else ("the end", "\nno step, as no signal oscillates")
    step = trajectory.sel(time=slice(start, end))
    samples = _nearest(step, np.linspace(start, end, instants))
    inches = step.p_WN.values / INCH
    size = _lapse_size(inches[samples], width_in=3.6, height_in=6.0)
    width = max(2 * size[0] + 1.2, 5.8)  # room for the legend
    figure = Figure(figsize=(width, size[1] + 3.1))
    heights = [size[1] + 0.8, 1.9]
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
    figure.suptitle(f"Time lapse of {what}, {start:.2f} to {end:.2f} s{why}")
    return figure


def _draw_step(figure: SubFigure, step: xarray.Dataset, samples: np.ndarray) -> None:
    """The time lapse from above and from the side."""
    inches = step.p_WN.values / INCH
    off = measures.lifted(step).values
    labels = [f"{time - step.time.values[0]:.2f} s" for time in step.time.values[samples]]
    panels: Any = figure.subplots(1, 2, squeeze=False)[0]
    for panel, view, title in zip(panels, (OVERHEAD, SIDE), ("above", "the side"), strict=True):
        lapse = _Lapse(panel, view)
        for row, sample in enumerate(samples):
            lapse.draw_paths(row, inches[: sample + 1, :, :TOP], _PATH)
            styles = [_LIFTED if up else _ON_GROUND for up in off[sample]]
            lapse.draw_robot(row, inches[sample], styles)
        lapse.finish(step.tetrahedron.values, inches[samples], labels)
        panel.set_title(f"from {title}")
    panels[1].tick_params(left=False, labelleft=False)
    for row in range(len(samples)):
        panels[1].axhline(-_PITCH_IN * row, color="0.6", linewidth=0.7)


def _draw_paths(figure: SubFigure, step: xarray.Dataset) -> None:
    """The path of the bottom left node of each tetrahedron in the step, enlarged."""
    names, off = step.tetrahedron.values, measures.lifted(step)
    panels = figure.subplots(1, len(names), sharex=True, sharey=True, squeeze=False)[0]
    for panel, name in zip(panels, names, strict=True):
        node = step.p_WN.sel(tetrahedron=name).isel(node=BOTTOM_LEFT) / INCH
        x, z = node.sel(axis="x") - node.sel(axis="x")[0], node.sel(axis="z")
        up = off.sel(tetrahedron=name)
        panel.plot(x, z, **_PATH)
        panel.plot(x.where(up), z.where(up), **_LIFTED)
        panel.plot(x[0], z[0], "o", color="black")
        panel.set_title(name)
        panel.margins(0.08)
        panel.update_datalim([(-0.1, 0.0), (0.1, 0.1)])  # even if nothing moves
    figure.supxlabel("displacement of the bottom left node since the start of the step (in)")
    figure.supylabel("height (in)")


def _nearest(trajectory: xarray.Dataset, times: np.ndarray) -> np.ndarray:
    """Indices of the samples nearest to times in s."""
    return np.abs(trajectory.time.values - times[:, np.newaxis]).argmin(axis=1)


def _lapse_size(inches: np.ndarray, *, width_in: float, height_in: float) -> tuple[float, float]:
    """Width and height on paper of a time lapse (instants, n, 4, 3), to scale, within bounds."""
    wide, high = float(np.ptp(inches[..., X])) + 2 * _MARGIN_IN, _PITCH_IN * len(inches)
    scale = min(width_in / wide, height_in / high)
    return scale * wide, scale * high


@dataclass(frozen=True)
class _Lapse:
    """A panel with one robot per instant, one below the other."""

    panel: Axes
    view: tuple[int, int]
    """World axes shown, across and up the page."""

    def draw_robot(self, row: int, inches: np.ndarray, styles: Iterable[Any]) -> None:
        """Struts of the robot with nodes at `inches` (n, 4, 3), one line per tetrahedron."""
        points = inches[..., self.view] - [0.0, _PITCH_IN * row]
        for nodes, style in zip(points, styles, strict=True):
            # NaN after each strut makes one line of all six.
            ends = np.pad(nodes[np.array(STRUTS)], ((0, 0), (0, 1), (0, 0)), constant_values=np.nan)
            self.panel.plot(*ends.reshape(-1, 2).T, **style)

    def draw_paths(self, row: int, inches: np.ndarray, style: Any) -> None:
        """Paths (samples, ..., 3) of nodes, one line each."""
        nodes = math.prod(inches.shape[1:-1])
        across, up = inches[..., self.view].reshape(-1, nodes, 2).transpose(2, 0, 1)
        self.panel.plot(across, up - _PITCH_IN * row, **style)

    def finish(self, names: Sequence[str], inches: np.ndarray, labels: Sequence[str]) -> None:
        """Sets scale and labels; `inches` (instants, n, 4, 3) are the nodes shown."""
        across, up = np.moveaxis(inches[..., self.view], -1, 0)
        middle = (up.min() + up.max()) / 2
        bottom = middle - _PITCH_IN * (len(labels) - 0.5)
        self.panel.set(
            xlabel="x (in)",
            xlim=(across.min() - _MARGIN_IN, across.max() + _MARGIN_IN),
            ylim=(bottom, middle + 0.5 * _PITCH_IN + 0.6),
            aspect="equal",
        )
        self.panel.set_yticks(middle - _PITCH_IN * np.arange(len(labels)), labels)
        self.panel.grid(visible=False, axis="y")
        for i, name in enumerate(names):
            highest = up[0, i].argmax()
            place = across[0, i, highest], up[0, i, highest]
            self.panel.annotate(name, place, (3, 1), textcoords="offset points")
