"""Statistics of few values, such as those of a run's trials, and how sure they are."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

RESAMPLES = 2000


def interval(values: npt.ArrayLike, statistic: Callable[..., Any] = np.mean) -> tuple[float, float]:
    """The 95 % confidence interval of a statistic of the values, by bootstrap, always with the same
    resamples; NaN are left out. It has no width where all values are alike."""
    numbers = np.asarray(values, dtype=float)
    numbers = numbers[~np.isnan(numbers)]
    if not len(numbers):
        return math.nan, math.nan
    picks = np.random.default_rng(0).integers(len(numbers), size=(RESAMPLES, len(numbers)))
    low, high = np.quantile(statistic(numbers[picks], axis=1), [0.025, 0.975])
    return float(low), float(high)


def interquartile_mean(values: npt.ArrayLike, axis: int = -1) -> Any:
    """The mean without the lowest and the highest quarter of the values along an axis, quarters
    rounded down: less moved by single values than the mean, surer than the median (Agarwal et al.
    2021, "Deep reinforcement learning at the edge of the statistical precipice")."""
    ordered = np.sort(np.asarray(values, dtype=float), axis=axis)
    count = ordered.shape[axis]
    return ordered.take(range(count // 4, count - count // 4), axis=axis).mean(axis=axis)
