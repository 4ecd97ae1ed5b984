"""Text, figure and files of the robustness of gaits."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pandas
from matplotlib.axes import Axes

from tetra_drake.study.robustness import (
    LOSS,
    Judgement,
    by_change,
    by_gait,
    chance,
    robustness_numbers,
)
from tetra_drake.figures.style import (
    OKABE_ITO,
    REFERENCE,
    SHADE,
    Drawn,
    figure_function,
    folded,
    most_lines,
    name_panel,
    page_of,
    page_width,
    save_findings,
    set_title,
    write_beside,
)
from tetra_drake.formatting import TextTable, fixed, percents, ranged, rounded, signed

_DOTS: Any = {"color": OKABE_ITO["sky_blue"], "markersize": 2.0, "alpha": 0.4, "zorder": 0}
_LINE = {"color": OKABE_ITO["blue"], "linewidth": 1.2}
_BOX: Any = {
    "orientation": "horizontal",
    "widths": 0.6,
    "whis": (5, 95),
    "showfliers": False,
    "manage_ticks": False,
    **dict.fromkeys(("boxprops", "medianprops", "whiskerprops", "capprops"), _LINE),
}
_BAR: Any = {"height": 0.6}
_GREATEST: Any = {"color": "black", "linewidth": 1.0}

_ROW = 0.22  # height of a row, in inches
_NAMES = 0.3  # largest width of the names, as a share of the page's width


def robustness_text(judgement: Judgement) -> str:
    """Tables of a judgement: distances of gaits on disturbed robots, and the most harmful
    changes."""
    units, count = judgement.scenario.units, judgement.draws["draw"].nunique()
    shown, counts, misses = ["undisturbed", "5 %", "50 %", "95 %"], ["failed"], ""
    if judgement.scenario.require:
        counts, misses = ["failed", "missed"], " and misses no requirement"
    gaits, changes = [], []
    for gait, row in by_gait(judgement).iterrows():
        lengths = row / units.length
        mean = ranged(lengths["mean"], lengths["mean_low"], lengths["mean_high"])
        robust = percents(row["kept"], row["kept_low"], row["kept_high"])
        cells = [str(gait), *map(rounded, lengths[shown]), mean, robust]
        gaits.append([*cells, *(f"{row[count]:.0f}" for count in counts)])
    digits = units.decimals + 1
    for what, row in by_change(judgement).iterrows():
        lengths = row[["median", "worst"]] / units.length
        cells = [str(what), fixed(lengths["median"], digits), signed(lengths["worst"], digits)]
        has_none = math.isnan(row["correlation"])
        both = signed(row["correlation"]), fixed(row["correlation_size"])
        changes.append([*cells, f"{row['failed']:.0f}", *(["", ""] if has_none else both)])
    headings = ["disturbance", "median change", "worst", "failed", "correlation", "|correlation|"]
    texts = [
        f"Distances in {units.length_word} in {count} draws of disturbances: undisturbed, "
        "percentiles, mean.\n"
        f"Robust: share of draws in which a gait loses at most {100.0 * LOSS:g} %{misses}.\n"
        "In brackets: 95 % confidence intervals.",
        TextTable(["gait", *shown, "mean", "robust", *counts], gaits).text(),
        f"What hurts most: change of the distance in {units.length_word} by one disturbance "
        "alone.\n"
        "Correlation: Spearman's, of factor and distance over the draws of a gait; mean, and\n"
        f"median of its absolute value. Chance alone gives up to {chance(count):.2f}.",
        TextTable(headings, changes).text(),
    ]
    return "\n\n".join(texts)


def save_judgement(judgement: Judgement, folder: Path) -> list[str]:
    """Writes draws.csv and alone.csv (all simulations, SI), summary.json and the figure to a
    folder.

    Returns the names of the files. Raises InputError if a file cannot be written.
    """
    given = {"draws": judgement.draws, "alone": judgement.alone}
    tables = {name: judgement.compared(table) for name, table in given.items()}
    figure, summary = robustness(judgement), robustness_numbers(judgement)
    return save_findings(figure, folder, "robustness", tables=tables, summary=summary)


@figure_function
def robustness(judgement: Judgement) -> Drawn:
    """Robustness of gaits on disturbed robots.

    Above: the distance in each draw divided by the undisturbed distance. Boxes are quartiles,
    whiskers 5 to 95 %. A gait keeps the draws to the right of the dashed line. Their share is at
    the right; the gait with the largest share is on top.

    Below left: one change alone. Bars are the median change of distance, lines the greatest loss.
    Below right: all changes together. Bars are the rank correlation of each change with the
    distance, without sign. A bar that ends in the grey may be chance."""
    unit = judgement.scenario.units
    gaits = by_gait(judgement).sort_values("kept", kind="stable")
    changes, count = by_change(judgement).iloc[::-1], judgement.draws["draw"].nunique()
    width = _NAMES * page_width()
    names = [folded(str(name), width) for name in gaits.index]
    what = [folded(str(name), width) for name in changes.index]
    rows = [max(most_lines(texts) * len(texts) + 1, 4) for texts in (names, what)]
    page = page_of(height_in=_ROW * sum(rows) + 1.8)
    places: Any = [["distances", "distances"], ["alone", "together"]]
    panels = page.subplot_mosaic(places, height_ratios=rows)
    above, alone, together = panels["distances"], panels["alone"], panels["together"]
    _draw_distances(above, judgement, gaits)
    above.set_yticks(range(len(names)), names)
    places, worst = range(len(what)), changes["worst"].clip(upper=0.0).abs() / unit.length
    alone.hlines(places, 0.0, worst, **_GREATEST)
    alone.barh(places, changes["median"] / unit.length, color=OKABE_ITO["orange"], **_BAR)
    together.axvspan(0.0, chance(count), color=SHADE, linewidth=0.0, zorder=0)
    together.barh(places, changes["correlation_size"], color=OKABE_ITO["sky_blue"], **_BAR)
    name_panel(alone, "one change alone")
    name_panel(together, "all changes together")
    labels = f"change of distance ({unit.length_name})", "size of rank correlation"
    for axes, label in zip((alone, together), labels, strict=True):
        axes.set_xlabel(folded(label, width))
        axes.set(xmargin=0.05, ylim=(-0.7, len(what) - 0.3))
        axes.set_xlim(left=0.0)
        axes.grid(visible=False, axis="y")
        axes.set_yticks(places, what)
    together.tick_params(labelleft=False)
    set_title(page, f"Robustness under {count} draws of disturbances")
    return page


def _draw_distances(axes: Axes, judgement: Judgement, gaits: pandas.DataFrame) -> None:
    draws = judgement.compared(judgement.draws).dropna(subset=["distance", "undisturbed"])
    for row, (gait, kept) in enumerate(gaits["kept"].items()):
        simulated = draws[draws["gait"] == gait]
        shares = simulated["distance"] / simulated["undisturbed"]
        # Multiples of the golden ratio spread any number of dots evenly.
        heights = row + 0.6 * (simulated["draw"] * 0.618034 % 1.0 - 0.5)
        axes.plot(shares, heights, "o", **_DOTS)
        axes.boxplot(shares, positions=[row], **_BOX)
        write_beside(axes, row, f"{fixed(100.0 * kept, 0)} %")
    axes.axvline(1.0 - LOSS, **REFERENCE)
    axes.axvline(1.0, color="black", linewidth=0.8)
    margin = max(0.7, 2.5 - len(gaits) / 2)  # a single gait has a thin box, too
    axes.set(xlabel="distance / undisturbed distance", xmargin=0.02)
    axes.set_ylim(-margin, len(gaits) - 1 + margin)
    name_panel(axes, "distance in each draw")
    axes.set_title("draws kept", loc="right", fontsize="medium", pad=3.0)
    axes.grid(visible=False, axis="y")
