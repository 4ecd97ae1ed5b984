"""Common style of figures; saving of figures.

A figure function has the decorator `@figure_function`. It draws on page_of(): the caller's figure,
or a new one with matplotlib's constrained layout. save_figure() writes a figure to files. Figures
need neither a display nor pyplot.
"""

from __future__ import annotations

import contextlib
import functools
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ParamSpec, TypeAlias

import matplotlib.style
import numpy as np
import pandas
import xarray
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.rcsetup import cycler
from matplotlib.ticker import MaxNLocator

from tetra_drake.errors import InputError
from tetra_drake.files import whole_file, write_whole
from tetra_drake.formatting import listed
from tetra_drake.scenario.units import INCH, POUND_FORCE

Page: TypeAlias = Figure | SubFigure
"""A matplotlib figure or a part of one."""

Drawn: TypeAlias = Figure | Any
"""A new figure. None if the caller gave the figure: a notebook would show a returned one twice."""

_P = ParamSpec("_P")

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
"""Colours of Okabe and Ito, for colour-blind people. Yellow lines are hard to see on white."""

LINE_COLOURS = tuple(colour for name, colour in OKABE_ITO.items() if name != "yellow")
"""Colours of series, in order. Neighbours also differ in lightness."""

DASHES = ("-", (0, (5, 1.5)), (0, (1.2, 1.2)), (0, (6, 1.5, 1.2, 1.5)))
"""Line styles of series, for prints without colours. Colours and styles distinguish 28 series."""

WIDTH_IN = 7.0
"""Width of figures on paper, in inches."""

SHADE = "0.9"
"""Grey behind marked intervals of time."""

REFERENCE: Any = {"color": "0.35", "linestyle": (0, (4, 3)), "linewidth": 1.0}
"""Line style of reference values."""


@dataclass(frozen=True)
class Units:
    """Units of lengths and forces in figures."""

    length: float
    """Size in m."""
    length_name: str
    digits: int
    """Number of decimals of a length."""
    force: float
    """Size in N."""
    force_name: str


_UNITS = {"in": Units(INCH, "in", 2, POUND_FORCE, "lbf"), "SI": Units(1.0, "m", 3, 1.0, "N")}


def units_named(name: str) -> Units:
    """The units "in" (inches and lbf) or "SI". Raises InputError for another name."""
    if name not in _UNITS:
        raise InputError(
            "figure", "units", f"found '{name}', expected one of {listed(list(_UNITS))}"
        )
    return _UNITS[name]


def shown_part(trajectory: xarray.Dataset, time: tuple[float, float] | None) -> xarray.Dataset:
    """The part of a trajectory between two times (s); all of it without times. Raises InputError if
    the part has fewer than two samples."""
    if time is None:
        return trajectory
    part = trajectory.sel(time=slice(*time))
    if part.sizes["time"] < 2:
        end = float(trajectory.time[-1])
        problem = f"found {time[0]:g} to {time[1]:g} s, expected a range within 0 to {end:g} s"
        raise InputError("figure", "time", problem)
    return part


def line_style(index: int) -> dict[str, Any]:
    """Colour and dashes of the series with this index."""
    dashes = DASHES[index % len(DASHES)]
    return {"color": LINE_COLOURS[index % len(LINE_COLOURS)], "linestyle": dashes}


@contextlib.contextmanager
def common_style() -> Iterator[None]:
    """Context manager for the common style of figures. It ignores the user's matplotlibrc."""
    sheet = Path(__file__).with_name("tetra_drake.mplstyle")
    cycle = cycler(color=LINE_COLOURS * len(DASHES), linestyle=DASHES * len(LINE_COLOURS))
    with matplotlib.style.context(["default", sheet, {"axes.prop_cycle": cycle}]):
        yield


def figure_function(draw: Callable[_P, Drawn]) -> Callable[_P, Drawn]:
    """Decorator of a function that draws a figure and returns it.

    The figure gets the common style. With the keyword `figure`, the function draws on it and
    returns None.
    """

    @functools.wraps(draw)
    def drawn(*args: _P.args, **kwargs: _P.kwargs) -> Drawn:
        with common_style():
            page = draw(*args, **kwargs)
        return page if kwargs.get("figure") is None else None

    return drawn


def page_of(figure: Page | None, *, height_in: float) -> Page:
    """The figure to draw on: the caller's, or a new one, `height_in` inches high. It gets the
    constrained layout, unless the caller has set another layout."""
    if figure is None:
        return Figure(figsize=(WIDTH_IN, height_in), layout="constrained")
    if figure.get_layout_engine() is None:
        figure.figure.set_layout_engine("constrained")
    return figure


def make_figure(
    *, width_in: float, height_in: float, rows: int = 1, columns: int = 1, **layout: Any
) -> tuple[Figure, np.ndarray]:
    """A new figure and its axes (rows, columns). Sizes are in inches. `layout` is passed to
    Figure.subplots()."""
    figure = Figure(figsize=(width_in, height_in))
    return figure, figure.subplots(rows, columns, squeeze=False, **layout)


def own_words(names: Sequence[str]) -> list[str]:
    """Names without the words that occur in all of them, such as "T1-T2 left" for "T1-T2 outer
    bottom_left". The first word of the first name is always kept."""
    split = [name.replace("_", " ").split() for name in names]
    common = set(split[0][1:]).intersection(*split) if len(names) > 1 else set()
    return [" ".join(word for word in words if word not in common) for words in split]


def panels_in_columns(
    page: Page, count: int, columns: int, *, x_label: str, **shared: Any
) -> list[Axes]:
    """Panels in columns with one common label of x. `shared` is passed to Figure.subplots()."""
    inner = page.subfigures(squeeze=False)[0, 0]  # puts the label above a legend of the page
    inner.supxlabel(x_label)
    grid = inner.subplots(math.ceil(count / columns), columns, squeeze=False, **shared).ravel()
    for unused in grid[count:]:
        unused.remove()
    for index, panel in enumerate(grid[:count]):
        panel.tick_params(labelbottom=index >= count - columns)
        # A number of ticks that depends on the height could keep the layout from converging.
        panel.yaxis.set_major_locator(MaxNLocator(nbins=3, steps=[1, 2, 5, 10]))
    return list(grid[:count])


def set_title(page: Page, title: str) -> None:
    """Writes the title of a figure at the upper left."""
    page.suptitle(title, x=0.01, ha="left")


def name_panel(panel: Axes, name: str) -> None:
    """Writes the name of a panel above it, smaller than the figure's title."""
    panel.set_title(name, loc="left", fontsize=rcParams["axes.labelsize"], pad=3.0)


def write_beside(panel: Axes, height: float, text: str) -> None:
    """Writes a text to the right of a panel. `height` is a value of the y axis."""
    size, transform = rcParams["ytick.labelsize"], panel.get_yaxis_transform()
    panel.text(1.01, height, text, transform=transform, va="center", fontsize=size)


def legend_below(page: Page, lines: Mapping[str, Any], *others: Any) -> None:
    """Adds a legend below all panels: line styles by label, and other artists. It has as many
    columns as fit on the page."""
    handles = [*(Line2D([], [], label=text, **style) for text, style in lines.items()), *others]
    below: Any = {"handles": handles, "loc": "outside lower center", "frameon": False}
    columns, legend = len(handles), page.legend(ncols=len(handles), **below)
    while columns > 1 and legend.get_window_extent().width > page.bbox.width:
        legend.remove()
        columns -= 1
        legend = page.legend(ncols=columns, **below)


def save_findings(
    figure: Figure,
    folder: Path,
    name: str,
    *,
    tables: Mapping[str, pandas.DataFrame],
    summary: Mapping[str, Any],
) -> list[str]:
    """Writes the results of an analysis to a folder: tables as CSV, summary.json, and the figure.

    Returns the names of the files. Raises InputError if a file cannot be written.
    """
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
    """Writes a figure to a folder, by default as NAME.svg and NAME.png.

    `kinds` may have "svg", "png" and "pdf". A file is replaced at once, never left half written.
    Equal data give equal bytes. Raises InputError if a file cannot be written.
    """
    dates: dict[str, Any] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
    for kind in kinds:
        with whole_file(Path(folder) / f"{name}.{kind}") as file:
            figure.savefig(file, format=kind, metadata=dates.get(kind))
