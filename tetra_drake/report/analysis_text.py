"""Texts of the commands `robustness` and `compare`: tables in the scenario's units."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from tetra_drake.analysis.comparison import Compared
from tetra_drake.analysis.robustness import LOSS, Judgement, by_change, by_gait, chance
from tetra_drake.formatting import TextTable, fixed, percents, ranged, rounded, signed
from tetra_drake.settings.units import Units

if TYPE_CHECKING:
    import pandas


def robustness_text(judgement: Judgement) -> str:
    """Tables of a judgement: distances of gaits on disturbed robots, and the most harmful
    changes."""
    gaits, count = by_gait(judgement), judgement.draws["draw"].nunique()
    require, units = bool(judgement.scenario.require), judgement.scenario.units
    misses = " and misses no requirement" if require else ""
    texts = [
        f"Distances in {units.length_word} in {count} draws of disturbances: undisturbed, "
        "percentiles, mean.\n"
        f"Robust: share of draws in which a gait loses at most {100.0 * LOSS:g} %{misses}.\n"
        "In brackets: 95 % confidence intervals.",
        _gaits_table(gaits, units, with_missed=require).text(),
        f"What hurts most: change of the distance in {units.length_word} by one disturbance "
        "alone.\n"
        "Correlation: Spearman's, of factor and distance over the draws of a gait; mean, and\n"
        f"median of its absolute value. Chance alone gives up to {chance(count):.2f}.",
        _changes_table(by_change(judgement), units).text(),
    ]
    return "\n\n".join(texts)


def _gaits_table(gaits: pandas.DataFrame, units: Units, *, with_missed: bool) -> TextTable:
    shown = ["undisturbed", "5 %", "50 %", "95 %"]
    counts = ["failed", "missed"] if with_missed else ["failed"]
    rows = []
    for gait, row in gaits.iterrows():
        cells = [str(gait), *(rounded(row[length] / units.length) for length in shown)]
        lengths = row / units.length
        cells.append(ranged(lengths["mean"], lengths["mean_low"], lengths["mean_high"]))
        cells.append(percents(row["kept"], row["kept_low"], row["kept_high"]))
        cells += [f"{row[count]:.0f}" for count in counts]
        rows.append(cells)
    return TextTable(["gait", *shown, "mean", "robust", *counts], rows)


def _changes_table(changes: pandas.DataFrame, units: Units) -> TextTable:
    rows = []
    for what, row in changes.iterrows():
        correlation, size = signed(row["correlation"]), fixed(row["correlation_size"])
        if math.isnan(row["correlation"]):
            correlation, size = "", ""
        lengths, digits = row[["median", "worst"]] / units.length, units.decimals + 1
        median, worst = fixed(lengths["median"], digits), signed(lengths["worst"], digits)
        rows.append([str(what), median, worst, f"{row['failed']:.0f}", correlation, size])
    headings = ["disturbance", "median change", "worst", "failed", "correlation", "|correlation|"]
    return TextTable(headings, rows)


def comparison_text(compared: Compared) -> str:
    """Tables of the fitnesses and distances of compared runs."""
    units = compared.scenario.units
    distances = f"Distance in {units.length_word} of the best gait of each trial, also as "
    distances += "interquartile mean."
    if compared.reach is not None:
        distances += (
            f"\nSimulations until a trial's best gait walks {units.shown(compared.reach, 'm')}: "
            "median (quartiles) over trials."
        )
    texts = [
        f"Best fitness of each trial after {compared.common} simulations, where the first run "
        "ends, and at its end:\ninterquartile mean over trials (95 % confidence interval). A run "
        "ends with its longest trial,\nor with the first unfinished one. Simulations: median over "
        "trials.",
        _fitness_table(compared).text(),
        *([] if compared.improvement.empty else [improvement_text(compared.improvement)]),
        distances,
        _distance_table(compared).text(),
    ]
    texts += [f"note: {note}" for note in compared.notes]
    return "\n\n".join(texts)


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


def _fitness_table(compared: Compared) -> TextTable:
    rows = []
    for label, row in compared.runs.iterrows():
        cells = [str(label), f"{row['trials']:.0f}", f"{row['cost']:.0f}"]
        cells.append(ranged(row["at_common_mean"], row["at_common_low"], row["at_common_high"]))
        cells.append(ranged(row["fitness_mean"], row["fitness_low"], row["fitness_high"]))
        rows.append(cells)
    headings = ["run", "trials", "simulations", f"after {compared.common}", "at the end"]
    return TextTable(headings, rows)


def _distance_table(compared: Compared) -> TextTable:
    headings, units = ["run", "distance", "s per evaluation"], compared.scenario.units
    if compared.reach is not None:
        headings += [f"simulations to {units.shown(compared.reach, 'm')}", "trials that reach it"]
    rows = []
    for label, row in compared.runs.iterrows():
        lengths = row / units.length
        mean = ranged(lengths["distance_mean"], lengths["distance_low"], lengths["distance_high"])
        cells = [str(label), mean, rounded(row["wall_time"], 2)]
        if compared.reach is not None:
            low, high = _cost(row["reached_low"]), _cost(row["reached_high"])
            cells.append(f"{_cost(row['reached'])} ({low} to {high})")
            reached_by = row["share"] * row["trials"]
            cells.append(f"{reached_by:.0f} of {row['trials']:.0f}")
        rows.append(cells)
    return TextTable(headings, rows)


def _cost(cost: float) -> str:
    return f"{cost:.0f}" if math.isfinite(cost) else "never"
