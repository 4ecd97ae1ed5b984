"""When something holds that was recorded as yes or no at each step's end."""

from __future__ import annotations

import numpy as np


def intervals(times: np.ndarray, active: np.ndarray) -> list[tuple[float, float]]:
    """Starts and ends (s) of the stretches in which `active` (samples,) holds.

    `times` (samples,) in s, ascending. A sample shows the modes of the step that ends there,
    so a stretch begins one sample before it shows.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], active, [False]]).astype(int)))
    ends = times[np.maximum(edges - 1, 0)]
    return [(float(a), float(b)) for a, b in ends.reshape(-1, 2)]
