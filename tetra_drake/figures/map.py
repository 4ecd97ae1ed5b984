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
from tetra_drake.figures.style import common_style, make_figure
from tetra_drake.formatting import fixed, listed
from tetra_drake.scenario.metric_units import METRICS
from tetra_drake.scenario.optimizer_kinds import QualityDiversity
from tetra_drake.scenario.units import customary

_LUCKY: Any = {"color": "0.55", "marker": "x", "linestyle": "", "markersize": 3.0, "zorder": 3}
_NUMBER: Any = {"ha": "center", "va": "center", "fontsize": 7.0, "fontweight": "bold", "zorder": 4}
_DISC: Any = {"boxstyle": "circle,pad=0.15", "facecolor": "white", "edgecolor": "black"}

_LINE = 70  # largest number of letters in a line below a panel


@common_style()
def map_of_gaits(run: Run) -> Figure:
    """The fittest gait in each cell of the map and, if they were simulated on disturbed robots,
    the share of the draws that they keep; those that keep less than half of them are crosses.

    Numbers are the fittest gait and those nearest to the corners."""
    kind = cast(QualityDiversity, run.scenario.optimizer)
    gaits = elites(run)
    kept = robust(gaits)
    judged = bool(gaits["kept"].notna().any())
    panels = 2 if judged else 1
    width_in = 0.6 + 4.0 * panels
    figure, [row] = make_figure(width_in=width_in, height_in=4.6, columns=panels, sharey=True)
    edges = [
        np.linspace(low, high, count + 1) / customary(METRICS[name])[0]
        for (name, (low, high)), count in zip(kind.measures.items(), kind.cells, strict=True)
    ]
    _draw_cells(row[0], kept, kept["fitness"], edges, title="fitness", cmap="viridis")
    row[0].plot(*_middles(gaits[gaits["kept"] < LUCKY], edges), **_LUCKY)
    if judged:
        shares = 100.0 * gaits["kept"]
        look: Any = {"cmap": "cividis", "vmin": 0.0, "vmax": 100.0}
        _draw_cells(row[1], gaits, shares, edges, title="draws kept (%)", **look)
    named = distinct_gaits(chosen(run))
    x_label, y_label = (_label(name) for name in kind.measures)
    row[0].set(ylabel=y_label)
    for axes in row:
        axes.set(xlabel=x_label)
        for number, (_, gait) in enumerate(named, start=1):
            axes.text(*_middles(gait, edges), str(number), bbox=_DISC, **_NUMBER)
    lines = []
    for number, (names, gait) in enumerate(named, start=1):
        label = f"{number}  {listed(names)}: {gait_label(gait)}"
        lines.append(textwrap.fill(label, _LINE * panels, subsequent_indent="    "))
    figure.supxlabel("\n".join(lines), fontsize=8.5, ha="left", x=0.08)
    cells = math.prod(kind.cells)
    share = fixed(100.0 * len(kept) / cells, 0)
    figure.suptitle(f"Map of gaits\n{len(kept)} of {cells} cells ({share} %)")
    return figure


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
    axes.figure.colorbar(mesh, ax=axes, label=title)
    axes.grid(visible=False)


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
