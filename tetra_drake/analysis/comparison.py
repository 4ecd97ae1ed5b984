"""Comparison of searches: the best of their trials against their cost.

Costs are numbers of simulations: an evaluation has one in each draw of disturbances.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from tetra_drake.analysis.statistics import interquartile_mean, interval, json_rows
from tetra_drake.errors import InputError
from tetra_drake.evolution.manifest import FITNESS
from tetra_drake.evolution.run import Run, load_run

if TYPE_CHECKING:
    import pandas

QUARTILES = (0.25, 0.5, 0.75)

# Sections of the scenario that say how runs search, and not for what.
_SEARCH = ("evolution", "optimizer")


_TRIAL_COLUMNS = ["run", "trial", "ended", "cost", "at_common", "fitness", "distance", "reached"]


@dataclass(frozen=True)
class Compared:
    """Result of compare(). All runs maximise fitness, so fitness is compared."""

    common: int
    """Cost at which the cheapest run ends."""
    reach: float | None
    """The distance (m) to be reached by the fittest gait so far."""
    trials: pandas.DataFrame
    """A row per trial that has begun: run, trial, ended, cost, at_common and fitness (the best so
    far there and at the trial's end, -inf where there is none), distance (m, of the fittest),
    reached (cost of the first fittest so far that walks `reach`; infinite where none does)."""
    curves: pandas.DataFrame
    """The best fitness so far, where it rises: run, cost, low, median, high (QUARTILES over the
    trials). A trial that has ended goes on with its last value; the curve ends where the first
    trial does that has not, else with the longest."""
    runs: pandas.DataFrame
    """A row per run: trials, going_on, draws, cost (median over trials); at_common, fitness and
    distance (medians over trials with a fitness), each with _mean, _low and _high (interquartile
    mean and its 95 % confidence interval); reached_low, reached and reached_high (quartiles over
    trials), share (of trials that reach it); wall_time (s, mean per evaluation)."""
    notes: list[str]
    """Notes on differences other than search, and on unfinished runs."""


def compare(directories: Sequence[str | Path], *, reach: float | None = None) -> Compared:
    """Compares how runs of one objective search, finished or not.

    reach: a distance (m); the result says when it was walked.

    Raises InputError where objectives differ, a run is given twice, or one has no fitness yet.
    """
    import pandas

    runs = _labelled([load_run(directory) for directory in directories])
    notes = _differences(runs)
    searches = {label: _progress(run) for label, run in runs.items()}
    common = min(_end(progress) for progress in searches.values())
    trials, curves, summaries = [], [], {}
    for label, progress in searches.items():
        rows = _trials(progress, common, reach)
        trials.append(rows.assign(run=label))
        curves.append(_curve(progress).assign(run=label))
        run = runs[label]
        summaries[label] = {
            "draws": run.scenario.draws,
            **_summary(rows),
            "wall_time": run.evaluations["wall_time_s"].mean(),
        }
        if going_on := summaries[label]["going_on"]:
            notes.append(f"{label}: {going_on} of {len(rows)} trials go on")
        if failed := int(np.isneginf(rows["fitness"]).sum()):
            notes.append(f"{label}: {failed} of {len(rows)} trials have no fitness")
    return Compared(
        common=common,
        reach=reach,
        trials=pandas.concat(trials, ignore_index=True)[_TRIAL_COLUMNS],
        curves=pandas.concat(curves, ignore_index=True),
        runs=pandas.DataFrame.from_dict(summaries, orient="index").rename_axis("run"),
        notes=notes,
    )


def _progress(run: Run) -> pandas.DataFrame:
    """The course of each trial, a row per evaluation: trial, ended (the trial), cost, and fitness
    and distance (m) of the trial's fittest gait so far, -inf and NaN where there is none."""
    run.fittest()  # raises InputError if there is none
    table = run.evaluations[["trial", "fitness", "distance"]].copy()
    trial = table["trial"]
    table["ended"] = trial.map({status.number: bool(status.stop) for status in run.statuses})
    table["cost"] = run.scenario.draws * (table.groupby("trial").cumcount() + 1)
    table["fitness"] = table["fitness"].fillna(-math.inf).groupby(trial).cummax()
    is_new = table["fitness"] != table["fitness"].groupby(trial).shift()
    table["distance"] = table["distance"].where(is_new).groupby(trial).ffill()
    return table


def _end(progress: pandas.DataFrame) -> int:
    """Cost at which a run's curve ends."""
    ends = progress.groupby("trial")[["cost", "ended"]].last()
    going_on = ends[~ends["ended"]]
    return int(ends["cost"].max() if going_on.empty else going_on["cost"].min())


def _trials(progress: pandas.DataFrame, common: int, reach: float | None) -> pandas.DataFrame:
    """A run's rows of Compared.trials."""
    table = progress.drop_duplicates("trial", keep="last").set_index("trial")
    at_common = progress[progress["cost"] <= common].groupby("trial")["fitness"].last()
    far = progress[progress["distance"] >= (math.inf if reach is None else reach)]
    reached = far.groupby("trial")["cost"].first().astype(float)
    table["at_common"] = at_common.reindex(table.index, fill_value=-math.inf)
    table["reached"] = reached.reindex(table.index, fill_value=math.inf)
    return table.reset_index()


def _curve(progress: pandas.DataFrame) -> pandas.DataFrame:
    """The quartiles over the trials where one of them rises, and at the end."""
    best = progress.pivot(index="cost", columns="trial", values="fitness").ffill()
    best = best.loc[: _end(progress)]
    rises = (best != best.shift()).any(axis=1)
    rises.iloc[-1] = True
    best = best[rises]
    low, median, high = _quartiles(best.to_numpy().T)
    return best.index.to_frame(index=False).assign(low=low, median=median, high=high)


def _quartiles(values: npt.NDArray[np.float64]) -> list[Any]:
    """QUARTILES of each column (or of one), linear between values as numpy's, which are NaN where
    values are infinite."""
    ordered = np.sort(values, axis=0)
    quartiles = []
    for share in QUARTILES:
        place = share * (len(values) - 1)
        quartile, weight = ordered[math.floor(place)], place % 1.0
        if weight > 0.0:
            quartile = (1.0 - weight) * quartile + weight * ordered[math.ceil(place)]
        quartiles.append(quartile)
    return quartiles


def _summary(trials: pandas.DataFrame) -> dict[str, Any]:
    """A run's columns of Compared.runs, from its trials."""
    row: dict[str, Any] = {"trials": len(trials), "going_on": int((~trials["ended"]).sum())}
    row["cost"] = trials["cost"].median()
    for name in ("at_common", "fitness", "distance"):
        values = trials[name].replace(-math.inf, math.nan).dropna()
        row[name] = values.median()
        row[f"{name}_mean"] = interquartile_mean(values) if len(values) else math.nan
        row[f"{name}_low"], row[f"{name}_high"] = interval(values, interquartile_mean)
    reached = trials["reached"].to_numpy()
    row["reached_low"], row["reached"], row["reached_high"] = _quartiles(reached)
    row["share"] = float(np.isfinite(reached).mean())
    return row


def _labelled(runs: Sequence[Run]) -> dict[str, Run]:
    """The runs by the names of their folders, by their paths where names are the same."""
    labels = [run.directory.resolve().name for run in runs]
    if len({*labels}) < len(labels):
        labels = [str(run.directory) for run in runs]
    labelled: dict[str, Run] = {}
    for label, run in zip(labels, runs, strict=True):
        if label in labelled:
            raise InputError(label, "", "is given twice, expected different runs")
        labelled[label] = run
    return labelled


def _differences(runs: Mapping[str, Run]) -> list[str]:
    """Differences from the first run beside search; InputError where the objective differs."""
    (first, base), *others = runs.items()
    notes = []
    for label, run in others:
        if _objective(run) != _objective(base):
            problem = f"is not that of {first}, and fitnesses of different objectives say nothing"
            raise InputError(run.directory, "objective", f"{problem} about each other")
        changed = [
            f"{key} {value}"
            for key, value in run.scenario.differences(base.scenario)
            if key.split(".")[0] not in _SEARCH
        ]
        if changed:
            notes.append(f"{label} differs from {first} not only in search: {', '.join(changed)}")
    return notes


def _objective(run: Run) -> tuple[str, Mapping[str, float]]:
    name, terms = run.manifest.method.objective, run.scenario.objective
    return name, terms if name == FITNESS else {}


def comparison_numbers(compared: Compared) -> dict[str, Any]:
    """The content of summary.json, lengths in m; null for what is infinite or unknown."""
    return {
        "common": compared.common,
        "reach": compared.reach,
        "notes": compared.notes,
        "runs": json_rows(compared.runs),
    }
