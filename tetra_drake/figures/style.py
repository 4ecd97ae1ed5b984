"""Common style of figures; saving of figures.

A figure function has the decorator `@figure_function`, which adds the keywords of Look, `units` and
`figure`. It draws on page_of(): the caller's figure, or a new one with matplotlib's constrained
layout.
save_figure() writes a figure to files. Figures need neither a display nor pyplot.
"""

from __future__ import annotations

import contextlib
import functools
import inspect
import io
import math
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from types import NoneType
from typing import Any, TypeAlias

import matplotlib.style
import numpy as np
import xarray
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.rcsetup import cycler
from matplotlib.ticker import MaxNLocator

from tetra_drake.errors import InputError, check_type
from tetra_drake.files import whole_file
from tetra_drake.robot.measures import Span
from tetra_drake.settings.units import shown_in

Page: TypeAlias = Figure | SubFigure
"""A matplotlib figure or a part of one."""

Drawn: TypeAlias = Figure | Any
"""A new figure. None if the caller gave the figure: a notebook would show a returned one twice."""

GIVEN: ContextVar[Page | None] = ContextVar("figure", default=None)
"""The figure of the caller on which a figure function draws; None for a new one."""

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


@dataclass(frozen=True)
class Look:
    """Look of figures on paper: width in inches, size of letters in points, and whether figures
    have a title."""

    width_in: float = 7.0
    font_size: float = 9.0
    title: bool = True

    def __post_init__(self) -> None:
        """Raises InputError if a figure is wider than 40 in, or its letters are too large for its
        width."""
        most = _MOST_PER_INCH * self.width_in
        if not 0.0 < self.font_size <= most <= _MOST_PER_INCH * _WIDEST:
            expected = f"a width up to {_WIDEST:g} in, and per inch letters up to {_MOST_PER_INCH}"
            found = f"found {self.font_size:g} points in {self.width_in:g} in"
            raise InputError("figure", "font_size", f"{found}, expected {expected} points")


_WIDEST, _MOST_PER_INCH = 40.0, 4.5
"""Greatest width of figures in inches, and greatest size of letters in points per inch of width."""

USUAL = Look()

FILE_KINDS = ("svg", "png")
"""File types of a figure, by default."""


@dataclass(frozen=True)
class Print:
    """Settings for the files of figures: their look, and their file types `kinds` ("svg", "png",
    "pdf")."""

    look: Look = USUAL
    kinds: Sequence[str] = FILE_KINDS


AS_USUAL = Print()


_LETTERS_PER_SIZE = 1.6  # letters of mean width in the width of one size
_FEWEST_LETTERS = 12  # texts are not folded into shorter lines
_HANDLE = 5.0  # width of a line in a legend, with its margins, in sizes of letters

SHADE = "0.9"
"""Grey behind marked intervals of time."""

REFERENCE: Any = {"color": "0.35", "linestyle": (0, (4, 3)), "linewidth": 1.0}
"""Line style of reference values."""


def shown_part(trajectory: xarray.Dataset, time: Span | None) -> xarray.Dataset:
    """The part of a trajectory from the first to the second value (s) of `time`; all of it for
    None. Raises InputError if the part has fewer than two samples."""
    if time is None:
        return trajectory
    part = trajectory.sel(time=slice(*time))
    if part.sizes["time"] < 2:
        end = float(trajectory.time[-1])
        problem = f"found {time[0]:g} to {time[1]:g} s, expected a range within 0 to {end:g} s"
        raise InputError("figure", "time", problem)
    return part


def line_style(index: int) -> dict[str, Any]:
    """Colour and dashes of the line with this index in a panel, as keywords of Axes.plot()."""
    dashes = DASHES[index % len(DASHES)]
    return {"color": LINE_COLOURS[index % len(LINE_COLOURS)], "linestyle": dashes}


@contextlib.contextmanager
def common_style(look: Look = USUAL) -> Iterator[None]:
    """Context manager: figures that are made in the block have the common style, with the width and
    letters of `look`. It ignores the user's matplotlibrc."""
    sheet = Path(__file__).with_name("tetra_drake.mplstyle")
    cycle = cycler(color=LINE_COLOURS * len(DASHES), linestyle=DASHES * len(LINE_COLOURS))
    with matplotlib.style.context(["default", sheet, {"axes.prop_cycle": cycle}]):
        scale = look.font_size / Look.font_size
        settings: Any = rcParams
        settings.update({size: scale * settings[size] for size in _SIZES})
        rcParams["figure.figsize"] = look.width_in, 1.0
        yield


_SIZES = (
    "font.size",
    *("axes.titlesize", "axes.labelsize", "figure.titlesize", "figure.labelsize"),
    *("legend.fontsize", "xtick.labelsize", "ytick.labelsize"),
)
"""Names of matplotlib's sizes of letters."""


def figure_function(draw: Callable[..., Drawn]) -> Callable[..., Drawn]:
    """Decorator of a function that draws a figure and returns it.

    The figure gets the common style. The function also takes the keywords of Look (width, letters,
    title), and `units`: a name in units.SYSTEMS in place of the scenario's units. With the keyword
    `figure`, a Figure or SubFigure of the caller, the function draws on it and returns None.
    """

    @functools.wraps(draw)
    def make(*args: Any, figure: Page | None = None, units: str | None = None, **own: Any) -> Drawn:
        check_type(draw.__name__, "figure", figure, Figure, SubFigure, NoneType)
        look = Look(**{name: own.pop(name) for name in vars(Look()) if name in own})
        token = GIVEN.set(figure)
        try:
            with shown_in(units), common_style(look):
                rcParams["text.parse_math"] = False  # a name may hold a dollar sign
                page = draw(*args, **own)
        finally:
            GIVEN.reset(token)
        if not look.title:
            page.suptitle("").set_in_layout(False)
        return page if figure is None else None

    keyword = inspect.Parameter.KEYWORD_ONLY
    of_look = inspect.signature(Look).parameters.values()
    added = [inspect.Parameter(name, keyword, default=None) for name in ("figure", "units")]
    added += [parameter.replace(kind=keyword) for parameter in of_look]
    before = inspect.signature(draw)
    shown: Any = make
    shown.__signature__ = before.replace(parameters=[*before.parameters.values(), *added])
    return make


class ShownFigure(Figure):
    """A figure that a notebook shows, even without pyplot."""

    def _repr_png_(self) -> bytes:
        file = io.BytesIO()
        self.savefig(file, format="png", dpi=100)
        return file.getvalue()


def page_of(*, height_in: float) -> Page:
    """The figure to draw on, for a function with the decorator figure_function(): the caller's,
    from the keyword `figure`, or a new one. A new one is `height_in` inches high with letters of
    the usual size, and higher with larger ones. The figure gets the constrained
    layout, unless the caller has set another layout."""
    figure = GIVEN.get()
    if figure is None:
        height = height_in * rcParams["font.size"] / Look.font_size
        return ShownFigure(figsize=(page_width(), height), layout="constrained")
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


def page_width(page: Page | None = None) -> float:
    """Width (in) of a page, by default of the page on which page_of() draws."""
    page = page or GIVEN.get()
    return rcParams["figure.figsize"][0] if page is None else page.bbox.width / page.dpi


def folded(text: str, width_in: float, *, size: float | None = None) -> str:
    """Breaks a text into lines of at most about `width_in` inches, for letters of a `size`
    (points), by default the legend's."""
    letters = int(_LETTERS_PER_SIZE * 72.0 * width_in / (size or rcParams["legend.fontsize"]))
    return textwrap.fill(text, max(letters, _FEWEST_LETTERS))


def most_lines(texts: Iterable[str]) -> int:
    """Number of lines of the text with the most lines; at least 1."""
    return max((text.count("\n") + 1 for text in texts), default=1)


def own_words(names: Sequence[str]) -> list[str]:
    """Names without the words that occur in all of them: "T1-T2 left" for "T1-T2 outer bottom_left"
    if "outer" and "bottom" are in each name. The first word of the first name is always kept."""
    split = [name.replace("_", " ").split() for name in names]
    common = set(split[0][1:]).intersection(*split) if len(names) > 1 else set()
    return [" ".join(word for word in words if word not in common) for words in split]


def panels_in_columns(
    page: Page, count: int, columns: int, *, x_label: str, **shared: Any
) -> list[Axes]:
    """Makes `count` panels on a page, in so many columns, with one common label of the x axes.
    Returns them row by row. `shared` is passed to Figure.subplots(), such as sharex=True."""
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


def titled(page: Page, title: str, *, share: float = 1.0) -> Page:
    """Writes a title at the upper left of a figure and returns the figure. The title is folded into
    lines of at most `share` of the figure's width."""
    text = folded(title, share * page_width(page), size=rcParams["figure.titlesize"])
    page.suptitle(text, x=0.01, ha="left")
    return page


def name_panel(panel: Axes, name: str) -> None:
    """Writes the name of a panel above it, smaller than the figure's title."""
    panel.set_title(name, loc="left", fontsize=rcParams["axes.labelsize"], pad=3.0)


def write_beside(panel: Axes, height: float, text: str) -> None:
    """Writes a text to the right of a panel, at the value `height` of its y axis."""
    size, transform = rcParams["ytick.labelsize"], panel.get_yaxis_transform()
    panel.text(1.01, height, text, transform=transform, va="center", fontsize=size)


def legend_below(page: Page, lines: Mapping[str, Any], *others: Any) -> None:
    """Adds a legend below all panels of a page: `lines` are line styles, as keywords of Line2D, by
    label; `others` are artists with labels. It has as many columns as fit on the page, and is read
    row by row."""
    width = page_width(page) - _HANDLE * rcParams["legend.fontsize"] / 72.0
    texts = {folded(text, width): style for text, style in lines.items()}
    handles = [*(Line2D([], [], label=text, **style) for text, style in texts.items()), *others]
    for columns in range(len(handles), 0, -1):
        # Matplotlib fills column by column.
        by_column = [handle for column in range(columns) for handle in handles[column::columns]]
        below: Any = {"handles": by_column, "loc": "outside lower center", "frameon": False}
        legend = page.legend(ncols=columns, **below)
        if columns == 1 or legend.get_window_extent().width <= page.bbox.width:
            return
        legend.remove()


@common_style()
def save_figure(
    figure: Figure, folder: str | Path, name: str, *, kinds: Sequence[str] = FILE_KINDS
) -> None:
    """Writes a figure to a folder, by default as NAME.svg and NAME.png.

    `kinds` may have "svg", "png" and "pdf". A file is replaced at once, never left half written.
    Equal data give equal bytes. Raises InputError if a file cannot be written.
    """
    dates: dict[str, Any] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
    for kind in kinds:
        with whole_file(Path(folder) / f"{name}.{kind}") as file:
            figure.savefig(file, format=kind, metadata=dates.get(kind))
