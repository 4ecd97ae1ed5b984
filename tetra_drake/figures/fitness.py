"""Figures of the fitnesses of a recorded run."""

from __future__ import annotations

import math
from typing import Any

import pandas
from matplotlib.ticker import MaxNLocator

from tetra_drake.evolution.run import Run
from tetra_drake.figures.style import (
    OKABE_ITO,
    Drawn,
    figure_function,
    legend_below,
    line_style,
    page_of,
    titled,
)
from tetra_drake.formatting import fixed

_TICKS = 20  # largest number of labels below the axes
_SEVERAL = 4  # least number of trials for which quartiles are drawn

_TRIAL: Any = {"color": "0.7", "linewidth": 0.8, "linestyle": "-"}
_MEDIAN: Any = {"color": OKABE_ITO["blue"], "linewidth": 2.0, "linestyle": "-"}
_FITTEST: Any = {"color": "0.2", "linewidth": 1.0, "linestyle": "-"}
_LEAST_FIT: Any = {"color": "0.2", "linewidth": 1.0, "linestyle": (0, (4, 2))}
_BAND: Any = {"color": OKABE_ITO["blue"], "alpha": 0.18, "linewidth": 0.0}


def initial_extremes(run: Run) -> pandas.DataFrame:
    """Distances (m) of the fittest and the least fit gait of each trial's initial population: a row
    per trial, columns best and worst. Failed gaits are left out."""
    walked = run.initial().dropna(subset="fitness").sort_values(["trial", "fitness"])
    distances = walked.groupby("trial")["distance"]
    return pandas.DataFrame({"best": distances.last(), "worst": distances.first()})


@figure_function
def initial_distances(run: Run) -> Drawn:
    """Distances of the fittest and the least fit gait of each trial's initial population.

    Failed gaits are left out."""
    unit, width = run.scenario.units, 0.4
    extremes = initial_extremes(run) / unit.length
    page = page_of(height_in=3.6)
    panel = page.subplots()
    blue, orange = OKABE_ITO["blue"], OKABE_ITO["orange"]
    left, right = extremes.index - width / 2, extremes.index + width / 2
    panel.bar(left, extremes["best"], width, color=blue, label="fittest gait of a trial")
    panel.bar(right, extremes["worst"], width, color=orange, label="least fit gait of a trial")
    panel.axhline(0.0, color="black", linewidth=0.8)
    margin = max(0.9, 2.0 - len(extremes) / 2)  # a single trial has thin bars, too
    panel.set(
        xlabel="trial",
        ylabel=f"distance in {run.scenario.simulation.duration:g} s ({unit.length_name})",
        xlim=(extremes.index.min() - margin, extremes.index.max() + margin),
        xticks=extremes.index[:: math.ceil(len(extremes) / _TICKS)],
    )
    panel.grid(visible=False, axis="x")
    legend_below(page, {}, *panel.containers)
    return titled(page, "Best and worst initial gait of each trial")


@figure_function
def initial_fitness(run: Run, trial: int) -> Drawn:
    """Histogram of the fitness of a trial's initial population.

    Gaits that walk backward are hatched."""
    initial = run.initial().query("trial == @trial")
    walked = initial.dropna(subset="fitness")
    fitness, backward = walked["fitness"], walked["distance"] < 0.0
    page = page_of(height_in=3.6)
    panel = page.subplots()
    # Bin edges are round numbers, so zero is an edge if the values have both signs.
    locator = MaxNLocator(nbins=20, steps=[1, 2, 2.5, 5, 10])
    panel.hist(
        [fitness[~backward], fitness[backward]],
        bins=list(locator.tick_values(fitness.min(), fitness.max())),
        stacked=True,
        label=[f"{(~backward).sum()} forward", f"{backward.sum()} backward"],
        color=[OKABE_ITO["blue"], OKABE_ITO["orange"]],
        hatch=["", "//"],
        edgecolor="white",
        linewidth=0.6,
    )
    panel.set(xlabel="fitness", ylabel="gaits", xmargin=0.02)
    panel.yaxis.set_major_locator(MaxNLocator(integer=True))
    panel.grid(visible=False, axis="x")
    legend_below(page, {}, *panel.get_legend_handles_labels()[0])
    failed = len(initial) - len(walked)
    title = f"Fitness of the initial gaits of trial {trial}"
    return titled(page, title + (f"; {failed} failed" if failed else ""))


@figure_function
def fitness_of_trials(run: Run) -> Drawn:
    """Fitness over evaluations.

    It is the mean of each trial's population, or the best if the optimiser reports no mean. With
    four trials or more, the trials that end fittest and least fit are dark, the others grey. Blue:
    median and quartiles over trials. A finished trial keeps its last value in the quartiles."""
    kind = "mean" if "mean_fitness" in run.iterations else "best"
    # The mean of a last iteration that the budget has cut would be over few gaits.
    rows = run.iterations
    sizes = rows.groupby("trial")["evaluations"].diff()
    is_cut = sizes < sizes.groupby(rows["trial"]).shift()
    whole = rows[rows.duplicated("trial", keep="last") | ~is_cut]
    table = whole.pivot(index="evaluations", columns="trial", values=f"{kind}_fitness")
    table = table.dropna(axis="columns", how="all")
    page = page_of(height_in=3.6)
    panel = page.subplots()
    ends = table.ffill().iloc[-1].sort_values(ascending=False)
    looks = {trial: line_style(series) for series, trial in enumerate(ends.index)}
    if len(ends) >= _SEVERAL:
        looks = {ends.index[0]: _FITTEST, ends.index[-1]: _LEAST_FIT}
    for trial in table:
        series = table[trial].dropna()
        # A dot at the end makes even a line of one point visible.
        dot: Any = {"marker": "o", "markersize": 3.0, "markevery": [-1]}
        panel.plot(series.index, series, label=f"trial {trial}", **looks.get(trial, _TRIAL), **dot)
    legend = {f"trial {trial}: {fixed(ends[trial], 1)}": look for trial, look in looks.items()}
    if len(ends) >= _SEVERAL:
        ended = run.iterations.dropna(subset="stop")["trial"]
        going_on = [table[trial].last_valid_index() for trial in table if trial not in ended.values]
        # The population of a finished trial no longer changes, so it keeps its last value.
        filled = table.ffill().loc[: min(going_on, default=table.index[-1])]
        low, median, high = (filled.quantile(share, axis=1) for share in (0.25, 0.5, 0.75))
        panel.plot(filled.index, median, label="median", **_MEDIAN)
        panel.fill_between(filled.index, low, high, **_BAND)
        legend["other trials"] = _TRIAL
        legend[f"median and quartiles: {fixed(median.iloc[-1], 1)}"] = _MEDIAN
    panel.set(xlabel="evaluations", ylabel=f"{kind} fitness", xmargin=0.02)
    panel.xaxis.set_major_locator(MaxNLocator(nbins=8, steps=[1, 2, 5, 10], integer=True))
    legend_below(page, legend)
    return titled(page, f"{kind.capitalize()} fitness of each trial")
