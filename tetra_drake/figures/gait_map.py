"""Figure of the map of gaits of a run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, cast

import numpy as np
import pandas
from matplotlib.axes import Axes

from tetra_drake.evolution.run import Run, gait_label
from tetra_drake.figures.style import Drawn, figure_function, name_panel, page_of, set_title
from tetra_drake.formatting import listed
from tetra_drake.scenario.metrics import UNITS
from tetra_drake.scenario.optimizer_kinds import QualityDiversity
from tetra_drake.study.elites import (
    CELLS,
    LUCKY,
    distinct_gaits,
    elites,
    kept_gaits,
    notable_gaits,
)

_LUCKY: Any = {"color": "0.55", "marker": "x", "linestyle": "", "markersize": 3.0, "zorder": 3}
_NUMBER: Any = {"ha": "center", "va": "center", "size": "small", "weight": "bold", "zorder": 4}
_SHARES: Any = {"cmap": "cividis", "vmin": 0.0, "vmax": 100.0}
_DISC: Any = {"boxstyle": "circle,pad=0.15", "facecolor": "white", "edgecolor": "black"}


@figure_function
def map_of_gaits(run: Run) -> Drawn:
    """Map of gaits: the fittest gait in each cell. White cells have no gait.

    If gaits were simulated on disturbed robots, the second panel shows the share of draws with
    nearly the undisturbed distance. A cross marks gaits for which this share is below one half.
    Numbers mark the fittest gait and the gaits nearest to the corners."""
    kind, units = cast(QualityDiversity, run.scenario.optimizer), run.scenario.units
    gaits = elites(run)
    kept = kept_gaits(gaits)
    judged = bool(gaits["kept"].notna().any())
    edges = [
        np.linspace(low, high, cells + 1) / units.of(UNITS[name])[0]
        for (name, (low, high)), cells in zip(kind.measures.items(), kind.cells, strict=True)
    ]
    named = distinct_gaits(notable_gaits(run))
    page = page_of(height_in=3.9 + 0.17 * len(named))
    row = page.subplots(1, 1 + judged, squeeze=False, sharey=True)[0]
    title = f"fitness ({len(kept)} of {math.prod(kind.cells)} cells)"
    _draw_cells(row[0], kept.set_index(CELLS)["fitness"], edges, title=title, cmap="viridis")
    if judged:
        row[0].plot(*_middles(gaits[gaits["kept"] < LUCKY], edges), **_LUCKY)
        shares = 100.0 * gaits.set_index(CELLS)["kept"]
        _draw_cells(row[1], shares, edges, title="draws kept (%)", **_SHARES)
    named_units = {name.replace("_", " "): units.of(UNITS[name])[1] for name in kind.measures}
    x_label, y_label = (f"{name} ({unit})" if unit else name for name, unit in named_units.items())
    row[0].set(ylabel=y_label)
    for panel in row:
        panel.set(xlabel=x_label)
        for number, (_, gait) in enumerate(named, start=1):
            panel.text(*_middles(gait, edges), str(number), bbox=_DISC, **_NUMBER)
    notes = [f"{listed(names)}: {gait_label(gait)}" for names, gait in named]
    notes = [f"{number}  {note}" for number, note in enumerate(notes, start=1)]
    page.supxlabel("\n".join(notes), x=0.01, ha="left", fontsize="small", wrap=True)
    set_title(page, "Map of gaits")
    return page


def _draw_cells(
    axes: Axes, values: pandas.Series, edges: Sequence[np.ndarray], *, title: str, **look: Any
) -> None:
    """Colours cells by their values; the index of a value is its cell."""
    across, up = (range(len(edge) - 1) for edge in edges)
    grid = values.unstack().reindex(index=across, columns=up)
    mesh = axes.pcolormesh(*edges, grid.to_numpy().T, rasterized=True, **look)
    axes.figure.colorbar(mesh, ax=axes)
    axes.grid(visible=False)
    name_panel(axes, title)


def _middles(gaits: Any, edges: Sequence[np.ndarray]) -> list[Any]:
    """Centres of the cells of one gait, or of a table of gaits, along each axis."""
    along = zip(edges, CELLS, strict=True)
    return [(edge[:-1] + edge[1:])[gaits[cell]] / 2.0 for edge, cell in along]
