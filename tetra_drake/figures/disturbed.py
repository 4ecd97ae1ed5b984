"""The robustness of gaits as a figure and files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tetra_drake.analysis.robustness import (
    LOSS,
    Judgement,
    by_change,
    by_gait,
    chance,
    robustness_numbers,
)
from tetra_drake.figures.style import OKABE_ITO, REFERENCE, SHADE, common_style, save_findings
from tetra_drake.formatting import fixed
from tetra_drake.scenario.units import INCH

_DOTS: Any = {
    "color": OKABE_ITO["sky_blue"],
    "linestyle": "",
    "marker": "o",
    "markersize": 2.0,
    "alpha": 0.4,
    "zorder": 0,
}
_LINE = {"color": OKABE_ITO["blue"], "linewidth": 1.2}
_BOX: Any = {
    "orientation": "horizontal",
    "widths": 0.6,
    "whis": (5, 95),
    "showfliers": False,
    "manage_ticks": False,
    "boxprops": _LINE,
    "medianprops": _LINE,
    "whiskerprops": _LINE,
    "capprops": _LINE,
}
_LOSS: Any = {"marker": "d", "linestyle": "", "color": OKABE_ITO["vermillion"]}
_MEAN: Any = {"marker": "d", "linestyle": "", "color": OKABE_ITO["blue"]}


def save_judgement(judgement: Judgement, folder: Path) -> list[str]:
    """Writes draws.csv and alone.csv (all simulations, SI), summary.json and the figure to the
    folder; returns the names. Raises InputError if a file cannot be written."""
    tables = {
        "draws": judgement.compared(judgement.draws),
        "alone": judgement.compared(judgement.alone),
    }
    figure, summary = robustness(judgement), robustness_numbers(judgement)
    return save_findings(figure, folder, "robustness", tables=tables, summary=summary)


@common_style()
def robustness(judgement: Judgement) -> Figure:
    """Distance under fresh draws of the disturbances over undisturbed distance, by gait, and what
    hurts most.

    Boxes are quartiles, their whiskers 5 to 95 % of the draws; the dashed line is where a gait
    still keeps a draw. Gaits that keep most draws are on top. What lies in the grey may be chance.
    """
    gaits = by_gait(judgement).sort_values("kept", kind="stable")
    changes, count = by_change(judgement).iloc[::-1], judgement.draws["draw"].nunique()
    figure = Figure(figsize=(10.0, 1.6 + 0.24 * max(len(gaits), len(changes), 6)))
    left, middle, right = figure.subplots(1, 3, width_ratios=[5, 3, 3])
    _draw_distances(left, judgement, gaits)
    _draw_alone(middle, changes)
    _draw_correlations(right, changes, chance(count))
    figure.legend(loc="outside lower center", ncols=4)
    gait = f"the median of {len(gaits)} gaits" if len(gaits) > 1 else "the gait"
    kept = fixed(100.0 * gaits["kept"].median(), 0)
    figure.suptitle(f"Robustness under {count} fresh draws\n{gait} keeps {kept} % of them")
    return figure


def _draw_distances(axes: Axes, judgement: Judgement, gaits: pandas.DataFrame) -> None:
    draws = judgement.compared(judgement.draws).dropna(subset=["distance", "undisturbed"])
    for place, gait in enumerate(gaits.index):
        walks = draws[draws["gait"] == gait]
        shares = walks["distance"] / walks["undisturbed"]
        # The golden ratio spreads any number of dots evenly.
        heights = place + 0.6 * (walks["draw"] * 0.618034 % 1.0 - 0.5)
        axes.plot(shares, heights, **_DOTS)
        axes.boxplot(shares, positions=[place], **_BOX)
    axes.axvline(1.0 - LOSS, **REFERENCE)
    axes.axvline(1.0, color="black", linewidth=0.8)
    margin = max(0.7, 2.5 - len(gaits) / 2)  # else the box of a single gait fills the axes
    axes.set(
        title=f"gait: draws that it keeps ({100.0 * (1.0 - LOSS):g} % or more)",
        xlabel="distance / undisturbed distance",
        yticks=range(len(gaits)),
        yticklabels=[f"{g}: {fixed(100.0 * kept, 0)} %" for g, kept in gaits["kept"].items()],
        ylim=(-margin, len(gaits) - 1 + margin),
        xmargin=0.02,
    )
    axes.grid(visible=False, axis="y")


def _draw_alone(axes: Axes, changes: pandas.DataFrame) -> None:
    places, worst = range(len(changes)), changes["worst"].clip(upper=0.0).abs() / INCH
    axes.barh(places, changes["median"] / INCH, color=OKABE_ITO["orange"], label="median change")
    axes.plot(worst, places, label="greatest loss", **_LOSS)
    axes.set(title="one change alone", xlabel="change of distance (in)")
    _finish(axes, list(changes.index))


def _draw_correlations(axes: Axes, changes: pandas.DataFrame, noise: float) -> None:
    places = range(len(changes))
    axes.axvspan(-noise, noise, color=SHADE, zorder=0)
    sizes, sky_blue = changes["correlation_size"], OKABE_ITO["sky_blue"]
    axes.barh(places, sizes, color=sky_blue, label="median size of correlation")
    axes.plot(changes["correlation"], places, label="mean correlation", **_MEAN)
    axes.axvline(0.0, color="black", linewidth=0.8)
    axes.set(title="all changes together", xlabel="rank correlation")
    _finish(axes, [""] * len(changes))


def _finish(axes: Axes, labels: list[str]) -> None:
    axes.set_yticks(range(len(labels)), labels)
    axes.set(ylim=(-0.7, len(labels) - 0.3), xmargin=0.05)
    axes.grid(visible=False, axis="y")
