"""Quantities derived from a recorded trajectory (see trajectory.make_dataset), in SI units."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from tetra_drake.robot.path import CentrePath, follow
from tetra_drake.robot.structure import Structure, followed_nodes

if TYPE_CHECKING:
    import xarray

_STEADY = 0.01
"""A signal that swings by less than this share of its largest value does not oscillate."""

_PADDING = 16
"""Length of a zero-padded signal over its own: how many times finer its spectrum is sampled."""


def distance_walked(trajectory: xarray.Dataset, structure: Structure) -> np.ndarray:
    """(time,): displacement along x since the start, in m, of the first marker, T1's bottom left
    node, or of the centre."""
    x = followed_nodes(trajectory.p_WN.values, structure)[:, 0, 0]
    return x - x[0]


def relative_distances(trajectory: xarray.Dataset) -> xarray.DataArray:
    """(time, body): x of each body's centre of mass less that of the first body, in m."""
    x = trajectory.p_WB.sel(axis="x")
    return x - x.isel(body=0)


def path_of_centre(trajectory: xarray.Dataset, structure: Structure) -> CentrePath:
    """The path of the robot's centre at all samples."""
    poses = np.concatenate([trajectory.q_WB.values, trajectory.p_WB.values], axis=2)
    return follow(trajectory.time.values, poses, structure)


def off_ground(trajectory: xarray.Dataset) -> xarray.DataArray:
    """(time, contact): whether the contact node bears no normal force."""
    return trajectory.normal_force == 0.0


def lifted(trajectory: xarray.Dataset) -> xarray.DataArray:
    """(time, body): whether no contact node of the body bears a normal force."""
    import xarray

    off, bodies = off_ground(trajectory), trajectory.body
    of_bodies = [off[:, (off.contact_body == body).values].all("contact") for body in bodies]
    return xarray.concat(of_bodies, dim=bodies).T


def intervals(times: np.ndarray, active: np.ndarray) -> list[tuple[float, float]]:
    """Intervals in which a Boolean signal is true: their starts and ends (s).

    `times` (samples,) in s, ascending; `active` (samples,). A sample holds the modes of the step
    that ends there, so an interval begins at the sample before the first true one.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], active, [False]]).astype(int)))
    ends = times[np.maximum(edges - 1, 0)]
    return [(float(a), float(b)) for a, b in ends.reshape(-1, 2)]


def share_of_time(active: xarray.DataArray) -> float:
    """Share of the time, 0 to 1, in which a Boolean signal (time,) is true."""
    times = active.time.values
    length = sum(end - start for start, end in intervals(times, active.values))
    return length / float(times[-1] - times[0])


def dominant_frequency(times: np.ndarray, signal: np.ndarray) -> float:
    """Frequency in Hz of the highest peak in the spectrum of a signal (samples,).

    `times` (samples,) in s, ascending; where they are not evenly spaced, the signal is
    interpolated. NaN for a signal that does not oscillate.
    """
    if np.ptp(signal) <= _STEADY * np.abs(signal).max():
        return math.nan
    even = np.linspace(times[0], times[-1], len(times))
    swing = np.interp(even, times, signal)
    swing = (swing - swing.mean()) * np.hanning(len(even))
    spectrum = np.abs(np.fft.rfft(swing, _PADDING * len(even)))
    frequencies = np.fft.rfftfreq(_PADDING * len(even), even[1] - even[0])
    return float(frequencies[spectrum.argmax()])


def last_step(trajectory: xarray.Dataset) -> tuple[float, float] | None:
    """Start and end (s) of one period of the signals, late in the trajectory.

    The period is that of the signal with the largest swing in the second half of the trajectory;
    the step ends where this signal last rises through its mean. None if no signal oscillates, or
    if the second half is shorter than two periods.
    """
    if not trajectory.sizes["oscillator"]:
        return None
    late = trajectory.signal.sel(time=slice(trajectory.time.values.mean(), None))
    times, signal = late.time.values, late.values[:, np.ptp(late.values, axis=0).argmax()]
    frequency = dominant_frequency(times, signal)
    if not frequency * (times[-1] - times[0]) >= 2.0:
        return None
    y = signal - signal.mean()
    i = int(np.flatnonzero((y[:-1] < 0.0) & (y[1:] >= 0.0))[-1])
    end = times[i] - y[i] * (times[i + 1] - times[i]) / (y[i + 1] - y[i])
    return float(end - 1.0 / frequency), float(end)
