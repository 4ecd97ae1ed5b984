"""What came out of a run, the thesis's numbers beside it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tetra_drake import thesis
from tetra_drake.evolution.optimizers.steady_state import CHILDREN
from tetra_drake.evolution.progress import number
from tetra_drake.evolution.tables import RunTables
from tetra_drake.evolution.trial import TrialStatus

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True)
class Comparison:
    """A number of ours and what the thesis has in its place, with units."""

    name: str
    ours: str
    thesis: str


def summary(statuses: Sequence[TrialStatus]) -> str:
    """The lines printed at the end of a run. Distances are those of the fittest gaits."""
    lines = [
        f"trial {status.number}: {status.stop or 'not ended'} after iteration {status.iteration}, "
        f"{status.evaluations} evaluations, {status.failures} failed; mean fitness "
        f"{number(status.initial_mean_fitness)} -> {number(status.mean_fitness)}, best distance "
        f"{number(status.initial_best_distance_in)} -> {number(status.best_distance_in)} in"
        for status in statuses
    ]
    lines.append(f"{'':<32}{'ours':>10}{'thesis':>12}")
    lines += [f"{row.name:<32}{row.ours:>10}{row.thesis:>12}" for row in comparisons(statuses)]
    return "\n".join(lines)


def comparisons(statuses: Sequence[TrialStatus]) -> list[Comparison]:
    """The results of a run beside the thesis's. Distances are those of the fittest gaits; the
    best trial is the one with the fittest gait of all, as in the thesis (section 3.2)."""
    rises = [improvement_percent(status) for status in statuses]
    fittest = sorted(statuses, key=lambda status: status.best_fitness)[-1:]
    initial = _largest([status.initial_best_distance_in for status in statuses])
    best = _largest([status.best_distance_in for status in statuses])
    return [
        Comparison("best initial gait", f"{initial} in", f"{thesis.BEST_INITIAL_DISTANCE_IN} in"),
        Comparison("best evolved gait", f"{best} in", f"{thesis.BEST_EVOLVED_DISTANCE_IN} in"),
        Comparison(
            "improvement, mean of trials",
            f"{_mean(rises)} %",
            f"{thesis.MEAN_IMPROVEMENT_PERCENT:g} %",
        ),
        Comparison(
            "improvement, best trial",
            f"{_mean([improvement_percent(status) for status in fittest])} %",
            f"{thesis.BEST_IMPROVEMENT_PERCENT:g} %",
        ),
        Comparison(
            "simulation time per iteration",
            f"{_seconds_per_iteration(statuses)} s",
            f"{thesis.SECONDS_PER_ITERATION:g} s",
        ),
    ]


def recorded_statuses(run: RunTables) -> list[TrialStatus]:
    """Where the trials of a recorded run stand, finished or not."""
    settings = run.manifest.scenario.evolution
    statuses = [
        TrialStatus(trial, settings.population + CHILDREN * settings.max_iterations)
        for trial in range(settings.trials)
    ]
    for trial, rows in _by_trial(run.evaluations):
        statuses[trial].evaluations = statuses[trial].recalled = len(rows)
        statuses[trial].failures = int(rows["failure"].notna().sum())
        statuses[trial].wall_time = float(rows["wall_time_s"].sum())
    for trial, rows in _by_trial(run.iterations):
        status, first, last = statuses[trial], rows.iloc[0], rows.iloc[-1]
        status.iteration = int(last["iteration"])
        status.initial_mean_fitness = float(first["mean_fitness"])
        status.initial_best_distance_in = float(first["best_distance_in"])
        status.mean_fitness = float(last["mean_fitness"])
        if math.isfinite(last["best_fitness"]):
            status.best_fitness = float(last["best_fitness"])
        status.best_distance_in = float(last["best_distance_in"])
        status.stop = last["stop"] if isinstance(last["stop"], str) else None
    return statuses


def _by_trial(table: pandas.DataFrame) -> list[tuple[int, pandas.DataFrame]]:
    return [] if table.empty else [(int(trial), rows) for trial, rows in table.groupby("trial")]


def improvement_percent(status: TrialStatus) -> float:
    """Rise of the best distance by evolution, in %; NaN where the first did not walk forward."""
    initial = status.initial_best_distance_in
    return 100.0 * (status.best_distance_in / initial - 1.0) if initial > 0.0 else math.nan


def _largest(values: Sequence[float]) -> str:
    return number(max((value for value in values if math.isfinite(value)), default=math.nan))


def _mean(values: Sequence[float]) -> str:
    finite = [value for value in values if math.isfinite(value)]
    return number(float(np.mean(finite))) if finite else "-"


def _seconds_per_iteration(statuses: Sequence[TrialStatus]) -> str:
    evaluations = sum(status.evaluations for status in statuses)
    wall_time = sum(status.wall_time for status in statuses)
    return number(CHILDREN * wall_time / evaluations) if evaluations else "-"
