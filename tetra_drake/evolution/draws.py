"""Evaluation of a gait on disturbed robots: combines the evaluations of its draws."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tetra_drake.optimizers.base import Evaluation
from tetra_drake.scenario.metrics import METRICS


def combine(draws: Sequence[Evaluation], share: float) -> Evaluation:
    """Combines the evaluations of a gait's draws. Fitness is the mean over the worst `share` of the
    draws. The gait fails if one draw fails."""
    wall_time = sum(draw.wall_time for draw in draws)
    failures = [f"draw {k}: {e.failure}" for k, e in enumerate(draws) if e.failure is not None]
    metrics = combine_metrics([draw.metrics for draw in draws])
    if failures:
        return Evaluation(-math.inf, metrics, failures[0], wall_time)
    fitnesses = [draw.fitness for draw in draws]
    lists = {"fitness": fitnesses, "distance": [draw.metrics["distance"] for draw in draws]}
    return Evaluation(worst_mean(fitnesses, share), metrics, wall_time=wall_time, draws=lists)


def combine_metrics(draws: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Each metric over the draws: its mean, least or greatest value. Empty if a draw has no
    metrics."""
    if not all(draws):
        return {}
    return {name: _combined(name, [draw[name] for draw in draws]) for name in draws[0]}


def _combined(name: str, values: Sequence[Any]) -> Any:
    if None in values:  # an infinite metric is recorded as null
        return None
    if name in METRICS and METRICS[name].least:
        return min(values)
    if name in METRICS and METRICS[name].most:
        return max(values)
    return np.mean(values, axis=0).tolist()


def worst_mean(fitnesses: Sequence[float], share: float) -> float:
    """Mean of the lowest `share` of the fitnesses. A fractional last value gets its fraction as
    weight. At least one value counts."""
    ranked, count = sorted(fitnesses), max(1.0, share * len(fitnesses))
    weights = [min(1.0, max(0.0, count - i)) for i in range(len(ranked))]
    return math.fsum(w * f for w, f in zip(weights, ranked, strict=True)) / count
