"""Figures of a run of evolution, from its record."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import pandas
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tetra_drake.figures.style import (
    OKABE_ITO,
    common_style,
    draw_reference,
    line_style,
    make_figure,
)
from tetra_drake.formatting import fixed
from tetra_drake.robot.gait import ParameterSpace

if TYPE_CHECKING:
    from tetra_drake.evolution.tables import Run
    from tetra_drake.scenario.schema import ReferenceScenario

_WIDTH = 7.0
_LEGEND_ROWS = 14
"""Trials per column of a legend beside the axes."""

_TICKS = 20
"""Largest number of trial numbers below the axes, and of error bars."""


def initial_extremes(run: Run) -> pandas.DataFrame:
    """Distances (in) of the fittest and the least fit initial gait of each trial.

    Index: trial. Columns: best and worst. Failed gaits are left out.
    """
    walked = run.initial().dropna(subset="fitness").sort_values(["trial", "fitness"])
    distances = walked.groupby("trial")["distance_in"]
    return pandas.DataFrame({"best": distances.last(), "worst": distances.first()})


@common_style()
def initial_distances(run: Run, reference: ReferenceScenario | None = None) -> Figure:
    """Distances of the fittest and the least fit initial gait of each trial; no failed gaits."""
    extremes = initial_extremes(run)
    figure, axes = _axes(height_in=3.6)
    width = 0.4
    for side, colour, column, label in (
        (-1, "blue", "best", "fittest of a trial"),
        (1, "orange", "worst", "least fit of a trial"),
    ):
        place = extremes.index + side * width / 2
        axes.bar(place, extremes[column], width, color=OKABE_ITO[colour], label=label)
    axes.axhline(0.0, color="black", linewidth=0.8)
    draw_reference(axes, reference, "best_initial_distance")
    margin = max(0.9, 2.0 - len(extremes) / 2)  # else the bars of a single trial fill the axes
    axes.set(
        xlabel="trial",
        ylabel=f"distance in {run.manifest.scenario.simulation.duration:g} s (in)",
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
def initial_fitness(run: Run, trial: int, reference: ReferenceScenario | None = None) -> Figure:
    """Histogram of the fitness of a trial's initial gaits; those that walk backward stand out."""
    initial = run.initial().query("trial == @trial")
    walked = initial.dropna(subset="fitness")
    backward = walked["distance_in"] < 0.0
    figure, axes = _axes(height_in=3.6)
    groups = {"forward": walked["fitness"][~backward], "backward": walked["fitness"][backward]}
    # Bin edges at round numbers, zero among them where the values pass it.
    locator = MaxNLocator(nbins=20, steps=[1, 2, 2.5, 5, 10])
    axes.hist(
        list(groups.values()),
        bins=list(locator.tick_values(walked["fitness"].min(), walked["fitness"].max())),
        stacked=True,
        label=[f"{len(fitness)} walk {way}" for way, fitness in groups.items()],
        color=[OKABE_ITO["blue"], OKABE_ITO["orange"]],
        hatch=["", "//"],
        edgecolor="white",
        linewidth=0.6,
    )
    axes.set(xlabel="fitness", ylabel="gaits", xmargin=0.02)
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    axes.grid(visible=False, axis="x")
    axes.legend(loc="best")
    failed = len(initial) - len(walked)
    theirs = reference.share_backward if reference else ""
    figure.suptitle(
        f"Fitness of the initial population, trial {trial}\n"
        f"{fixed(100.0 * float(backward.mean()), 0)} % walk backward"
        + (f" ({reference.source}: {theirs})" if reference and theirs else "")
        + (f"; {failed} failed" if failed else "")
    )
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
    figure, axes = _axes(height_in=4.0)
    for trial in table.ffill().iloc[-1].sort_values(ascending=False, kind="stable").index:
        series = table[trial].dropna()
        # The dot marks the end of a line, and makes a line of one point visible.
        dot: Any = {"marker": "o", "markevery": [-1]}
        axes.plot(series.index, series, label=f"trial {trial}", **line_style(trial), **dot)
    if table.shape[1] > 1:
        average = average_over_trials(run, table)
        axes.errorbar(
            average.index,
            average["mean"],
            yerr=average["deviation"],
            errorevery=math.ceil(len(average) / _TICKS),
            color="0.45",
            linestyle="-",
            linewidth=2.5,
            elinewidth=0.7,
            capsize=2.0,
            label="average",
        )
    axes.set(xlabel="iteration", ylabel=f"{kind} fitness", xmargin=0.02)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    columns = math.ceil((table.shape[1] + 1) / _LEGEND_ROWS)
    figure.legend(loc="outside right center", ncols=columns, handlelength=3.2)
    rises = (table.ffill().iloc[-1] > table.bfill().iloc[0]).sum()
    figure.suptitle(f"Fitness of each trial\nrises in {rises} of {table.shape[1]}")
    return figure


def two_best(
    run: Run, trial: int, reference: ReferenceScenario | None = None
) -> pandas.DataFrame | None:
    """The two fittest different gaits of a trial. Index: fitness and the names of the parameters.

    Columns: best, second, difference (absolute) and, where there is a reference with as many
    parameters, reference. None if there are no two such gaits.
    """
    pair = run.best(2).query("trial == @trial")
    if len(pair) < 2:
        return None
    rows = zip(pair["fitness"], pair["index"], strict=True)
    best, second = ([fitness, *run.vector(trial, index)] for fitness, index in rows)
    names = ["fitness", *ParameterSpace.of(run.manifest.scenario).names]
    table = pandas.DataFrame({"best": best, "second": second}, index=pandas.Index(names))
    table["difference"] = (table["best"] - table["second"]).abs()
    if reference is not None and len(reference.two_best_weights) == len(table) - 3:
        taus = 2 * [reference.two_best_tau]
        table["reference"] = [reference.two_best_fitness, *reference.two_best_weights, *taus]
    return table.rename_axis("parameter")


def _axes(*, height_in: float) -> tuple[Figure, Axes]:
    figure, panels = make_figure(width_in=_WIDTH, height_in=height_in)
    return figure, panels[0, 0]
