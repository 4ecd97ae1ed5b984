"""Distances of gaits that a run evaluated on both engines."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tetra_drake.figures.style import OKABE_ITO, REFERENCE, common_style, make_figure

if TYPE_CHECKING:
    import pandas

    from tetra_drake.evolution.tables import Run

_CLOSE_IN = 0.1


@dataclass(frozen=True)
class Agreement:
    """Statistics of the absolute differences between distances on two engines."""

    gaits: int
    """Number of gaits that have failed on neither engine."""
    failed: int
    median_in: float
    percentile_95_in: float
    share_close: float
    """Share of the gaits, 0 to 1, whose distances differ by less than 0.1 in."""
    share_direction: float
    """Share of the gaits, 0 to 1, that walk in the same direction on both engines."""


def distances_on_both(run: Run) -> pandas.DataFrame:
    """Distances of the gaits that were evaluated again on the Drake diagram.

    Columns: trial, index, iteration, compiled_in and drake_in (NaN where a gait failed).
    """
    key = ["trial", "index"]
    compiled = run.evaluations[[*key, "iteration", "distance_in"]]
    drake = run.reevaluations.reindex(columns=[*key, "distance_in"])
    both = compiled.merge(drake, on=key, suffixes=("_1", "_2"), validate="one_to_one")
    return both.rename(columns={"distance_in_1": "compiled_in", "distance_in_2": "drake_in"})


def agreement(distances: pandas.DataFrame) -> Agreement:
    """Statistics of rows of distances_on_both()."""
    walked = distances.dropna()
    difference = (walked["compiled_in"] - walked["drake_in"]).abs()
    same_way = (walked["compiled_in"] < 0.0) == (walked["drake_in"] < 0.0)
    return Agreement(
        gaits=len(walked),
        failed=len(distances) - len(walked),
        median_in=float(difference.median()),
        percentile_95_in=float(difference.quantile(0.95)),
        share_close=float((difference < _CLOSE_IN).mean()),
        share_direction=float(same_way.mean()),
    )


@common_style()
def both_engines(distances: pandas.DataFrame) -> Figure:
    """Distances of initial gaits on the diagram over those on the compiled engine (left), and the
    share of the gaits below each absolute difference (right); gaits that failed are left out."""
    walked, found = distances.dropna(), agreement(distances)
    compiled, drake = walked["compiled_in"], walked["drake_in"]
    figure, panels = make_figure(width_in=8.0, height_in=4.2, columns=2)
    scatter: Axes = panels[0, 0]
    ends = [min(compiled.min(), drake.min()), max(compiled.max(), drake.max())]
    scatter.plot(ends, ends, label="equal", **REFERENCE)
    dots: Any = {"marker": "o", "linestyle": "", "markersize": 2.5, "markeredgewidth": 0.0}
    scatter.plot(compiled, drake, color=OKABE_ITO["blue"], alpha=0.6, label="gait", **dots)
    scatter.set(aspect="equal", xlabel="compiled engine (in)", ylabel="Drake diagram (in)")
    scatter.margins(0.04)
    scatter.legend(loc="upper left")
    shares: Axes = panels[0, 1]
    difference = np.sort((compiled - drake).abs()).clip(min=1e-4)
    percent = 100.0 * np.arange(1, len(difference) + 1) / len(difference)
    shares.step(difference, percent, where="post", color=OKABE_ITO["blue"], linestyle="-")
    for value, height in ((found.median_in, 50), (found.percentile_95_in, 95)):
        shares.plot(value, height, "o", color=OKABE_ITO["vermillion"])
        place: Any = {"xytext": (-6, 4), "textcoords": "offset points", "ha": "right"}
        shares.annotate(f"{height} %: {value:.2g} in", (value, height), **place)
    shares.set(xscale="log", xlabel="absolute difference (in)")
    shares.set(ylim=(0.0, 102.0), ylabel="gaits with a smaller difference (%)")
    figure.suptitle(f"Distances of {found.gaits} gaits on both engines")
    return figure
