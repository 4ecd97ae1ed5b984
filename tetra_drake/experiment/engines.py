"""How far the two engines agree on the gaits of a run that were evaluated on both."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tetra_drake.evolution.tables import RunTables
from tetra_drake.figures.style import OKABE_ITO, REFERENCE, common_style, make_figure, save_figure

if TYPE_CHECKING:
    import pandas

FIGURE = "engines"
"""The figure's name, without suffix."""

_CLOSE = 0.1  # in


@dataclass(frozen=True)
class Agreement:
    """The absolute differences of the distances of some gaits on the two engines."""

    gaits: int
    """Those that walked on both engines."""
    failed: int
    """Those that failed on one of them at least."""
    median_in: float
    percentile_95_in: float
    share_close: float
    """The share of the gaits, 0 to 1, that differ by less than 0.1 in."""
    share_direction: float
    """The share of the gaits, 0 to 1, that go forward on both or backward on both."""


def distances_on_both(run: RunTables) -> pandas.DataFrame:
    """The gaits of a compiled run that were evaluated again on the Drake diagram.

    Columns trial, index, iteration, compiled_in and drake_in, NaN where a gait failed;
    without rows if there are none.
    """
    import pandas

    if run.reevaluations.empty:
        return pandas.DataFrame(columns=["trial", "index", "iteration", "compiled_in", "drake_in"])
    key = ["trial", "index"]
    compiled = run.evaluations[[*key, "iteration", "distance_in"]]
    drake = run.reevaluations[[*key, "distance_in"]]
    both = compiled.merge(drake, on=key, suffixes=("_compiled", "_drake"), validate="one_to_one")
    return both.rename(
        columns={"distance_in_compiled": "compiled_in", "distance_in_drake": "drake_in"}
    )


def initial_distances(run: RunTables) -> pandas.DataFrame:
    """Those of distances_on_both() that are of the initial populations."""
    both = distances_on_both(run)
    return both[both["iteration"] == 0]


def evolved_distances(run: RunTables) -> pandas.DataFrame:
    """Those of distances_on_both() that came later."""
    both = distances_on_both(run)
    return both[both["iteration"] > 0]


def agreement(distances: pandas.DataFrame) -> Agreement:
    """What there is to say of rows of distances_on_both(), of which one at least has walked."""
    walked = distances.dropna()
    difference = (walked["compiled_in"] - walked["drake_in"]).abs()
    same_way = (walked["compiled_in"] < 0.0) == (walked["drake_in"] < 0.0)
    return Agreement(
        gaits=len(walked),
        failed=len(distances) - len(walked),
        median_in=float(difference.median()),
        percentile_95_in=float(difference.quantile(0.95)),
        share_close=float((difference < _CLOSE).mean()),
        share_direction=float(same_way.mean()),
    )


def draw_engines(run: RunTables, folder: Path) -> bool:
    """Writes figure_engines() to the folder, if initial gaits were evaluated on both engines.

    Returns whether there are any.
    """
    distances = initial_distances(run).dropna()
    if distances.empty:
        return False
    save_figure(figure_engines(distances), folder, FIGURE)
    return True


@common_style()
def figure_engines(distances: pandas.DataFrame) -> Figure:
    """The distances of initial gaits on the Drake diagram over those on the compiled engine.

    Beside them the share of the gaits over the absolute difference. Takes rows of
    distances_on_both() without failures; in inches.
    """
    found = agreement(distances)
    figure, panels = make_figure(width_in=8.0, height_in=4.2, columns=2)
    _scatter(panels[0, 0], distances)
    difference = np.sort((distances["compiled_in"] - distances["drake_in"]).abs())
    axes: Axes = panels[0, 1]
    shown = np.maximum(difference, 1e-4)  # none is 0 on a logarithmic axis
    share = 100.0 * np.arange(1, len(shown) + 1) / len(shown)
    axes.step(shown, share, where="post", color=OKABE_ITO["blue"], linestyle="-")
    for value, percent in ((found.median_in, 50.0), (found.percentile_95_in, 95.0)):
        axes.plot(value, percent, "o", color=OKABE_ITO["vermillion"])
        axes.annotate(
            f"{percent:g} %: {value:.2g} in",
            (value, percent),
            (-6, 4),
            textcoords="offset points",
            ha="right",
        )
    axes.set_xscale("log")
    axes.set_ylim(0.0, 102.0)
    axes.set_xlabel("difference of the distances, absolute (in)")
    axes.set_ylabel("gaits that differ by less (%)")
    figure.suptitle(f"{found.gaits} random gaits on both engines")
    return figure


def _scatter(axes: Axes, distances: pandas.DataFrame) -> None:
    compiled, drake = distances["compiled_in"], distances["drake_in"]
    ends = [min(compiled.min(), drake.min()), max(compiled.max(), drake.max())]
    equal: dict[str, Any] = REFERENCE | {"label": "equal"}
    axes.plot(ends, ends, **equal)
    dots: dict[str, Any] = {"marker": "o", "linestyle": "", "markersize": 2.5, "alpha": 0.6}
    axes.plot(compiled, drake, color=OKABE_ITO["blue"], **dots, markeredgewidth=0.0, label="a gait")
    axes.set_aspect("equal")
    axes.margins(0.04)
    axes.set_xlabel("distance on the compiled engine (in)")
    axes.set_ylabel("distance on the Drake diagram (in)")
    axes.legend(loc="upper left")
