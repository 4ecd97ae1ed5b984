"""The common look of figures, and how they are written.

A figure function is decorated with `@common_style()`. It draws on page(), which are the caller's
axes or those of a new figure; split() divides them into panels. It returns the figure, which
save_figure() writes. Neither a display nor pyplot is needed.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib.style
import numpy as np
import pandas
import xarray
from matplotlib import rcParams
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.rcsetup import cycler
from matplotlib.transforms import Bbox

from tetra_drake.errors import InputError
from tetra_drake.files import whole_file, write_whole
from tetra_drake.formatting import listed
from tetra_drake.scenario.units import INCH, POUND_FORCE

OKABE_ITO = {
    "black": "#000000",
    "blue": "#0072b2",
    "vermillion": "#d55e00",
    "green": "#009e73",
    "purple": "#cc79a7",
    "sky_blue": "#56b4e9",
    "orange": "#e69f00",
    "yellow": "#f0e442",
}
"""Okabe and Ito's colours for colour-blind people. Yellow is too faint on white for lines."""

LINE_COLOURS = tuple(colour for name, colour in OKABE_ITO.items() if name != "yellow")
"""Colours of series in order; neighbours differ in lightness, too."""

DASHES = ("-", (0, (5, 1.5)), (0, (1.2, 1.2)), (0, (6, 1.5, 1.2, 1.5)))
"""Line styles that tell series apart in a grey print; with the colours, 28 series differ."""

WIDTH_IN = 7.0
"""Width of figures on paper, in inches."""

SHADE = "0.9"
"""Grey behind marked intervals of time."""

BELOW = 30.0
"""Points that numbers and label of an x axis take."""

_LETTER, _LINE_LETTERS = 0.062, 6  # inches per letter of a legend; of a line and its space

REFERENCE: Any = {"color": "0.35", "linestyle": (0, (4, 3)), "linewidth": 1.0}
"""Line style of values to compare with."""


@dataclass(frozen=True)
class Units:
    """Units in which figures show lengths and forces."""

    length: float
    """Size in m."""
    length_name: str
    digits: int
    """Decimals of a length that matter."""
    force: float
    """Size in N."""
    force_name: str


_UNITS = {"in": Units(INCH, "in", 2, POUND_FORCE, "lbf"), "SI": Units(1.0, "m", 3, 1.0, "N")}


def units_named(name: str) -> Units:
    """The units "in" (and lbf) or "SI"; raises InputError for another name."""
    if name not in _UNITS:
        raise InputError(
            "figure", "units", f"found '{name}', expected one of {listed(list(_UNITS))}"
        )
    return _UNITS[name]


def shown_part(trajectory: xarray.Dataset, time: tuple[float, float] | None) -> xarray.Dataset:
    """The part of a trajectory from a start to an end (s), or all of it; raises InputError if it
    holds no two samples."""
    if time is None:
        return trajectory
    part = trajectory.sel(time=slice(*time))
    if part.sizes["time"] < 2:
        end = float(trajectory.time[-1])
        problem = f"found {time[0]:g} to {time[1]:g} s, expected a range within 0 to {end:g} s"
        raise InputError("figure", "time", problem)
    return part


def line_style(index: int) -> dict[str, Any]:
    """Colour and dashes of a series by its index."""
    dashes = DASHES[index % len(DASHES)]
    return {"color": LINE_COLOURS[index % len(LINE_COLOURS)], "linestyle": dashes}


@contextlib.contextmanager
def common_style() -> Iterator[None]:
    """The common look for what is drawn inside, whatever the user's matplotlibrc says."""
    sheet = Path(__file__).with_name("tetra_drake.mplstyle")
    cycle = cycler(color=LINE_COLOURS * len(DASHES), linestyle=DASHES * len(LINE_COLOURS))
    with matplotlib.style.context(["default", sheet, {"axes.prop_cycle": cycle}]):
        yield


def page(axes: Axes | None, *, height_in: float) -> Axes:
    """The axes to draw on: the caller's, or those of a new figure, `height_in` inches high."""
    if axes is not None:
        return axes
    made = Figure(figsize=(WIDTH_IN, height_in)).add_subplot()
    _keep_style(made)
    return made


def figure_of(axes: Axes) -> Figure:
    """The whole figure to which axes belong."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    return figure


def _keep_style(axes: Axes) -> None:
    """Gives ticks, which are made when the figure is drawn, the style of now."""
    grid_color, grid_linewidth = rcParams["grid.color"], rcParams["grid.linewidth"]
    axes.tick_params(grid_color=grid_color, grid_linewidth=grid_linewidth)
    axes.tick_params(axis="x", labelsize=rcParams["xtick.labelsize"])
    axes.tick_params(axis="y", labelsize=rcParams["ytick.labelsize"])


@dataclass(frozen=True)
class _Place:
    """Place of a panel in its host: edges as shares of the host's size, and points beside these.
    Matplotlib asks for it whenever it draws, so gaps keep their size on paper."""

    host: Axes
    shares: np.ndarray
    """(2, 2): left and bottom, right and top."""
    points: np.ndarray
    """(2, 2)."""

    def __call__(self, axes: object, renderer: object) -> Bbox:
        """The place within the figure."""
        figure, whole = self.host.get_figure(root=False), self.host.bbox
        assert figure is not None
        edges = whole.p0 + self.shares * whole.size + self.points * figure.dpi / 72.0
        return Bbox(edges).transformed(figure.transSubfigure.inverted())


def _edges(
    sizes: Sequence[float], *, gap: float, before: float = 0.0, after: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Shares and points (panels, 2) of the edges of panels of relative sizes in one direction."""
    ends = np.cumsum([0.0, *sizes]) / sum(sizes)
    shares = np.column_stack([ends[:-1], ends[1:]])
    places, room = np.arange(len(sizes)), gap * (len(sizes) - 1) + before + after
    return shares, before + gap * places[:, np.newaxis] - room * shares


def split(
    host: Axes,
    *,
    heights: Sequence[float] = (1.0,),
    widths: Sequence[float] = (1.0,),
    gap_x: float = 12.0,
    gap_y: float = 12.0,
    above: float = 0.0,
    below: float = 0.0,
    share_x: bool = True,
    share_y: bool = False,
) -> np.ndarray:
    """Panels (rows, columns) in place of axes, whose title stays, with relative heights and widths.

    `gap_x` and `gap_y` are points between panels; `above` and `below` are points of the axes' place
    that stay free. All panels share an x axis, or a y axis, if they shall.
    """
    host.set_axis_off()
    x_shares, x_points = _edges(widths, gap=gap_x)
    y_shares, y_points = _edges(heights[::-1], gap=gap_y, before=below, after=above)
    rows, columns = len(heights), len(widths)
    panels = np.empty((rows, columns), dtype=object)
    first = None
    for row, column in np.ndindex(rows, columns):
        up = rows - 1 - row
        shares = np.column_stack([x_shares[column], y_shares[up]])
        points = np.column_stack([x_points[column], y_points[up]])
        panel = host.inset_axes(
            (0.0, 0.0, 1.0, 1.0),
            sharex=first if share_x else None,
            sharey=first if share_y else None,
        )
        panel.set_axes_locator(_Place(host, shares, points))
        _keep_style(panel)
        first = first or panel
        if share_x and row < rows - 1:
            panel.tick_params(labelbottom=False)
        if share_y and column > 0:
            panel.tick_params(labelleft=False)
        panels[row, column] = panel
    return panels


def make_figure(
    *, width_in: float, height_in: float, rows: int = 1, columns: int = 1, **layout: Any
) -> tuple[Figure, np.ndarray]:
    """A figure and its axes (rows, columns); sizes in inches on paper, `layout` for subplots."""
    figure = Figure(figsize=(width_in, height_in))
    return figure, figure.subplots(rows, columns, squeeze=False, **layout)


def own_words(names: Sequence[str]) -> list[str]:
    """Names without the words that all of them have but the first, such as "T1-T2 left" of "T1-T2
    outer bottom_left"."""
    words = [name.replace("_", " ").split() for name in names]
    common = set(words[0][1:]).intersection(*words) if len(names) > 1 else set()
    return [" ".join(word for word in of if word not in common) for of in words]


def name_panel(panel: Axes, name: str) -> None:
    """Writes the name of a panel above it, smaller than the title of the figure."""
    panel.set_title(name, loc="left", fontsize=rcParams["axes.labelsize"], pad=3.0)


def write_beside(panel: Axes, height: float, text: str, *, color: str = "black") -> None:
    """Writes a text to the right of a panel at a height of its data."""
    size, transform = rcParams["ytick.labelsize"], panel.get_yaxis_transform()
    panel.text(1.01, height, text, transform=transform, va="center", fontsize=size, color=color)


def legend_below(host: Axes, lines: Mapping[str, Any], *others: Artist) -> float:
    """Adds a legend of line styles, by label, and other artists at the lower edge of axes that are
    split; returns the points that it and the label of an x axis take."""
    handles = [*(Line2D([], [], label=text, **style) for text, style in lines.items()), *others]
    lengths = [_LETTER * (len(str(handle.get_label())) + _LINE_LETTERS) for handle in handles]
    columns, width = len(handles), inches(host)[0]
    if sum(lengths) > width:
        columns = max(1, int(width / max(lengths)))
    place: Any = {"loc": "lower center", "bbox_to_anchor": (0.5, 0.0), "borderaxespad": 0.0}
    legend = host.legend(handles=handles, ncols=columns, frameon=False, **place)
    for text in legend.get_texts():
        text.set_parse_math(False)  # a name may hold a dollar sign
    return BELOW + 15.0 * math.ceil(len(handles) / columns)


def inches(axes: Axes) -> tuple[float, float]:
    """Width and height of axes on paper, in inches, before the figure is laid out."""
    dpi = figure_of(axes).dpi
    return axes.bbox.width / dpi, axes.bbox.height / dpi


def spread(values: np.ndarray, least: float) -> np.ndarray:
    """Values moved as little upward as keeps them at least so far apart, in their order."""
    moved = values.astype(float)
    order = np.argsort(moved)
    for lower, upper in itertools.pairwise(order):
        moved[upper] = max(moved[upper], moved[lower] + least)
    return moved - (moved - values).sum() / max(values.size, 1)


def save_findings(
    figure: Figure,
    folder: Path,
    name: str,
    *,
    tables: Mapping[str, pandas.DataFrame],
    summary: Mapping[str, Any],
) -> list[str]:
    """Writes tables by their names as CSV, summary.json and the figure to the folder; returns the
    names of the files. Raises InputError if one cannot be written."""
    for table, rows in tables.items():
        write_whole(folder / f"{table}.csv", rows.to_csv(index=False))
    text = json.dumps(summary, indent=1, allow_nan=False, ensure_ascii=False)
    write_whole(folder / "summary.json", text + "\n")
    save_figure(figure, folder, name)
    return [*(f"{table}.csv" for table in tables), "summary.json", f"{name}.svg", f"{name}.png"]


@common_style()
def save_figure(
    figure: Figure, folder: str | Path, name: str, *, kinds: Sequence[str] = ("svg", "png")
) -> None:
    """Writes NAME.svg and NAME.png, or the given kinds of "svg", "png" and "pdf", to the folder,
    each whole or not at all.

    Equal data give equal bytes. Raises InputError if a file cannot be written.
    """
    dates: dict[str, Any] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
    for kind in kinds:
        with whole_file(Path(folder) / f"{name}.{kind}") as file:
            figure.savefig(file, format=kind, metadata=dates.get(kind))
