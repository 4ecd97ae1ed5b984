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

from tetra_drake.analysis.statistics import interquartile_mean, interval
from tetra_drake.errors import InputError
from tetra_drake.evolution.manifest import FITNESS
from tetra_drake.evolution.run import Run, load_run
from tetra_drake.files import json_number
from tetra_drake.scenario.load import differences

if TYPE_CHECKING:
    import pandas

QUARTILES = (0.25, 0.5, 0.75)

_SEARCH = ("evolution", "optimizer")
"""Sections of the scenario that say how runs search, and not for what."""


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


def compare(
    directories: Sequence[str | Path],
    *,
    reach: float | None = None,
) -> Compared:
    """Compares how runs of one objective search, finished or not.

    reach: a distance (m); the result says when it was walked.

    Raises InputError where objectives differ, a run is given twice, or one has no fitness yet.
    """
    import pandas

    runs = _labelled([load_run(directory) for directory in directories])
    notes = _differences(runs)
    draws = {label: run.manifest.scenario.draws for label, run in runs.items()}
    searches = {label: _trials(run, draws[label]) for label, run in runs.items()}
    ends = {label: _end(trials) for label, trials in searches.items()}
    common = min(ends.values())
    rows = [
        {"run": label, "trial": number, "ended": trial.ended, "cost": trial.costs[-1]}
        | {"at_common": trial.at(common), "fitness": trial.best[-1]}
        | {"distance": trial.distance[-1], "reached": trial.reached(reach)}
        for label, trials in searches.items()
        for number, trial in trials.items()
    ]
    table = pandas.DataFrame(rows)
    for label, trials in searches.items():
        if going_on := sum(not trial.ended for trial in trials.values()):
            notes.append(f"{label}: {going_on} of {len(trials)} trials go on")
        if failed := sum(np.isneginf(trial.best[-1]) for trial in trials.values()):
            notes.append(f"{label}: {failed} of {len(trials)} trials have no fitness")
    summaries = {
        label: {"draws": draws[label]}
        | _summary(table[table["run"] == label])
        | {"wall_time": run.evaluations["wall_time_s"].mean()}
        for label, run in runs.items()
    }
    curves = [_curve(t, ends[label]).assign(run=label) for label, t in searches.items()]
    return Compared(
        common=common,
        reach=reach,
        trials=table,
        curves=pandas.concat(curves, ignore_index=True),
        runs=pandas.DataFrame.from_dict(summaries, orient="index").rename_axis("run"),
        notes=notes,
    )


@dataclass(frozen=True)
class _Trial:
    """Course of a trial, after each of its evaluations; arrays of equal length."""

    costs: npt.NDArray[np.int64]
    best: npt.NDArray[np.float64]
    """Fitness, -inf until there is one."""
    distance: npt.NDArray[np.float64]
    """Distance (m) of the fittest gait so far."""
    ended: bool

    def at(self, cost: npt.ArrayLike) -> Any:
        """The best fitness at a cost; its last one from its end on."""
        place = np.searchsorted(self.costs, cost, side="right") - 1
        return np.where(place < 0, -math.inf, self.best[np.maximum(place, 0)])

    def reached(self, distance: float | None) -> float:
        """The cost of the first fittest so far that walks a distance; infinite if none does."""
        there = self.costs[self.distance >= (math.inf if distance is None else distance)]
        return float(there[0]) if len(there) else math.inf


def _trials(run: Run, cost: int) -> dict[int, _Trial]:
    """The trials that have begun, by their numbers; `cost`: of an evaluation."""
    run.fittest()  # raises InputError if there is none
    trials = {}
    for number, rows in run.evaluations.groupby("trial"):
        fitness = rows["fitness"].fillna(-math.inf).to_numpy()
        best = np.maximum.accumulate(fitness)
        fittest = np.maximum.accumulate(np.where(_rises(best), np.arange(len(best)), 0))
        distance = np.where(np.isfinite(best), rows["distance"].to_numpy()[fittest], math.nan)
        costs = cost * np.arange(1, len(best) + 1)
        ended = run.statuses[int(number)].stop is not None
        trials[int(number)] = _Trial(costs, best, distance, ended)
    return trials


def _rises(best: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
    """Indices at which the best gait so far is a new one, as the first always is."""
    return np.r_[True, best[1:] > best[:-1]]


def _end(trials: Mapping[int, _Trial]) -> int:
    """Cost at which a run's curve ends."""
    going_on = [int(trial.costs[-1]) for trial in trials.values() if not trial.ended]
    return min(going_on) if going_on else max(int(t.costs[-1]) for t in trials.values())


def _curve(trials: Mapping[int, _Trial], end: int) -> pandas.DataFrame:
    """The quartiles over the trials where they rise, and at the end."""
    import pandas

    rises = [trial.costs[_rises(trial.best)] for trial in trials.values()]
    costs = np.unique(np.concatenate([*rises, [end]]))
    costs = costs[costs <= end]
    quartiles = _quartiles(np.array([trial.at(costs) for trial in trials.values()]))
    values = dict(zip(("low", "median", "high"), quartiles, strict=True))
    return pandas.DataFrame({"cost": costs} | values)


def _quartiles(values: npt.NDArray[np.float64]) -> list[npt.NDArray[np.float64]]:
    """Quantiles of each column (or of one), of infinite values, too."""
    ordered = np.sort(values, axis=0)
    places = [share * (len(values) - 1) for share in QUARTILES]
    around = [(ordered[math.floor(p)], ordered[math.ceil(p)], p % 1.0) for p in places]
    return [(1.0 - w) * low + w * high if w else low for low, high, w in around]


def _summary(trials: pandas.DataFrame) -> dict[str, Any]:
    """A run's columns of Compared.runs, from its trials."""
    row: dict[str, Any] = {"trials": len(trials), "going_on": int((~trials["ended"]).sum())}
    row["cost"] = trials["cost"].median()
    for name in ("at_common", "fitness", "distance"):
        values = trials[name].replace(-math.inf, math.nan).dropna()
        low, high = interval(values, interquartile_mean)
        mean = float(interquartile_mean(values)) if len(values) else math.nan
        row |= {name: values.median(), f"{name}_mean": mean}
        row |= {f"{name}_low": low, f"{name}_high": high}
    quartiles = _quartiles(trials["reached"].to_numpy())
    row |= dict(zip(("reached_low", "reached", "reached_high"), quartiles, strict=True))
    return row | {"share": float(np.isfinite(trials["reached"]).mean())}


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
        ours, theirs = _objective(run), _objective(base)
        if ours != theirs:
            problem = f"is not that of {first}, and fitnesses of different objectives say nothing"
            raise InputError(run.directory, "objective", f"{problem} about each other")
        changed = [
            f"{key} {value}"
            for key, value in differences(run.manifest.scenario, base.manifest.scenario)
            if key.split(".")[0] not in _SEARCH
        ]
        if changed:
            notes.append(
                f"{label} has not only its search other than {first}: {', '.join(changed)}"
            )
    return notes


def _objective(run: Run) -> tuple[str, Mapping[str, float]]:
    name, terms = run.manifest.method.objective, run.manifest.scenario.objective
    return name, terms if name == FITNESS else {}


def comparison_numbers(compared: Compared) -> dict[str, Any]:
    """The content of summary.json, lengths in m; null for what is infinite or unknown."""
    rows = compared.runs.reset_index().to_dict("records")
    return {
        "common": compared.common,
        "reach": compared.reach,
        "notes": compared.notes,
        "runs": [{key: json_number(value) for key, value in row.items()} for row in rows],
    }
