"""The figure of a run's map of gaits."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from typing import Any, cast

import numpy as np
import pandas
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tetra_drake.analysis.elites import CELLS, LUCKY, chosen, distinct_gaits, elites, robust
from tetra_drake.evolution.run import Run, gait_label
from tetra_drake.figures.style import BELOW, common_style, figure_of, name_panel, page, split
from tetra_drake.formatting import listed
from tetra_drake.scenario.metric_units import METRICS
from tetra_drake.scenario.optimizer_kinds import QualityDiversity
from tetra_drake.scenario.units import customary

_LUCKY: Any = {"color": "0.55", "marker": "x", "linestyle": "", "markersize": 3.0, "zorder": 3}
_NUMBER: Any = {"ha": "center", "va": "center", "fontsize": 7.0, "fontweight": "bold", "zorder": 4}
_DISC: Any = {"boxstyle": "circle,pad=0.15", "facecolor": "white", "edgecolor": "black"}

_LINE = 110  # largest number of letters in a line below the panels
_NOTE_HEIGHT = 0.17  # inches on paper


@common_style()
def map_of_gaits(run: Run, *, axes: Axes | None = None) -> Figure:
    """The fittest gait in each cell of the map. White: cells without a gait.

    If gaits were simulated on disturbed robots: a cross marks a gait that keeps its distance in
    less than half of the draws, and the panel beside shows the share of draws in which it does.
    Numbers: the fittest gait, and those nearest to the corners."""
    kind = cast(QualityDiversity, run.scenario.optimizer)
    gaits = elites(run)
    kept = robust(gaits)
    judged = bool(gaits["kept"].notna().any())
    count = 2 if judged else 1
    edges = [
        np.linspace(low, high, cells + 1) / customary(METRICS[name])[0]
        for (name, (low, high)), cells in zip(kind.measures.items(), kind.cells, strict=True)
    ]
    named = distinct_gaits(chosen(run))
    notes = _notes(named)
    host = page(axes, height_in=3.9 + _NOTE_HEIGHT * len(notes))
    below = BELOW + 8.0 + 72.0 * _NOTE_HEIGHT * len(notes)
    size: Any = {"widths": [1.0] * count, "gap_x": 56.0, "share_y": True}
    row = split(host, **size, above=18.0, below=below)[0]
    title = f"fitness ({len(kept)} of {math.prod(kind.cells)} cells)"
    _draw_cells(row[0], kept, kept["fitness"], edges, title=title, cmap="viridis")
    if judged:
        row[0].plot(*_middles(gaits[gaits["kept"] < LUCKY], edges), **_LUCKY)
        shares = 100.0 * gaits["kept"]
        look: Any = {"cmap": "cividis", "vmin": 0.0, "vmax": 100.0}
        _draw_cells(row[1], gaits, shares, edges, title="draws kept (%)", **look)
    x_label, y_label = (_label(name) for name in kind.measures)
    row[0].set(ylabel=y_label)
    for panel in row:
        panel.set(xlabel=x_label)
        for number, (_, gait) in enumerate(named, start=1):
            panel.text(*_middles(gait, edges), str(number), bbox=_DISC, **_NUMBER)
    place: Any = {"transform": host.transAxes, "va": "bottom", "linespacing": 1.35}
    host.text(0.0, 0.0, "\n".join(notes), fontsize=8.0, **place)
    host.set_title("Map of gaits", loc="left")
    return figure_of(host)


def _notes(named: Sequence[tuple[Sequence[str], pandas.Series]]) -> list[str]:
    """Lines that say which gaits the numbers are."""
    notes = []
    for number, (names, gait) in enumerate(named, start=1):
        label = f"{number}  {listed(names)}: {gait_label(gait)}"
        notes += textwrap.wrap(label, _LINE, subsequent_indent="    ")
    return notes


def _draw_cells(
    axes: Axes,
    gaits: pandas.DataFrame,
    values: pandas.Series,
    edges: Sequence[np.ndarray],
    *,
    title: str,
    **look: Any,
) -> None:
    """Colours the cell of each gait by its value."""
    grid = np.full([len(edge) - 1 for edge in edges], np.nan)
    across, up = CELLS
    grid[gaits[across], gaits[up]] = values
    mesh = axes.pcolormesh(*edges, grid.T, rasterized=True, **look)
    bar = axes.inset_axes((1.03, 0.0, 0.04, 1.0))
    figure_of(axes).colorbar(mesh, cax=bar)
    axes.grid(visible=False)
    name_panel(axes, title)


def _middles(gaits: Any, edges: Sequence[np.ndarray]) -> list[Any]:
    """The middles of the cells of one gait or a table of gaits, along each axis."""
    middles = []
    for edge, cell in zip(edges, CELLS, strict=True):
        middles.append((edge[:-1] + edge[1:])[gaits[cell]] / 2.0)
    return middles


def _label(name: str) -> str:
    unit = customary(METRICS[name])[1]
    title = name.replace("_", " ")
    return f"{title} ({unit})" if unit else title
