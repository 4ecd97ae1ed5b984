"""Figures of a run of evolution, from its record."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import pandas
from matplotlib.ticker import MaxNLocator

from tetra_drake.evolution.run import Run
from tetra_drake.figures.style import (
    OKABE_ITO,
    Drawn,
    Page,
    figure_function,
    legend_below,
    line_style,
    page_of,
    set_title,
    units_named,
)
from tetra_drake.formatting import fixed
from tetra_drake.scenario.units import INCH

_TICKS = 20  # largest number of trial numbers below the axes
_SEVERAL = 4  # trials from which on quartiles are drawn

_TRIAL: Any = {"color": "0.7", "linewidth": 0.8, "linestyle": "-"}
_MEDIAN: Any = {"color": OKABE_ITO["blue"], "linewidth": 2.0, "linestyle": "-"}
_FITTEST: Any = {"color": "0.2", "linewidth": 1.0, "linestyle": "-"}
_LEAST_FIT: Any = {"color": "0.2", "linewidth": 1.0, "linestyle": (0, (4, 2))}
_BAND: Any = {"color": OKABE_ITO["blue"], "alpha": 0.18, "linewidth": 0.0}


def initial_extremes(run: Run) -> pandas.DataFrame:
    """Distances (in) of the fittest and the least fit initial gait of each trial.

    Index: trial. Columns: best and worst. Failed gaits are left out.
    """
    walked = run.initial().dropna(subset="fitness").sort_values(["trial", "fitness"])
    distances = walked.groupby("trial")["distance_in"]
    return pandas.DataFrame({"best": distances.last(), "worst": distances.first()})


@figure_function
def initial_distances(run: Run, *, figure: Page | None = None, units: str = "in") -> Drawn:
    """Distances of the fittest and the least fit gait of each trial's first iteration, without
    those that failed."""
    unit, width = units_named(units), 0.4
    extremes = initial_extremes(run) * INCH / unit.length
    page = page_of(figure, height_in=3.6)
    panel = page.subplots()
    blue, orange = OKABE_ITO["blue"], OKABE_ITO["orange"]
    best = panel.bar(extremes.index - width / 2, extremes["best"], width, color=blue)
    worst = panel.bar(extremes.index + width / 2, extremes["worst"], width, color=orange)
    panel.axhline(0.0, color="black", linewidth=0.8)
    margin = max(0.9, 2.0 - len(extremes) / 2)  # else the bars of a single trial fill the axes
    duration = run.scenario.simulation.duration
    panel.set(
        xlabel="trial",
        ylabel=f"distance in {duration:g} s ({unit.length_name})",
        xlim=(extremes.index.min() - margin, extremes.index.max() + margin),
        xticks=extremes.index[:: math.ceil(len(extremes) / _TICKS)],
    )
    panel.grid(visible=False, axis="x")
    best.set_label("fittest gait of a trial")
    worst.set_label("least fit gait of a trial")
    legend_below(page, {}, best, worst)
    set_title(page, "Best and worst initial gait of each trial")
    return page


@figure_function
def initial_fitness(run: Run, trial: int, *, figure: Page | None = None) -> Drawn:
    """Histogram of the fitness of a trial's initial gaits; those that walk backward are hatched."""
    initial = run.initial().query("trial == @trial")
    walked = initial.dropna(subset="fitness")
    fitness, backward = walked["fitness"], walked["distance_in"] < 0.0
    page = page_of(figure, height_in=3.6)
    panel = page.subplots()
    # Bin edges at round numbers, zero among them where the values pass it.
    locator = MaxNLocator(nbins=20, steps=[1, 2, 2.5, 5, 10])
    panel.hist(
        [fitness[~backward], fitness[backward]],
        bins=list(locator.tick_values(fitness.min(), fitness.max())),
        stacked=True,
        label=[f"{(~backward).sum()} walk forward", f"{backward.sum()} walk backward"],
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
    set_title(page, title + (f"; {failed} failed" if failed else ""))
    return page


def quartiles_over_trials(run: Run, fitness: pandas.DataFrame) -> pandas.DataFrame:
    """Quartiles over the trials, columns of `fitness`: low, median, high. Index: evaluations.

    A trial that has ended counts with its last value, as its population no longer changes; the
    quartiles end where the first unfinished trial does.
    """
    ended = run.iterations.dropna(subset="stop")["trial"]
    going_on = [fitness[t].last_valid_index() for t in fitness if t not in ended.values]
    table = fitness.ffill().loc[: min(going_on, default=fitness.index[-1])]
    shares = {"low": 0.25, "median": 0.5, "high": 0.75}
    return pandas.DataFrame({name: table.quantile(q, axis=1) for name, q in shares.items()})


@figure_function
def fitness_of_trials(run: Run, *, figure: Page | None = None) -> Drawn:
    """Fitness over evaluations: the mean of each trial's population, or the best if the optimiser
    reports no mean. Four trials or more are grey, but the fittest and the least fit. Blue: their
    median, and from the lower to the upper quartile.

    A trial that has ended counts in the quartiles with its last value."""
    kind = "mean" if "mean_fitness" in run.iterations else "best"
    whole = _whole_iterations(run)
    table = whole.pivot(index="evaluations", columns="trial", values=f"{kind}_fitness")
    table = table.dropna(axis="columns", how="all")
    page = page_of(figure, height_in=3.6)
    panel = page.subplots()
    ends = table.ffill().iloc[-1].sort_values(ascending=False)
    looks = _looks(list(ends.index))
    for trial in table:
        series = table[trial].dropna()
        # The dot marks the end of a line, and makes a line of one point visible.
        dot: Any = {"marker": "o", "markersize": 3.0, "markevery": [-1]}
        panel.plot(series.index, series, label=f"trial {trial}", **looks.get(trial, _TRIAL), **dot)
    legend = {f"trial {trial}: {fixed(ends[trial], 1)}": look for trial, look in looks.items()}
    if len(ends) >= _SEVERAL:
        quartiles = quartiles_over_trials(run, table)
        panel.plot(quartiles.index, quartiles["median"], label="median", **_MEDIAN)
        panel.fill_between(quartiles.index, quartiles["low"], quartiles["high"], **_BAND)
        legend[f"median: {fixed(quartiles['median'].iloc[-1], 1)}"] = _MEDIAN
    panel.set(xlabel="evaluations", ylabel=f"{kind} fitness", xmargin=0.02)
    panel.xaxis.set_major_locator(MaxNLocator(nbins=8, steps=[1, 2, 5, 10], integer=True))
    legend_below(page, legend)
    set_title(page, f"{kind.capitalize()} fitness of each trial")
    return page


def _looks(trials: Sequence[int]) -> dict[int, Any]:
    """Line styles of the trials that the legend names, the fittest first."""
    if len(trials) < _SEVERAL:
        return {trial: line_style(place) for place, trial in enumerate(trials)}
    return {trials[0]: _FITTEST, trials[-1]: _LEAST_FIT}


def _whole_iterations(run: Run) -> pandas.DataFrame:
    """The iterations but those that the budget of evaluations has cut short, whose mean is of few
    gaits."""
    rows = run.iterations
    sizes = rows.groupby("trial")["evaluations"].diff()
    is_last = ~rows.duplicated("trial", keep="last")
    before = sizes.groupby(rows["trial"]).shift()
    return rows[~(is_last & (sizes < before))]
