"""The evaluation of a gait among disturbances, made of the evaluations of its draws."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tetra_drake.optimizers.base import Evaluation
from tetra_drake.scenario.metrics import LEAST, MOST


def combine(draws: Sequence[Evaluation], share: float) -> Evaluation:
    """The evaluation of a gait from those of its draws, of which the worst share counts. It fails
    if one of them does."""
    wall_time = sum(draw.wall_time for draw in draws)
    failures = [f"draw {k}: {e.failure}" for k, e in enumerate(draws) if e.failure is not None]
    metrics = combine_metrics([draw.metrics for draw in draws])
    if failures:
        return Evaluation(-math.inf, metrics, failures[0], wall_time)
    fitnesses = [draw.fitness for draw in draws]
    distances = [draw.metrics["distance"] for draw in draws]
    lists = {"fitness": fitnesses, "distance": distances}
    fitness = worst_mean(fitnesses, share)
    return Evaluation(fitness, metrics, wall_time=wall_time, draws=lists)


def combine_metrics(draws: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Means, least or greatest values of each metric; none if a draw has none."""
    if not all(draws):
        return {}
    return {name: _combined(name, [draw[name] for draw in draws]) for name in draws[0]}


def _combined(name: str, values: Sequence[Any]) -> Any:
    if None in values:  # infinite
        return None
    if name in LEAST:
        return min(values)
    if name in MOST:
        return max(values)
    return np.mean(values, axis=0).tolist()


def worst_mean(fitnesses: Sequence[float], share: float) -> float:
    """Mean over the worst share, above 0, of the fitnesses: as many as that are, the last one by
    the fraction of it that is left; the least alone if they are less than one."""
    ranked, count = sorted(fitnesses), max(1.0, share * len(fitnesses))
    weights = [min(1.0, max(0.0, count - i)) for i in range(len(ranked))]
    return math.fsum(w * f for w, f in zip(weights, ranked, strict=True)) / count
