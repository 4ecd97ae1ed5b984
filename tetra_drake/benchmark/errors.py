"""What is said of distances that should be equal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

CLOSE_IN = 0.05
"""Distances (in) that differ by no more count as the same."""


@dataclass(frozen=True)
class ErrorStatistics:
    """Of absolute distance errors, in inches; NaN if there are none."""

    median_in: float
    worst_in: float

    @staticmethod
    def of(errors_in: np.ndarray, counted: np.ndarray) -> ErrorStatistics:
        """Of errors (gaits,), NaN where a gait failed, over the gaits that are `counted`."""
        errors = np.abs(errors_in[counted & np.isfinite(errors_in)])
        if not errors.size:
            return ErrorStatistics(np.nan, np.nan)
        return ErrorStatistics(float(np.median(errors)), float(errors.max()))


def well_conditioned(one_in: np.ndarray, other_in: np.ndarray) -> np.ndarray:
    """(gaits,) of bool: whether the distances (in) of two converged runs are the same."""
    return np.abs(one_in - other_in) <= CLOSE_IN
