"""What came out of a run, the thesis's numbers beside it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from tetra_drake import thesis
from tetra_drake.evolution.progress import number
from tetra_drake.evolution.steady_state import CHILDREN
from tetra_drake.evolution.trial import TrialStatus


def summary(statuses: Sequence[TrialStatus]) -> str:
    """The lines printed at the end of a run. Distances are those of the fittest gaits."""
    lines = [
        f"trial {status.number}: {status.stop or 'not ended'} after iteration {status.iteration}, "
        f"{status.evaluations} evaluations, {status.failures} failed; mean fitness "
        f"{number(status.initial_mean_fitness)} -> {number(status.mean_fitness)}, best distance "
        f"{number(status.initial_best_distance_in)} -> {number(status.best_distance_in)} in"
        for status in statuses
    ]
    rises = [improvement_percent(status) for status in statuses]
    initial = _largest([status.initial_best_distance_in for status in statuses])
    best = _largest([status.best_distance_in for status in statuses])
    rows = [
        ("best initial gait", f"{initial} in", f"{thesis.BEST_INITIAL_DISTANCE_IN} in"),
        ("best evolved gait", f"{best} in", f"{thesis.BEST_EVOLVED_DISTANCE_IN} in"),
        (
            "improvement, mean of trials",
            f"{_mean(rises)} %",
            f"{thesis.MEAN_IMPROVEMENT_PERCENT:g} %",
        ),
        (
            "improvement, best trial",
            f"{_largest(rises)} %",
            f"{thesis.BEST_IMPROVEMENT_PERCENT:g} %",
        ),
        (
            "simulation time per iteration",
            f"{_seconds_per_iteration(statuses)} s",
            f"{thesis.SECONDS_PER_ITERATION:g} s",
        ),
    ]
    lines.append(f"{'':<32}{'ours':>10}{'thesis':>12}")
    lines += [f"{name:<32}{ours:>10}{theirs:>12}" for name, ours, theirs in rows]
    return "\n".join(lines)


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
