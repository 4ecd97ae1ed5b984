"""The common look of figures, and how they are written.

A figure function is decorated with `@figure_function`. It draws on page_of(), which is the caller's
figure or a new one, with matplotlib's constrained layout. save_figure() writes a figure. Neither a
display nor pyplot is needed.
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
"""What figures are drawn on."""

Drawn: TypeAlias = Figure | Any
"""A new figure; or None if the caller gave one, which a notebook would otherwise show twice."""

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
"""Okabe and Ito's colours for colour-blind people. Yellow is too faint on white for lines."""

LINE_COLOURS = tuple(colour for name, colour in OKABE_ITO.items() if name != "yellow")
"""Colours of series in order; neighbours differ in lightness, too."""

DASHES = ("-", (0, (5, 1.5)), (0, (1.2, 1.2)), (0, (6, 1.5, 1.2, 1.5)))
"""Line styles that tell series apart in a grey print; with the colours, 28 series differ."""

WIDTH_IN = 7.0
"""Width of figures on paper, in inches."""

SHADE = "0.9"
"""Grey behind marked intervals of time."""

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


def figure_function(draw: Callable[_P, Drawn]) -> Callable[_P, Drawn]:
    """Gives a function that returns its page the common look. Nothing is returned if the caller
    gave the page by the keyword `figure`."""

    @functools.wraps(draw)
    def drawn(*args: _P.args, **kwargs: _P.kwargs) -> Drawn:
        with common_style():
            page = draw(*args, **kwargs)
        return page if kwargs.get("figure") is None else None

    return drawn


def page_of(figure: Page | None, *, height_in: float) -> Page:
    """The caller's figure to draw on, or a new one, `height_in` inches high. Its layout is
    constrained, unless the caller has chosen another."""
    if figure is None:
        return Figure(figsize=(WIDTH_IN, height_in), layout="constrained")
    if figure.get_layout_engine() is None:
        figure.figure.set_layout_engine("constrained")
    return figure


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


def panels_in_columns(
    page: Page, count: int, columns: int, *, x_label: str, **shared: Any
) -> list[Axes]:
    """Panels in columns with one label of x; `shared` for subplots."""
    inner = page.subfigures(squeeze=False)[0, 0]  # so that the label is above a legend below
    inner.supxlabel(x_label)
    grid = inner.subplots(math.ceil(count / columns), columns, squeeze=False, **shared).ravel()
    for unused in grid[count:]:
        unused.remove()
    for place, panel in enumerate(grid[:count]):
        panel.tick_params(labelbottom=place >= count - columns)
        # If the number of ticks depended on the height, the layout might not settle.
        panel.yaxis.set_major_locator(MaxNLocator(nbins=3, steps=[1, 2, 5, 10]))
    return list(grid[:count])


def set_title(page: Page, title: str) -> None:
    """Writes the title of a figure at the upper left."""
    page.suptitle(title, x=0.01, ha="left")


def name_panel(panel: Axes, name: str) -> None:
    """Writes the name of a panel above it, smaller than the title of the figure."""
    panel.set_title(name, loc="left", fontsize=rcParams["axes.labelsize"], pad=3.0)


def write_beside(panel: Axes, height: float, text: str) -> None:
    """Writes a text to the right of a panel at a height of its data."""
    size, transform = rcParams["ytick.labelsize"], panel.get_yaxis_transform()
    panel.text(1.01, height, text, transform=transform, va="center", fontsize=size)


def legend_below(page: Page, lines: Mapping[str, Any], *others: Any) -> None:
    """Adds a legend of line styles, by label, and of other artists below all panels, in as many
    columns as the page has room for."""
    handles = [*(Line2D([], [], label=text, **style) for text, style in lines.items()), *others]
    place: Any = {"handles": handles, "loc": "outside lower center", "frameon": False}
    columns, legend = len(handles), page.legend(ncols=len(handles), **place)
    while columns > 1 and legend.get_window_extent().width > page.bbox.width:
        legend.remove()
        columns -= 1
        legend = page.legend(ncols=columns, **place)


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
