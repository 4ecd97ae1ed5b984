"""What the best gaits are like, from their recorded trajectories."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from tetra_drake.results.measures import lifted, share_of_time

if TYPE_CHECKING:
    import xarray

_PADDING = 16
"""Zeros that lengthen a signal before its transform: how many times finer the frequencies are."""


def shares_off_ground(trajectory: xarray.Dataset, *, since: float) -> dict[str, float]:
    """For each tetrahedron, the share of the time, 0 to 1, in which it is off the ground.

    From `since` (s) to the end. It is off the ground while none of its contact nodes bears
    a normal force.
    """
    off = lifted(trajectory.sel(time=slice(since, None)))
    return {str(name): share_of_time(off.sel(tetrahedron=name)) for name in off.tetrahedron.values}


def signal_frequencies(trajectory: xarray.Dataset, *, since: float) -> dict[str, float]:
    """For each junction, the frequency (Hz) at which its signal swings most.

    From `since` (s) to the end.
    """
    steady = trajectory.signal.sel(time=slice(since, None))
    return {
        str(name): dominant_frequency(steady.time.values, steady.sel(junction=name).values)
        for name in steady.junction.values
    }


def dominant_frequency(times: np.ndarray, signal: np.ndarray) -> float:
    """In Hz, where the spectrum of a signal (samples,) over times (samples,) in s has its peak.

    Times need not be even. NaN for a constant.
    """
    even = np.linspace(times[0], times[-1], len(times))
    swing = np.interp(even, times, signal)
    swing = (swing - swing.mean()) * np.hanning(len(even))
    if np.ptp(swing) <= 1e-9 * np.abs(signal).max():
        return math.nan
    spectrum = np.abs(np.fft.rfft(swing, _PADDING * len(even)))
    frequencies = np.fft.rfftfreq(_PADDING * len(even), even[1] - even[0])
    return float(frequencies[spectrum.argmax()])
