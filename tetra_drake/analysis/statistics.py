"""Statistics of few values, such as those of a run's trials, and how sure they are."""

from __future__ import annotations

import math
from collections.abc import Callable
from statistics import NormalDist
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from tetra_drake.files import json_number

if TYPE_CHECKING:
    import pandas

RESAMPLES = 2000


def interval(values: npt.ArrayLike, statistic: Callable[..., Any] = np.mean) -> tuple[float, float]:
    """The 95 % confidence interval of a statistic of the values, by bootstrap, always with the same
    resamples; NaN are left out. It has no width where all values are alike."""
    numbers = np.asarray(values, dtype=float)
    numbers = numbers[~np.isnan(numbers)]
    if not len(numbers):
        return math.nan, math.nan
    return middle(resampled(numbers, np.random.default_rng(0), statistic))


def resampled(
    values: np.ndarray, generator: np.random.Generator, statistic: Callable[..., Any] = np.mean
) -> np.ndarray:
    """The statistic of RESAMPLES resamples of the values (n,), each of n drawn with replacement."""
    picks = generator.integers(len(values), size=(RESAMPLES, len(values)))
    return np.asarray(statistic(values[picks], axis=1))


def middle(resamples: np.ndarray) -> tuple[float, float]:
    """The ends of the middle 95 % of resamples: a confidence interval, by bootstrap."""
    low, high = np.quantile(resamples, [0.025, 0.975])
    return float(low), float(high)


def share_interval(count: int, total: int) -> tuple[float, float]:
    """Wilson score interval, at 95 % confidence, of the share of `count` in `total`.

    It has a width where the share is 0 or 1, too: 40 of 40 give 91 to 100 %. From Wilson (1927),
    "Probable inference, the law of succession, and statistical inference", J. Am. Stat. Assoc. 22.
    """
    if total == 0:
        return math.nan, math.nan
    z = NormalDist().inv_cdf(0.975)
    share, scale = count / total, 1.0 / (1.0 + z * z / total)
    centre = scale * (share + 0.5 * z * z / total)
    reach = scale * z * math.sqrt(share * (1.0 - share) / total + 0.25 * (z / total) ** 2)
    return max(0.0, centre - reach), min(1.0, centre + reach)


def interquartile_mean(values: npt.ArrayLike, axis: int = -1) -> Any:
    """The mean without the lowest and the highest quarter of the values along an axis, quarters
    rounded down: less moved by single values than the mean, surer than the median (Agarwal et al.
    2021, "Deep reinforcement learning at the edge of the statistical precipice")."""
    ordered = np.sort(np.asarray(values, dtype=float), axis=axis)
    count = ordered.shape[axis]
    return ordered.take(range(count // 4, count - count // 4), axis=axis).mean(axis=axis)


def json_rows(table: pandas.DataFrame) -> list[dict[Any, Any]]:
    """Rows of a table, its index among them, as JSON holds them: null for what is not finite."""
    rows = table.reset_index().to_dict("records")
    return [{key: json_number(value) for key, value in row.items()} for row in rows]
