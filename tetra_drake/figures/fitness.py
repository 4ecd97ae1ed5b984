"""Figures of a run of evolution, from its record."""

from __future__ import annotations

import math
from typing import Any

import pandas
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tetra_drake.evolution.run import Run
from tetra_drake.figures.style import (
    OKABE_ITO,
    common_style,
    figure_of,
    legend_below,
    page,
    split,
    spread,
    units_named,
    write_beside,
)
from tetra_drake.formatting import fixed
from tetra_drake.scenario.units import INCH

_TICKS = 20  # largest number of trial numbers below the axes
_SEVERAL = 4  # trials from which on quartiles are drawn

_TRIAL: Any = {"color": "0.6", "linewidth": 0.8, "linestyle": "-"}
_MEDIAN: Any = {"color": OKABE_ITO["blue"], "linewidth": 2.0, "linestyle": "-"}
_BAND: Any = {"color": OKABE_ITO["blue"], "alpha": 0.18, "linewidth": 0.0}
_NAME_HEIGHT = 0.06  # of the name of a trial, as a share of the height of the axes


def initial_extremes(run: Run) -> pandas.DataFrame:
    """Distances (in) of the fittest and the least fit initial gait of each trial.

    Index: trial. Columns: best and worst. Failed gaits are left out.
    """
    walked = run.initial().dropna(subset="fitness").sort_values(["trial", "fitness"])
    distances = walked.groupby("trial")["distance_in"]
    return pandas.DataFrame({"best": distances.last(), "worst": distances.first()})


@common_style()
def initial_distances(run: Run, *, axes: Axes | None = None, units: str = "in") -> Figure:
    """Distances of the fittest and the least fit gait of each trial's first iteration, without
    those that failed."""
    unit, width = units_named(units), 0.4
    extremes = initial_extremes(run) * INCH / unit.length
    host = page(axes, height_in=3.6)
    looks = {
        "fittest gait of a trial": {"color": OKABE_ITO["blue"]},
        "least fit gait of a trial": {"color": OKABE_ITO["orange"]},
    }
    thick: Any = {"linewidth": 6.0, "linestyle": "-", "solid_capstyle": "butt"}
    below = legend_below(host, {label: look | thick for label, look in looks.items()})
    panel = split(host, below=below)[0, 0]
    panel.bar(extremes.index - width / 2, extremes["best"], width, color=OKABE_ITO["blue"])
    panel.bar(extremes.index + width / 2, extremes["worst"], width, color=OKABE_ITO["orange"])
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
    host.set_title("Best and worst initial gait of each trial", loc="left")
    return figure_of(host)


@common_style()
def initial_fitness(run: Run, trial: int, *, axes: Axes | None = None) -> Figure:
    """Histogram of the fitness of a trial's initial gaits; those that walk backward are hatched."""
    initial = run.initial().query("trial == @trial")
    walked = initial.dropna(subset="fitness")
    fitness, backward = walked["fitness"], walked["distance_in"] < 0.0
    panel = page(axes, height_in=3.4)
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
    panel.legend(loc="best")
    failed = len(initial) - len(walked)
    title = f"Fitness of the initial gaits of trial {trial}"
    panel.set_title(title + (f"; {failed} failed" if failed else ""), loc="left")
    return figure_of(panel)


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


@common_style()
def fitness_of_trials(run: Run, *, axes: Axes | None = None) -> Figure:
    """Fitness over evaluations: the mean of each trial's population, or the best if the optimiser
    reports no mean. Grey: trials. Blue: their median, and from the lower to the upper quartile.

    A trial that has ended counts in the quartiles with its last value."""
    kind = "mean" if "mean_fitness" in run.iterations else "best"
    whole = _whole_iterations(run)
    table = whole.pivot(index="evaluations", columns="trial", values=f"{kind}_fitness")
    table = table.dropna(axis="columns", how="all")
    panel = page(axes, height_in=3.6)
    for trial in table:
        series = table[trial].dropna()
        # The dot marks the end of a line, and makes a line of one point visible.
        dot: Any = {"marker": "o", "markersize": 3.0, "markevery": [-1]}
        panel.plot(series.index, series, label=f"trial {trial}", **_TRIAL, **dot)
    ends = table.ffill().iloc[-1].sort_values().rename("trial {}".format)
    if len(ends) >= _SEVERAL:
        quartiles = quartiles_over_trials(run, table)
        panel.plot(quartiles.index, quartiles["median"], label="median", **_MEDIAN)
        panel.fill_between(quartiles.index, quartiles["low"], quartiles["high"], **_BAND)
        ends = pandas.concat([ends.iloc[[0, -1]], quartiles.iloc[-1][["median"]]])
    panel.set(xlabel="evaluations", ylabel=f"{kind} fitness", xmargin=0.02)
    panel.xaxis.set_major_locator(MaxNLocator(nbins=8, steps=[1, 2, 5, 10], integer=True))
    _name_lines(panel, ends)
    panel.set_title(f"{kind.capitalize()} fitness of each trial", loc="left")
    return figure_of(panel)


def _whole_iterations(run: Run) -> pandas.DataFrame:
    """The iterations but those that the budget of evaluations has cut short, whose mean is of few
    gaits."""
    rows = run.iterations
    sizes = rows.groupby("trial")["evaluations"].diff()
    is_last = ~rows.duplicated("trial", keep="last")
    before = sizes.groupby(rows["trial"]).shift()
    return rows[~(is_last & (sizes < before))]


def _name_lines(panel: Axes, last: pandas.Series) -> None:
    """Names lines beside the axes at their last values."""
    low, high = panel.get_ylim()
    places = spread(last.to_numpy(), _NAME_HEIGHT * (high - low))
    for (name, value), place in zip(last.items(), places, strict=True):
        colour = _MEDIAN["color"] if name == "median" else "0.35"
        write_beside(panel, place, f"{name}: {fixed(value, 1)}", color=colour)
