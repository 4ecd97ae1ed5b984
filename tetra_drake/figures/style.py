"""The look that all figures share, and how they are written.

A figure function is decorated with `@common_style()`, begins with make_figure() and returns the
figure; save_figure() writes it. Nothing here needs a display or keeps pyplot's state.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import matplotlib.style
import numpy as np
from matplotlib.figure import Figure
from matplotlib.rcsetup import cycler

from tetra_drake.files import whole_file

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
"""The colours that Okabe and Ito chose for colour-blind people. Yellow is too faint on white
for lines."""

LINE_COLOURS = tuple(colour for name, colour in OKABE_ITO.items() if name != "yellow")
"""In the order in which series take them: neighbours differ in lightness, too."""

DASHES = ("-", (0, (5, 1.5)), (0, (1.2, 1.2)), (0, (6, 1.5, 1.2, 1.5)))
"""Line styles that tell series apart in a grey print. As there are four of them and seven
colours, 28 series differ."""

SHADE = "0.9"
"""Grey of a stretch of time that is marked behind the data."""

REFERENCE = {"color": "0.35", "linestyle": (0, (4, 3)), "linewidth": 1.0}
"""The line style of the thesis's numbers."""


def line_style(index: int) -> dict[str, Any]:
    """Colour and dashes of a series by its index; they tell 28 series apart."""
    return {
        "color": LINE_COLOURS[index % len(LINE_COLOURS)],
        "linestyle": DASHES[index % len(DASHES)],
    }


_SERIES = [line_style(index) for index in range(len(LINE_COLOURS) * len(DASHES))]

_STYLE: Any = {
    "axes.prop_cycle": cycler(
        color=[style["color"] for style in _SERIES],
        linestyle=[style["linestyle"] for style in _SERIES],
    ),
    "font.family": "DejaVu Sans",  # comes with matplotlib: the same on every machine
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.labelsize": 9.0,
    "figure.titlesize": 10.5,
    "figure.labelsize": 9.0,
    "legend.fontsize": 8.5,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "lines.linewidth": 1.3,
    "lines.markersize": 4.0,
    "axes.linewidth": 0.8,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.xmargin": 0.0,
    "grid.color": "0.86",
    "grid.linewidth": 0.5,
    "legend.frameon": True,
    "legend.framealpha": 0.9,
    "legend.edgecolor": "0.8",
    "legend.borderpad": 0.35,
    "legend.handlelength": 2.4,
    "figure.constrained_layout.use": True,
    "path.simplify": True,
    "path.simplify_threshold": 0.3,
    "svg.fonttype": "path",
    "svg.hashsalt": "tetra_drake",  # else ids, and so bytes, are random
}

PNG_DPI = 150


@contextlib.contextmanager
def common_style() -> Iterator[None]:
    """What is drawn inside has the common look, whatever the user's matplotlibrc says.

    As `@common_style()` it decorates a function that draws.
    """
    with matplotlib.style.context("default"), matplotlib.rc_context(_STYLE):
        yield


@common_style()
def make_figure(
    *, width_in: float, height_in: float, rows: int = 1, columns: int = 1, **layout: Any
) -> tuple[Figure, np.ndarray]:
    """A figure and its axes, always (rows, columns); sizes in inches on paper.

    `layout` goes to Figure.subplots: sharex, sharey, height_ratios, width_ratios ...
    """
    figure = Figure(figsize=(width_in, height_in))
    return figure, figure.subplots(rows, columns, squeeze=False, **layout)


@common_style()
def save_figure(
    figure: Figure, folder: str | Path, name: str, *, kinds: Sequence[str] = ("svg", "png")
) -> None:
    """Writes NAME.svg and NAME.png (150 dpi) to the folder, each whole or not at all.

    Equal data give equal bytes. Raises InputError if a file cannot be written.
    """
    for kind in kinds:
        metadata = {"Date": None} if kind == "svg" else None
        with whole_file(Path(folder) / f"{name}.{kind}") as file:
            figure.savefig(file, format=kind, dpi=PNG_DPI, metadata=metadata)
            if kind == "svg":
                svg = file.read_text(encoding="utf-8")
                file.write_text(_without_needless_digits(svg), encoding="utf-8")


def _without_needless_digits(svg: str) -> str:
    """Paths to 0.01 points, which matplotlib writes to 1e-6: an eighth of the file."""
    return re.sub(r' d="[^"]*"', lambda path: re.sub(r"(\.\d\d)\d+", r"\1", path[0]), svg)
