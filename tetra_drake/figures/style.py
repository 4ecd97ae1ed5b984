"""The common look of figures, and how they are written.

A figure function is decorated with `@common_style()`, starts with make_figure() and returns the
figure; save_figure() writes it. Neither a display nor pyplot is needed.
"""

from __future__ import annotations

import contextlib
import json
import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib.style
import numpy as np
import pandas
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.rcsetup import cycler

from tetra_drake.files import whole_file, write_whole

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

SHADE = "0.9"
"""Grey behind marked intervals of time."""

REFERENCE: Any = {"color": "0.35", "linestyle": (0, (4, 3)), "linewidth": 1.0}
"""Line style of values to compare with."""


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


def make_figure(
    *, width_in: float, height_in: float, rows: int = 1, columns: int = 1, **layout: Any
) -> tuple[Figure, np.ndarray]:
    """A figure and its axes (rows, columns); sizes in inches on paper, `layout` for subplots."""
    figure = Figure(figsize=(width_in, height_in))
    return figure, figure.subplots(rows, columns, squeeze=False, **layout)


def add_grid(figure: Figure | SubFigure, names: Sequence[str], *, columns: int) -> dict[str, Axes]:
    """Adds one titled panel per name, row by row, all of one scale."""
    rows = math.ceil(len(names) / columns)
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for unused in panels[len(names) :]:
        unused.remove()
    for lowest in panels[: len(names)][-columns:]:
        lowest.tick_params(labelbottom=True)
    for name, panel in zip(names, panels, strict=False):
        panel.set_title(textwrap.fill(name.replace("_", " "), 110 // columns), loc="left")
    return dict(zip(names, panels, strict=False))


def legend_below(figure: Figure, lines: Mapping[str, Any], *others: Artist) -> None:
    """Adds a legend of line styles, by label, and other artists below the axes."""
    handles = [*(Line2D([], [], label=text, **style) for text, style in lines.items()), *others]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))


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
    """Writes NAME.svg and NAME.png to the folder, each whole or not at all.

    Equal data give equal bytes. Raises InputError if a file cannot be written.
    """
    for kind in kinds:
        metadata = {"Date": None} if kind == "svg" else None
        with whole_file(Path(folder) / f"{name}.{kind}") as file:
            figure.savefig(file, format=kind, metadata=metadata)
