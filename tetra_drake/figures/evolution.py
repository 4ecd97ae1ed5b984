"""The thesis's Figures 16, 17, 22 and 23 and its Table 8: an evolution from its record."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tetra_drake import thesis
from tetra_drake.figures.style import OKABE_ITO, REFERENCE, common_style, line_style, make_figure

if TYPE_CHECKING:
    from tetra_drake.evolution.tables import Run

_WIDTH = 7.0
_LEGEND_ROWS = 14
"""Trials that one column of a legend beside the axes has room for."""

_TICKS = 20
"""Trials that have room for their numbers below the axes; bars with deviations that have some
beside each other."""

_LAST_DOT: dict[str, Any] = {"marker": "o", "markevery": [-1]}
"""Marks where a line ends, and makes one of a single point visible."""


def initial_extremes(run: Run) -> pandas.DataFrame:
    """Fittest and least fit initial gait of each trial, of those that have not failed.

    Index: trial. Columns best_distance_in and worst_distance_in.
    """
    walked = _initial(run).dropna(subset="fitness").sort_values(["trial", "fitness"])
    distances = walked.groupby("trial")["distance_in"]
    return pandas.DataFrame(
        {"best_distance_in": distances.last(), "worst_distance_in": distances.first()}
    )


@common_style()
def figure_16_initial_distances(run: Run) -> Figure:
    """How far the fittest and the least fit initial gait of each trial go.

    The thesis's Fig. 16: a pair of bars for each trial, distance in inches.
    """
    extremes = initial_extremes(run)
    duration = run.manifest.scenario.simulation.duration
    figure, panels = make_figure(width_in=_WIDTH, height_in=3.6)
    axes: Axes = panels[0, 0]
    width = 0.4
    for side, colour, rank, label in (
        (-1, "blue", "best", "fittest of a trial"),
        (1, "orange", "worst", "least fit of a trial"),
    ):
        positions = extremes.index + side * width / 2
        distances = extremes[f"{rank}_distance_in"]
        axes.bar(positions, distances, width, color=OKABE_ITO[colour], label=label)
    axes.axhline(0.0, color="black", linewidth=0.8)
    reference: dict[str, Any] = REFERENCE | {"label": "thesis, best of ten trials"}
    axes.axhline(thesis.BEST_INITIAL_DISTANCE_IN, **reference)
    axes.set_xlabel("trial")
    axes.set_ylabel(f"distance in {duration:g} s (in)")
    margin = max(0.9, 2.0 - len(extremes) / 2)  # else the bars of a single trial fill the axes
    axes.set_xlim(extremes.index.min() - margin, extremes.index.max() + margin)
    axes.set_xticks(extremes.index[:: math.ceil(len(extremes) / _TICKS)])
    axes.grid(visible=False, axis="x")
    figure.legend(loc="outside lower center", ncols=3)
    figure.suptitle(
        "Best and worst initial gait of each trial (Fig. 16)\n"
        f"best of all: {extremes['best_distance_in'].max():.1f} inches "
        f"(thesis: about {thesis.BEST_INITIAL_DISTANCE_IN:g} inches in 15 s)"
    )
    return figure


def share_backward(run: Run, trial: int) -> float:
    """The share, 0 to 1, of a trial's initial gaits that end behind their start.

    Of those that have not failed; NaN if all have.
    """
    initial = _initial(run, trial).dropna(subset="fitness")
    return float((initial["distance_in"] < 0.0).mean()) if len(initial) else math.nan


@common_style()
def figure_17_initial_fitness(run: Run, trial: int) -> Figure:
    """How the fitness of one trial's initial population is distributed.

    The thesis's Fig. 17: a histogram of gaits over fitness (in inches); those that go
    backward are told apart.
    """
    initial = _initial(run, trial)
    walked = initial.dropna(subset="fitness")
    backward = walked["distance_in"] < 0.0
    figure, panels = make_figure(width_in=_WIDTH, height_in=3.6)
    axes: Axes = panels[0, 0]
    groups = [
        ("forward", "blue", "", walked["fitness"][~backward]),
        ("backward", "orange", "//", walked["fitness"][backward]),
    ]
    axes.hist(
        [fitness for *_, fitness in groups],
        bins=_whole_bins(walked["fitness"].to_numpy()),
        stacked=True,
        label=[f"{len(fitness)} go {way}" for way, _, _, fitness in groups],
        color=[OKABE_ITO[colour] for _, colour, _, _ in groups],
        hatch=[hatch for _, _, hatch, _ in groups],
        edgecolor="white",
        linewidth=0.6,
    )
    axes.set_xlabel("fitness (in)")
    axes.set_ylabel("gaits")
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    axes.grid(visible=False, axis="x")
    axes.set_xmargin(0.02)
    axes.legend(loc="best")
    failed = len(initial) - len(walked)
    figure.suptitle(
        f"Fitness of the initial population, trial {trial} (Fig. 17)\n"
        f"{100.0 * share_backward(run, trial):.0f} % go backward "
        f"(thesis: {thesis.SHARE_BACKWARD})" + (f"; {failed} failed" if failed else "")
    )
    return figure


def mean_fitness(run: Run) -> pandas.DataFrame:
    """Mean fitness of each trial's population. Index: iteration, columns: trial.

    NaN after a trial's last iteration, and while all its population has failed; trials
    without any mean are left out.
    """
    table = run.iterations.pivot(index="iteration", columns="trial", values="mean_fitness")
    return table.dropna(axis="columns", how="all")


def average_over_trials(run: Run) -> pandas.DataFrame:
    """Mean and standard deviation over trials of their mean fitness. Index: iteration.

    A trial that has ended counts with its last mean fitness, as its population stays what it
    is. Where a trial still goes on, the average ends, so that it is of the same trials
    throughout.
    """
    table = mean_fitness(run)
    stops = run.iterations.dropna(subset="stop").set_index("trial")["stop"]
    ended = [trial for trial in table if trial in stops.index]
    going_on = [table[trial].last_valid_index() for trial in table if trial not in stops.index]
    table[ended] = table[ended].ffill()
    table = table.loc[: min(going_on, default=table.index[-1])]
    return pandas.DataFrame({"mean": table.mean(axis=1), "deviation": table.std(axis=1)})


@common_style()
def figure_22_mean_fitness(run: Run) -> Figure:
    """How the mean fitness of each trial's population rises.

    The thesis's Fig. 22: a line for each trial over iterations, fitness in inches. The
    legend names them in the order in which they end, fittest first.
    """
    table = mean_fitness(run)
    figure, panels = make_figure(width_in=_WIDTH, height_in=4.0)
    axes: Axes = panels[0, 0]
    for trial in _by_last_value(table):
        series = table[trial].dropna()
        axes.plot(series.index, series, label=f"trial {trial}", **line_style(trial), **_LAST_DOT)
    _label_iterations(axes, table)
    columns = math.ceil(table.shape[1] / _LEGEND_ROWS)
    figure.legend(loc="outside right center", ncols=columns, handlelength=3.2)
    rises = (table.ffill().iloc[-1] > table.bfill().iloc[0]).sum()
    figure.suptitle(
        "Mean fitness of each trial (Fig. 22)\n"
        f"it rises in {rises} of {table.shape[1]} (thesis: in all ten)"
    )
    return figure


@common_style()
def figure_23_best_worst_average(run: Run) -> Figure:
    """Mean fitness of the best and the worst trial and the average of all.

    The thesis's Fig. 23: over iterations, fitness in inches, with the standard deviation
    over trials as bars. Best and worst are told by the last mean fitness.
    """
    table = mean_fitness(run)
    ranked = _by_last_value(table)
    figure, panels = make_figure(width_in=_WIDTH, height_in=4.0)
    axes: Axes = panels[0, 0]
    lines = [(ranked[0], "best", {"color": OKABE_ITO["blue"], "linestyle": "-"})]
    note = "there is one trial only"
    if len(ranked) > 1:
        _plot_average(axes, average_over_trials(run), trials=len(ranked))
        lines.append((ranked[-1], "worst", {"color": OKABE_ITO["vermillion"], "linestyle": "--"}))
        note = "trials that have ended count in the average with their last mean fitness"
    for trial, rank, style in lines:
        series = table[trial].dropna()
        look: dict[str, Any] = style | _LAST_DOT | {"linewidth": 1.8}
        axes.plot(series.index, series, label=f"{rank}, trial {trial}", **look)
    _label_iterations(axes, table)
    axes.legend(loc="lower right", handlelength=3.6)
    figure.suptitle(f"Mean fitness: best trial, worst trial and average (Fig. 23)\n{note}")
    return figure


def table_8_two_best(run: Run, trial: int) -> pandas.DataFrame | None:
    """How far apart the two fittest different gaits of a trial's last population are.

    The thesis's Table 8. Index: fitness, w1, w2 ..., tau_A, tau_B (fitness in inches, times in
    s). Columns best, second, difference (absolute) and thesis (NaN for a robot of another
    size). None if there are no two such gaits.
    """
    pair = run.best(2).query("trial == @trial")
    if len(pair) < 2:
        return None
    rows = zip(pair["fitness"], pair["index"], strict=True)
    best, second = (np.array([fitness, *run.vector(trial, i)]) for fitness, i in rows)
    weights = len(best) - 3
    theirs = [thesis.TWO_BEST_FITNESS, *thesis.TWO_BEST_WEIGHTS, *2 * [thesis.TWO_BEST_TAU_S]]
    names = ["fitness", *(f"w{i}" for i in range(1, weights + 1)), "tau_A", "tau_B"]
    return pandas.DataFrame(
        {
            "best": best,
            "second": second,
            "difference": np.abs(best - second),
            "thesis": theirs if len(theirs) == len(names) else math.nan,
        },
        index=pandas.Index(names, name="parameter"),
    )


def _initial(run: Run, trial: int | None = None) -> pandas.DataFrame:
    initial = run.evaluations[run.evaluations["iteration"] == 0]
    return initial if trial is None else initial[initial["trial"] == trial]


def _whole_bins(values: np.ndarray) -> list[float]:
    """Bin edges at round numbers, zero among them where the values pass it; about 20 bins."""
    locator = MaxNLocator(nbins=20, steps=[1, 2, 2.5, 5, 10])
    return list(locator.tick_values(values.min(), values.max()))


def _by_last_value(table: pandas.DataFrame) -> list[int]:
    """The trials, that with the highest last mean fitness first."""
    last = table.ffill().iloc[-1]
    return [int(trial) for trial in last.sort_values(ascending=False, kind="stable").index]


def _plot_average(axes: Axes, average: pandas.DataFrame, *, trials: int) -> None:
    axes.errorbar(
        average.index,
        average["mean"],
        yerr=average["deviation"],
        errorevery=math.ceil(len(average) / _TICKS),
        color=OKABE_ITO["black"],
        linestyle=(0, (1.2, 1.2)),
        elinewidth=0.7,
        capsize=2.0,
        label=f"average of {trials} trials, with standard deviation",
    )


def _label_iterations(axes: Axes, table: pandas.DataFrame) -> None:
    axes.set_xlabel("iteration")
    axes.set_ylabel("mean fitness of the population (in)")
    axes.set_xmargin(0.02)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
