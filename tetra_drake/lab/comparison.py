"""Comparison of runs: the best fitness of their trials against the cost of the search.

The cost is the number of simulations. An evaluation costs one simulation per draw of disturbances.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas
from matplotlib import rcParams
from matplotlib.ticker import FixedLocator, NullFormatter, StrMethodFormatter

from tetra_drake.errors import InputError, check_type
from tetra_drake.evolution.manifest import FITNESS, read_manifest
from tetra_drake.evolution.run import Run, load_run
from tetra_drake.figures.style import (
    AS_USUAL,
    Drawn,
    Look,
    Print,
    figure_function,
    folded,
    legend_below,
    line_style,
    name_panel,
    page_of,
    page_width,
    titled,
)
from tetra_drake.formatting import TextTable, fixed, ranged, render, rounded
from tetra_drake.lab.page import save_findings
from tetra_drake.lab.study.statistics import (
    interquartile_mean,
    interval,
    interval_of_resamples,
    json_rows,
    resampled,
)
from tetra_drake.scenario.metrics import UNITS, inverse
from tetra_drake.scenario.scenario import Scenario

_FIRST = 10  # simulations; the axes of costs begin here
_NEVER = 1e18  # simulations, in place of infinitely many
_BESIDE = 5.5  # least width (in) of two panels side by side, with letters of the usual size


@dataclass(frozen=True)
class Compared:
    """Comparison of evolution runs, as compare() returns it: tables of trials, of curves of the
    best fitness over cost, and of runs. Cost is the number of simulations."""

    scenario: Scenario
    """Scenario of the first run."""
    objective: str
    """What fitness is: weights by metric, or the name of an objective from Python."""
    common: int
    """Cost, in simulations, at which the shortest curve ends. All runs have a fitness at this
    cost."""
    reach: float | None
    """Distance (m) for the columns `reached`; None if compare() got none."""
    trials: pandas.DataFrame
    """A row per trial with evaluations. Columns:

    - run, trial, ended (True if the trial is finished), cost
    - at_common: best fitness at the cost `common`; -inf if all gaits failed
    - fitness: best fitness at the end; -inf if all gaits failed
    - distance (m): distance of the fittest gait
    - reached: cost at which the fittest gait so far walks `reach`; infinite if none does
    """
    curves: pandas.DataFrame
    """Best fitness over cost: run, cost, mean (interquartile mean over trials), low, high (its 95 %
    confidence interval, by bootstrap); -inf as long as a trial has no fitness.

    A row is a cost at which a trial improves. A finished trial keeps its last value. The curve ends
    with the first unfinished trial, or with the longest trial if all are finished.
    """
    runs: pandas.DataFrame
    """A row per run. Columns:

    - trials, going_on: number of trials, and of unfinished trials
    - draws: simulations per evaluation; cost: median over trials
    - at_common, fitness, distance: medians over trials with a fitness; with suffix _mean the
      interquartile mean, with _low and _high its 95 % confidence interval
    - reached_low, reached, reached_high: quartiles over trials; share: share of trials that reach
      `reach`
    - wall_time: mean time per evaluation, in s
    """
    improvement: pandas.DataFrame
    """Probability of improvement, a row per pair of runs. Index: run, other. Columns:

    - probability: that a trial of `run` ends fitter than a trial of `other`; see improvement()
    - low, high: 95 % confidence interval, by bootstrap over the trials of both runs; NaN if one of
      them has a single trial
    """
    notes: list[str]
    """Notes on differences of the scenarios outside the search, and on unfinished trials."""


def compare(
    directories: Sequence[str | Path],
    *,
    reach: float | None = None,
    labels: Sequence[str] | None = None,
) -> Compared:
    """Compares evolution runs with the same objective, finished or not: the fitness that their
    trials reach, over the number of simulations.

        >>> compared = td.compare(["runs/demo", "runs/other"], reach=0.3)
        >>> compared.trials[["run", "fitness", "reached"]], compared.improvement, compared.notes

    Args:
        directories: folders of runs.
        reach: a distance (m); the result says after how many simulations a gait walked it.
        labels: a name for each run; by default the names of the folders, or the paths if two
            folders have the same name.

    Raises:
        InputError: if objectives differ, a run is given twice, or a run has no fitness yet.
    """
    _check_lists(directories, labels)
    check_type("compare", "reach", reach or 0.0, int, float)
    loaded = [load_run(directory) for directory in directories]
    names = list(labels or [run.directory.resolve().name for run in loaded])
    if not labels and len({*names}) < len(names):
        names = [str(run.directory) for run in loaded]
    for name in names:
        if names.count(name) > 1:
            raise InputError(name, "", "is given twice, expected different runs")
    runs = dict(zip(names, loaded, strict=True))
    notes = _differences(runs)
    searches = {label: _progress(run) for label, run in runs.items()}
    ends = {label: _end(progress) for label, progress in searches.items()}
    common = min(ends.values())

    trials, curves, summaries = [], [], {}
    for label, progress in searches.items():
        rows = _trials(progress, common, reach)
        trials.append(rows.assign(run=label))
        curves.append(_curve(progress, ends[label]).assign(run=label))
        summaries[label] = {"draws": runs[label].scenario.draw_count, **_summary(rows)}
        summaries[label]["wall_time"] = runs[label].evaluations["wall_time_s"].mean()
        if going_on := summaries[label]["going_on"]:
            notes.append(f"{label}: {going_on} of {len(rows)} trials go on")
        if failed := int(np.isneginf(rows["fitness"]).sum()):
            notes.append(f"{label}: {failed} of {len(rows)} trials have no fitness")

    columns = ["run", "trial", "ended", "cost", "at_common", "fitness", "distance", "reached"]
    table = pandas.concat(trials, ignore_index=True)[columns]
    first = loaded[0]
    return Compared(
        scenario=first.scenario,
        objective=_objective_text(first),
        common=common,
        reach=reach,
        trials=table,
        improvement=improvement_over([table]),
        curves=pandas.concat(curves, ignore_index=True),
        runs=pandas.DataFrame.from_dict(summaries, orient="index").rename_axis("run"),
        notes=notes,
    )


def compare_scenarios(
    directories: Sequence[str | Path],
    *,
    reach: float | None = None,
    labels: Sequence[str] | None = None,
) -> dict[str, Compared]:
    """Compares runs within each scenario: groups the folders by the name of their scenario and
    returns compare() of each group, by that name. For `reach` and `labels`, see compare().

    Raises InputError like compare(), and if no scenario has two of the runs.
    """
    _check_lists(directories, labels)
    names = pandas.Series([read_manifest(Path(each)).scenario.name for each in directories])
    if names.is_unique:
        found = f"found one run of each scenario: {', '.join(names)}"
        raise InputError("compare", "scenarios", f"{found}; expected two of one scenario at least")
    compared = {}
    for name, group in names.groupby(names, sort=False):
        own = [labels[place] for place in group.index] if labels else None
        runs = [directories[place] for place in group.index]
        compared[str(name)] = compare(runs, reach=reach, labels=own)
    return compared


def improvement(ours: npt.ArrayLike, theirs: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Probability that a number of our sample exceeds a number of their sample.

    It is the share of such pairs among all pairs. Equal numbers count one half. Samples are along
    the last axes, (..., n) and (..., m); the result has the shape (...).

    From R. Agarwal et al., "Deep reinforcement learning at the edge of the statistical precipice",
    NeurIPS 2021 (rliable).
    """
    first, second = np.asarray(ours)[..., :, np.newaxis], np.asarray(theirs)[..., np.newaxis, :]
    return np.mean((first > second) + 0.5 * (first == second), axis=(-2, -1))


def improvement_over(scenarios: Iterable[pandas.DataFrame]) -> pandas.DataFrame:
    """Mean, over several scenarios, of the probability that one run improves on another.

    It is the probability that a trial of `run` ends fitter than a trial of `other`. A pair of runs
    is averaged over the scenarios that have both. The bootstrap draws trials within each scenario.
    Returns a row per ordered pair, index (run, other): probability, and its 95 % interval low,
    high.

    Args:
        scenarios: a table of trials for each scenario, with at least the columns `run` and
            `fitness`, such as Compared.trials.
    """
    generator = np.random.default_rng(0)
    probabilities, resamples = defaultdict(list), defaultdict(list)
    for trials in scenarios:
        by_run = trials.groupby("run", sort=False)["fitness"]
        ends = {str(run): fitnesses.to_numpy() for run, fitnesses in by_run}
        drawn = {run: resampled(fitnesses, generator) for run, fitnesses in ends.items()}
        for run, other in permutations(ends, 2):
            spread = improvement(drawn[run], drawn[other])
            if min(len(ends[run]), len(ends[other])) == 1:
                spread[:] = math.nan
            probabilities[run, other].append(improvement(ends[run], ends[other]))
            resamples[run, other].append(spread)
    rows = []
    for (run, other), values in probabilities.items():
        low, high = interval_of_resamples(np.mean(resamples[run, other], axis=0))
        rows.append((run, other, float(np.mean(values)), low, high))
    columns = ["run", "other", "probability", "low", "high"]
    return pandas.DataFrame(rows, columns=columns).set_index(["run", "other"])


def _check_lists(directories: Sequence[str | Path], labels: Sequence[str] | None) -> None:
    check_type("compare", "directories", directories, list, tuple)
    check_type("compare", "labels", labels or [], list, tuple)
    if not directories:
        raise InputError("compare", "directories", "found none, expected a run at least")
    if labels and len(labels) != len(directories):
        raise InputError("compare", "labels", f"found {len(labels)}, expected {len(directories)}")


def _progress(run: Run) -> pandas.DataFrame:
    """Progress of each trial, a row per evaluation: trial, ended (True if the trial is finished),
    cost (simulations so far), fitness and distance (m) of the trial's fittest gait so far. Before
    the first gait that does not fail, fitness is -inf and distance is NaN."""
    run.fittest()  # raises InputError if there is none
    table = run.evaluations[["trial", "fitness", "distance"]].copy()
    trial = table["trial"]
    table["ended"] = trial.map({status.number: bool(status.stop) for status in run.statuses})
    table["cost"] = run.scenario.draw_count * (table.groupby("trial").cumcount() + 1)
    table["fitness"] = table["fitness"].fillna(-math.inf).groupby(trial).cummax()
    is_new = table["fitness"] != table["fitness"].groupby(trial).shift()
    table["distance"] = table["distance"].where(is_new).groupby(trial).ffill()
    return table


def _end(progress: pandas.DataFrame) -> int:
    """Cost (simulations) at which a run's curve ends: where the first unfinished trial stands now,
    or the end of the longest trial if all are finished."""
    ends = progress.groupby("trial")[["cost", "ended"]].last()
    going_on = ends[~ends["ended"]]
    return int(ends["cost"].max() if going_on.empty else going_on["cost"].min())


def _trials(progress: pandas.DataFrame, common: int, reach: float | None) -> pandas.DataFrame:
    """The rows of Compared.trials for one run, from the table of _progress(): one per trial, with
    the best fitness at the cost `common` and the cost at which a gait walks `reach` (m)."""
    table = progress.drop_duplicates("trial", keep="last").set_index("trial")
    at_common = progress[progress["cost"] <= common].groupby("trial")["fitness"].last()
    far = progress[progress["distance"] >= (math.inf if reach is None else reach)]
    reached = far.groupby("trial")["cost"].first().astype(float)
    table["at_common"] = at_common.reindex(table.index, fill_value=-math.inf)
    table["reached"] = reached.reindex(table.index, fill_value=math.inf)
    return table.reset_index()


def _curve(progress: pandas.DataFrame, end: int) -> pandas.DataFrame:
    """Interquartile mean over the trials of the best fitness so far, with its interval: a row
    (cost, mean, low, high) for each cost at which a trial improves, and for the cost `end`. Input:
    the table of _progress()."""
    best = progress.pivot(index="cost", columns="trial", values="fitness").ffill().loc[:end]
    rises = (best != best.shift()).any(axis=1)
    rises.iloc[-1] = True
    best = best[rises]
    values, unknown = best.to_numpy(), (-math.inf, -math.inf)
    low, high = np.transpose(
        [interval(x, interquartile_mean) if np.isfinite(x).all() else unknown for x in values]
    )
    mean = interquartile_mean(values, axis=1)
    return best.index.to_frame(index=False).assign(mean=mean, low=low, high=high)


def _summary(trials: pandas.DataFrame) -> dict[str, Any]:
    """The row of Compared.runs for one run, by column: medians, means and intervals of its trials.
    Input: the table of _trials()."""
    going_on, cost = int((~trials["ended"]).sum()), trials["cost"].median()
    row: dict[str, Any] = {"trials": len(trials), "going_on": going_on, "cost": cost}
    for name in ("at_common", "fitness", "distance"):
        values = trials[name].replace(-math.inf, math.nan).dropna()
        row[name] = values.median()
        row[f"{name}_mean"] = interquartile_mean(values) if len(values) else math.nan
        row[f"{name}_low"], row[f"{name}_high"] = interval(values, interquartile_mean)
    reached = trials["reached"].to_numpy()
    # Between infinite numbers NumPy interpolates to NaN.
    quartiles = np.quantile(reached.clip(max=_NEVER), [0.25, 0.5, 0.75])
    quartiles[quartiles > 0.1 * _NEVER] = math.inf
    row["reached_low"], row["reached"], row["reached_high"] = quartiles
    row["share"] = float(np.isfinite(reached).mean())
    return row


def _objective_text(run: Run) -> str:
    """What the fitness of a run is, such as "distance: 1 /in"; weights are in the run's units."""
    if run.manifest.method.objective != FITNESS:
        return run.manifest.method.objective
    units, objective = run.scenario.units, run.scenario.objective.items()
    return ", ".join(f"{name}: {units.shown(x, inverse(UNITS[name]))}" for name, x in objective)


def _differences(runs: Mapping[str, Run]) -> list[str]:
    """Notes on runs whose scenario differs from the first run's in more than the settings of the
    search (evolution, optimizer). `runs` are by their labels. Raises InputError if objectives
    differ."""
    notes, objectives = [], []
    (first, base), *_ = runs.items()
    for label, run in runs.items():
        name = run.manifest.method.objective
        objectives.append((name, run.scenario.objective if name == FITNESS else {}))
        if objectives[-1] != objectives[0]:
            problem = f"differs from {first}; fitnesses of different objectives cannot be compared"
            raise InputError(run.directory, "objective", problem)
        # Sections that say how a run searches, not for which gaits, may differ.
        changed = [
            f"{key} {value}"
            for key, value in run.scenario.differences(base.scenario)
            if key.split(".")[0] not in ("evolution", "optimizer")
        ]
        if changed:
            notes.append(f"{label} differs from {first} not only in search: {', '.join(changed)}")
    return notes


def comparison_text(compared: Compared) -> str:
    """Text for the terminal: tables of the fitnesses and distances of compared runs."""
    units, reach = compared.scenario.units, compared.reach
    fitness_headings = ["run", "trials", "simulations", f"after {compared.common}", "at the end"]
    distance_headings = ["run", "distance", "s per evaluation"]
    shown = "" if reach is None else units.shown(reach, "m")
    if shown:
        distance_headings += [f"simulations to {shown}", "trials that reach it"]
    fitnesses, distances = [], []
    for label, row in compared.runs.iterrows():
        common = ranged(row["at_common_mean"], row["at_common_low"], row["at_common_high"])
        end = ranged(row["fitness_mean"], row["fitness_low"], row["fitness_high"])
        fitnesses.append([str(label), f"{row['trials']:.0f}", f"{row['cost']:.0f}", common, end])
        lengths = row[["distance_mean", "distance_low", "distance_high"]] / units.length
        cells = [str(label), ranged(*lengths), rounded(row["wall_time"], 2)]
        if shown:
            costs = row[["reached", "reached_low", "reached_high"]]
            median, low, high = (f"{x:.0f}" if math.isfinite(x) else "never" for x in costs)
            of = f"{row['share'] * row['trials']:.0f} of {row['trials']:.0f}"
            cells += [f"{median} ({low} to {high})", of]
        distances.append(cells)
    return render(
        "lab/comparison.txt.jinja",
        compared=compared,
        units=units,
        fitnesses=TextTable(fitness_headings, fitnesses),
        improvement=improvement_text(compared.improvement),
        reach=shown,
        distances=TextTable(distance_headings, distances),
    )


def improvement_text(improvement: pandas.DataFrame) -> str:
    """Text for the terminal: table of the probabilities in Compared.improvement, with their
    confidence intervals."""
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
    """Writes trials.csv, curves.csv, summary.json and the figure to a folder. Lengths are in m;
    infinite and unknown numbers of the summary are null. `printed` has the look and the file types
    of the figure.

    Returns the names of the files. Raises InputError if a file cannot be written.
    """
    tables = {"trials": compared.trials, "curves": compared.curves}
    summary = {
        "common": compared.common,
        "reach": compared.reach,
        "notes": compared.notes,
        "improvement": json_rows(compared.improvement),
        "runs": json_rows(compared.runs),
    }
    figure, kinds = comparison(compared, **vars(printed.look)), printed.kinds
    return save_findings(figure, folder, "comparison", tables=tables, summary=summary, kinds=kinds)


@figure_function
def comparison(compared: Compared) -> Drawn:
    """Comparison of runs: the best fitness so far, as interquartile mean over the trials of each
    run with its 95 % confidence interval.

    If a distance to reach was given, a second panel shows the share of trials that have reached it.
    Finished trials keep their last values. A dot marks the end of a run's curve."""
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
        style: Any = line_style(series)
        style |= {"drawstyle": "steps-post", "marker": "o", "markevery": [-1]}
        curve = compared.curves.query("run == @label").replace(-math.inf, math.nan)
        curve["cost"] = curve["cost"].clip(lower=first)
        curve = curve.drop_duplicates("cost", keep="last")
        panels[0].plot(curve["cost"], curve["mean"], **style)
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
        panel.xaxis.set_major_locator(
            FixedLocator(np.outer(10.0 ** np.arange(9), ticks).ravel().tolist())
        )
        panel.xaxis.set_major_formatter(StrMethodFormatter("{x:,.0f}"))
        panel.xaxis.set_minor_formatter(NullFormatter())
    panels[0].set_ylabel("best fitness so far")
    width = 0.85 * page_width() / columns
    name_panel(panels[0], folded(f"fitness: {compared.objective}", width))
    if compared.reach is not None:
        distance = f"{compared.reach / unit.length:.4g} {unit.length_name}"
        panels[1].set(ylabel=folded(f"trials that walk {distance} (%)", 1.4), ylim=(-3.0, 103.0))
    legend_below(page, {label: line_style(series) for series, label in enumerate(labels)})
    return titled(page, "Best fitness so far: interquartile mean over trials, 95 % interval")
