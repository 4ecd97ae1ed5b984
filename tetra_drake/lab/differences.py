"""Derivatives by finite differences."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt


def derivatives(function: Callable[[np.ndarray], np.ndarray], steps: npt.ArrayLike) -> np.ndarray:
    """Derivatives (m, n) of the m values of a function by its n arguments at 0, by central
    differences with these steps (n,) of the arguments."""
    moves = np.diag(np.asarray(steps, dtype=float))
    return np.transpose([(function(x) - function(-x)) / (2.0 * x.max()) for x in moves])
