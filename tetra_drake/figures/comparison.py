"""Text, figure and files of a comparison of runs."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas
from matplotlib import rcParams
from matplotlib.ticker import FixedLocator, NullFormatter, StrMethodFormatter

from tetra_drake.figures.style import (
    AS_USUAL,
    Drawn,
    Look,
    Print,
    figure_function,
    legend_below,
    line_style,
    page_of,
    page_width,
    save_findings,
    set_title,
)
from tetra_drake.formatting import TextTable, fixed, ranged, rounded
from tetra_drake.study.comparison import Compared, comparison_numbers

_FIRST = 10  # simulations; the axes of costs begin here
_STEPS: Any = {"drawstyle": "steps-post", "marker": "o", "markevery": [-1]}
_POWERS = 10.0 ** np.arange(9)
_BESIDE = 5.5  # least width (in) of two panels side by side, with letters of the usual size


def comparison_text(compared: Compared) -> str:
    """Tables of the fitnesses and distances of compared runs."""
    units, reach = compared.scenario.units, compared.reach
    distance = f"Distance in {units.length_word} of the best gait of each trial, also as "
    distance += "interquartile mean."
    fitness_headings = ["run", "trials", "simulations", f"after {compared.common}", "at the end"]
    distance_headings = ["run", "distance", "s per evaluation"]
    if reach is not None:
        shown = units.shown(reach, "m")
        distance += f"\nSimulations until a trial's best gait walks {shown}: "
        distance += "median (quartiles) over trials."
        distance_headings += [f"simulations to {shown}", "trials that reach it"]
    fitnesses, distances = [], []
    for label, row in compared.runs.iterrows():
        common = ranged(row["at_common_mean"], row["at_common_low"], row["at_common_high"])
        end = ranged(row["fitness_mean"], row["fitness_low"], row["fitness_high"])
        fitnesses.append([str(label), f"{row['trials']:.0f}", f"{row['cost']:.0f}", common, end])
        lengths = row[["distance_mean", "distance_low", "distance_high"]] / units.length
        cells = [str(label), ranged(*lengths), rounded(row["wall_time"], 2)]
        if reach is not None:
            costs = row[["reached", "reached_low", "reached_high"]]
            median, low, high = (f"{x:.0f}" if math.isfinite(x) else "never" for x in costs)
            of = f"{row['share'] * row['trials']:.0f} of {row['trials']:.0f}"
            cells += [f"{median} ({low} to {high})", of]
        distances.append(cells)
    texts = [
        f"Best fitness of each trial after {compared.common} simulations, where the first run "
        "ends, and at its end:\ninterquartile mean over trials (95 % confidence interval). A run "
        "ends with its longest trial,\nor with the first unfinished one. Simulations: median over "
        "trials.",
        TextTable(fitness_headings, fitnesses).text(),
        *([] if compared.improvement.empty else [improvement_text(compared.improvement)]),
        distance,
        TextTable(distance_headings, distances).text(),
    ]
    return "\n\n".join(texts + [f"note: {note}" for note in compared.notes])


def improvement_text(improvement: pandas.DataFrame) -> str:
    """Table of the probabilities of improvement, with their intervals. See Compared.improvement."""
    cells = {}
    for pair, row in improvement.iterrows():
        probability, low, high = (fixed(row[name]) for name in ("probability", "low", "high"))
        cells[pair] = "-" if math.isnan(row["low"]) else f"{probability} ({low} to {high})"
    labels = list(dict.fromkeys(run for run, _ in cells))
    rows = [[run, *(cells.get((run, other), "") for other in labels)] for run in labels]
    return (
        "Probability that a trial of the row's run ends fitter than a trial of the column's run\n"
        "(95 % confidence interval); - where a run has a single trial.\n"
        + TextTable(["run", *labels], rows).text()
    )


def save_comparison(compared: Compared, folder: Path, printed: Print = AS_USUAL) -> list[str]:
    """Writes trials.csv, curves.csv, summary.json (lengths in m) and the figure to a folder.

    Returns the names of the files. Raises InputError if a file cannot be written.
    """
    tables = {"trials": compared.trials, "curves": compared.curves}
    figure, summary = comparison(compared, **vars(printed.look)), comparison_numbers(compared)
    kinds = printed.kinds
    return save_findings(figure, folder, "comparison", tables=tables, summary=summary, kinds=kinds)


@figure_function
def comparison(compared: Compared) -> Drawn:
    """Comparison of runs: the best fitness so far, as median and interquartile band over the trials
    of each run.

    If a distance to reach was given, a second panel shows the share of trials that have reached it.
    Finished trials keep their last values. A dot marks the end of a run."""
    panel_count, unit = 1 if compared.reach is None else 2, compared.scenario.units
    counts = compared.runs["trials"].items()
    labels = [f"{label} ({count} {'trial' if count == 1 else 'trials'})" for label, count in counts]
    is_narrow = page_width() < _BESIDE * rcParams["font.size"] / Look.font_size
    rows, columns = (panel_count, 1) if is_narrow else (1, panel_count)
    page = page_of(height_in=1.2 + 2.2 * rows + 0.1 * len(labels))
    panels = page.subplots(rows, columns, squeeze=False).ravel()
    ends = compared.curves.groupby("run", sort=False)["cost"].max()
    first = min(_FIRST, ends.min())
    for series, label in enumerate(compared.runs.index):
        style: Any = line_style(series) | _STEPS
        curve = compared.curves.query("run == @label").replace(-math.inf, math.nan)
        curve["cost"] = curve["cost"].clip(lower=first)
        curve = curve.drop_duplicates("cost", keep="last")
        panels[0].plot(curve["cost"], curve["median"], **style)
        band: Any = {"step": "post", "color": style["color"], "alpha": 0.15, "linewidth": 0.0}
        panels[0].fill_between(curve["cost"], curve["low"], curve["high"], **band)
        if compared.reach is not None:
            reached = compared.trials.query("run == @label")["reached"].sort_values()
            there = reached[reached <= ends[label]]
            shares = 100.0 * np.arange(len(there) + 1) / len(reached)
            panels[1].plot([0.0, *there, ends[label]], [*shares, shares[-1]], **style)
    decades = math.log10(ends.max() / first)
    ticks = (1.0, 2.0, 5.0) if decades < 2.0 else (1.0, 3.0) if decades < 3.0 else (1.0,)
    for panel in panels:
        panel.set(xlabel="simulations", xscale="log", xlim=(first, 1.1 * ends.max()))
        # A locator that counts ticks by the width leaves a narrow panel without any.
        panel.xaxis.set_major_locator(FixedLocator(np.outer(_POWERS, ticks).ravel().tolist()))
        panel.xaxis.set_major_formatter(StrMethodFormatter("{x:,.0f}"))
        panel.xaxis.set_minor_formatter(NullFormatter())
    panels[0].set_ylabel("best fitness so far")
    if compared.reach is not None:
        distance = f"{compared.reach / unit.length:.4g} {unit.length_name}"
        panels[1].set(ylabel=f"{distance} reached (% of trials)", ylim=(-3.0, 103.0))
    legend_below(page, {label: line_style(series) for series, label in enumerate(labels)})
    set_title(page, "How well runs search: median and quartiles over trials")
    return page
