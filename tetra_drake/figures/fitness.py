"""Figures of a run of evolution, from its record."""

from __future__ import annotations

import math
from typing import Any

import pandas
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tetra_drake.evolution.run import Run
from tetra_drake.figures.style import OKABE_ITO, common_style, line_style, make_figure
from tetra_drake.formatting import fixed

_LEGEND_ROWS = 14  # trials per column of a legend beside the axes
_TICKS = 20  # largest number of trial numbers below the axes, and of error bars
_AVERAGE: Any = {"color": "0.45", "linewidth": 2.5, "elinewidth": 0.7, "capsize": 2.0}


def initial_extremes(run: Run) -> pandas.DataFrame:
    """Distances (in) of the fittest and the least fit initial gait of each trial.

    Index: trial. Columns: best and worst. Failed gaits are left out.
    """
    walked = run.initial().dropna(subset="fitness").sort_values(["trial", "fitness"])
    distances = walked.groupby("trial")["distance_in"]
    return pandas.DataFrame({"best": distances.last(), "worst": distances.first()})


@common_style()
def initial_distances(run: Run) -> Figure:
    """Distances of the fittest and the least fit initial gait of each trial; no failed gaits."""
    extremes, scenario, width = initial_extremes(run), run.scenario, 0.4
    figure, [[axes]] = make_figure(width_in=7.0, height_in=3.6)
    best, worst = extremes.index - width / 2, extremes.index + width / 2
    blue, orange = OKABE_ITO["blue"], OKABE_ITO["orange"]
    axes.bar(best, extremes["best"], width, color=blue, label="fittest of a trial")
    axes.bar(worst, extremes["worst"], width, color=orange, label="least fit of a trial")
    axes.axhline(0.0, color="black", linewidth=0.8)
    margin = max(0.9, 2.0 - len(extremes) / 2)  # else the bars of a single trial fill the axes
    axes.set(
        xlabel="trial",
        ylabel=f"distance in {scenario.simulation.duration:g} s (in)",
        xlim=(extremes.index.min() - margin, extremes.index.max() + margin),
        xticks=extremes.index[:: math.ceil(len(extremes) / _TICKS)],
    )
    axes.grid(visible=False, axis="x")
    figure.legend(loc="outside lower center", ncols=2)
    figure.suptitle(
        "Best and worst initial gait of each trial\n"
        f"best of all: {fixed(extremes['best'].max(), 1)} inches"
    )
    return figure


@common_style()
def initial_fitness(run: Run, trial: int) -> Figure:
    """Histogram of the fitness of a trial's initial gaits; those that walk backward stand out."""
    initial = run.initial().query("trial == @trial")
    walked = initial.dropna(subset="fitness")
    fitness, backward = walked["fitness"], walked["distance_in"] < 0.0
    figure, [[axes]] = make_figure(width_in=7.0, height_in=3.6)
    # Bin edges at round numbers, zero among them where the values pass it.
    locator = MaxNLocator(nbins=20, steps=[1, 2, 2.5, 5, 10])
    axes.hist(
        [fitness[~backward], fitness[backward]],
        bins=list(locator.tick_values(fitness.min(), fitness.max())),
        stacked=True,
        label=[f"{(~backward).sum()} walk forward", f"{backward.sum()} walk backward"],
        color=[OKABE_ITO["blue"], OKABE_ITO["orange"]],
        hatch=["", "//"],
        edgecolor="white",
        linewidth=0.6,
    )
    axes.set(xlabel="fitness", ylabel="gaits", xmargin=0.02)
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    axes.grid(visible=False, axis="x")
    axes.legend(loc="best")
    title = f"Fitness of the initial population, trial {trial}\n"
    title += f"{fixed(100.0 * float(backward.mean()), 0)} % walk backward"
    failed = len(initial) - len(walked)
    if failed:
        title += f"; {failed} failed"
    figure.suptitle(title)
    return figure


def average_over_trials(run: Run, fitness: pandas.DataFrame) -> pandas.DataFrame:
    """Mean and standard deviation over the trials, columns of `fitness`. Index: iteration.

    A trial that has ended counts with its last value, as its population no longer changes; the
    average ends where the first unfinished trial does.
    """
    ended = run.iterations.dropna(subset="stop")["trial"]
    going_on = [fitness[t].last_valid_index() for t in fitness if t not in ended.values]
    table = fitness.ffill().loc[: min(going_on, default=fitness.index[-1])]
    return pandas.DataFrame({"mean": table.mean(axis=1), "deviation": table.std(axis=1)})


@common_style()
def fitness_of_trials(run: Run) -> Figure:
    """Mean fitness of each trial's population over iterations (best fitness where the optimiser
    reports no mean), and the average over trials with its standard deviation.

    The legend is sorted by the last values; trials that have ended count in the average with
    theirs."""
    kind = "mean" if "mean_fitness" in run.iterations else "best"
    table = run.iterations.pivot(index="iteration", columns="trial", values=f"{kind}_fitness")
    table = table.dropna(axis="columns", how="all")
    first, last = table.bfill().iloc[0], table.ffill().iloc[-1]
    figure, [[axes]] = make_figure(width_in=7.0, height_in=4.0)
    for trial in last.sort_values(ascending=False, kind="stable").index:
        series = table[trial].dropna()
        # The dot marks the end of a line, and makes a line of one point visible.
        dot: Any = {"marker": "o", "markevery": [-1]}
        axes.plot(series.index, series, label=f"trial {trial}", **line_style(trial), **dot)
    if len(last) > 1:
        average = average_over_trials(run, table)
        every = math.ceil(len(average) / _TICKS)
        mean, deviation = average["mean"], average["deviation"]
        axes.errorbar(average.index, mean, deviation, label="average", errorevery=every, **_AVERAGE)
    axes.set(xlabel="iteration", ylabel=f"{kind} fitness", xmargin=0.02)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    columns = math.ceil((len(last) + 1) / _LEGEND_ROWS)
    figure.legend(loc="outside right center", ncols=columns, handlelength=3.2)
    figure.suptitle(f"Fitness of each trial\nrises in {(last > first).sum()} of {len(last)}")
    return figure
