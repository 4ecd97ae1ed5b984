"""Statistics of few values, such as the trials of a run, with confidence intervals."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from tetra_drake.files import json_number

if TYPE_CHECKING:
    import pandas

RESAMPLES = 2000


def interval(values: npt.ArrayLike, statistic: Callable[..., Any] = np.mean) -> tuple[float, float]:
    """Ends (low, high) of the 95 % confidence interval of a statistic of the values, by bootstrap
    with a fixed seed. `statistic` takes an array and `axis`. NaN are left out; without values both
    ends are NaN. If all values are equal, the width is 0."""
    numbers = np.asarray(values, dtype=float)
    numbers = numbers[~np.isnan(numbers)]
    if not len(numbers):
        return math.nan, math.nan
    return interval_of_resamples(statistic(resampled(numbers, np.random.default_rng(0)), axis=1))


def resampled(values: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    """Bootstrap resamples (2000, n) of n values: each row has n of them, drawn with replacement."""
    return values[generator.integers(len(values), size=(RESAMPLES, len(values)))]


def interval_of_resamples(resamples: np.ndarray) -> tuple[float, float]:
    """Ends (low, high) of the 95 % confidence interval of a statistic. `resamples` has its values,
    one per bootstrap resample; the interval is their middle 95 %."""
    low, high = np.quantile(resamples, [0.025, 0.975])
    return float(low), float(high)


def share_interval(count: int, total: int) -> tuple[float, float]:
    """Wilson score interval (95 %) of the share `count` / `total`: its ends low and high, between 0
    and 1; NaN if `total` is 0.

    Its width is positive even if the share is 0 or 1: 40 of 40 give 91 to 100 %.
    """
    from scipy.stats import binomtest

    if total == 0:
        return math.nan, math.nan
    found = binomtest(count, total).proportion_ci(method="wilson")
    return float(found.low), float(found.high)


def interquartile_mean(values: npt.ArrayLike, axis: int = -1) -> Any:
    """Interquartile mean: the mean without the lowest and the highest quarter of the values.

    The size of a quarter is rounded down. Outliers move it less than the mean, and it varies less
    than the median (Agarwal et al. 2021, "Deep reinforcement learning at the edge of the
    statistical precipice").
    """
    from scipy.stats import trim_mean

    return trim_mean(values, 0.25, axis=axis)


def json_rows(table: pandas.DataFrame) -> list[dict[Any, Any]]:
    """Rows of a table as dictionaries for JSON, including the index. Infinities and NaN become
    None."""
    rows = table.reset_index().to_dict("records")
    return [{key: json_number(value) for key, value in row.items()} for row in rows]
