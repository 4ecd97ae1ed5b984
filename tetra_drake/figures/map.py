"""The figure of a run's map of gaits."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np
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

_LINE = 70
"""Letters below a panel."""


@common_style()
def map_of_gaits(run: Run) -> Figure:
    """The fittest gait in each cell of the map and, if they were simulated on disturbed robots,
    the share of the draws that they keep; those that keep less than half of them are crosses.

    Numbers are the fittest gait and those nearest to the corners."""
    kind = run.manifest.scenario.optimizer
    assert isinstance(kind, QualityDiversity)
    found = elites(run)
    kept, judged = robust(found), bool(found["kept"].notna().any())
    figure, [row] = make_figure(
        width_in=4.6 + 4.0 * judged, height_in=4.6, columns=1 + judged, sharey=True
    )
    lucky = found[found["kept"] < LUCKY]
    panels = [("fitness", kept, kept["fitness"], {"cmap": "viridis"})]
    if judged:
        shares: Any = {"cmap": "cividis", "vmin": 0.0, "vmax": 100.0}
        panels.append(("draws kept (%)", found, 100.0 * found["kept"], shares))
    edges = [_edges(*each) for each in zip(kind.measures.items(), kind.cells, strict=True)]
    middles, named = [(edge[:-1] + edge[1:]) / 2.0 for edge in edges], distinct_gaits(chosen(run))
    for axes, (title, gaits, values, look) in zip(row, panels, strict=True):
        grid = np.full(kind.cells, np.nan)
        grid[tuple(gaits[CELLS].to_numpy().T)] = values
        mesh = axes.pcolormesh(*edges, grid.T, rasterized=True, **look)
        figure.colorbar(mesh, ax=axes, label=title)
        axes.grid(visible=False)
        axes.set(xlabel=_label(kind, 0))
        if axes is row[0]:
            axes.plot(*(m[lucky[c]] for m, c in zip(middles, CELLS, strict=True)), **_LUCKY)
        for number, (_, gait) in enumerate(named, start=1):
            place = [m[gait[c]] for m, c in zip(middles, CELLS, strict=True)]
            axes.text(*place, str(number), bbox=_DISC, **_NUMBER)
    row[0].set(ylabel=_label(kind, 1))
    labels = (f"{i}  {listed(n)}: {gait_label(gait)}" for i, (n, gait) in enumerate(named, start=1))
    lines = [textwrap.fill(label, _LINE * len(row), subsequent_indent="    ") for label in labels]
    figure.supxlabel("\n".join(lines), fontsize=8.5, ha="left", x=0.08)
    share = fixed(100.0 * len(kept) / np.prod(kind.cells), 0)
    figure.suptitle(f"Map of gaits\n{len(kept)} of {np.prod(kind.cells)} cells ({share} %)")
    return figure


def _edges(measure: tuple[str, list[float]], count: int) -> np.ndarray:
    name, (low, high) = measure
    return np.linspace(low, high, count + 1) / customary(METRICS[name])[0]


def _label(kind: QualityDiversity, axis: int) -> str:
    name = list(kind.measures)[axis]
    unit = customary(METRICS[name])[1]
    return name.replace("_", " ") + f" ({unit})" * bool(unit)
