"""Measures of motion, in SI units: path of the centre, distances, contact and cycles.

results.trajectory.make_dataset() makes trajectories.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from tetra_drake.robot.structure import Structure, followed_nodes

if TYPE_CHECKING:
    import xarray

Span: TypeAlias = tuple[float, float]
"""Two limits: start and end (s), or least and greatest coordinate."""

PERIOD = 0.25
"""Time (s) between points of a result's path. It is at most half of the fastest gait's period. The
robot turns by far less than half a turn in this time, so its heading can be unwrapped."""

_STEADY = 0.01
"""Least swing of an oscillating signal, as a share of its largest value."""

_PADDING = 16
"""Factor by which zero-padding lengthens a signal, for a finer spectrum."""


@dataclass(frozen=True)
class CentrePath:
    """Path of the robot's centre of mass over time, and the robot's heading along it."""

    times: np.ndarray
    """Times (k,) in s, ascending."""
    centre: np.ndarray
    """Positions (k, 3) in the world frame, in m."""
    heading: np.ndarray
    """Angles (k,) from the world's x axis to the left, in rad, without jumps at full turns. NaN for
    robots other than rows of tetrahedra."""


def follow(times: np.ndarray, poses: np.ndarray, structure: Structure) -> CentrePath:
    """Path of a robot's centre of mass, from the poses of its bodies.

    The poses (k, n, 7) are of n bodies at times (k,) in s. A pose is a quaternion, w first, and the
    position of the body's origin in m. The heading of a row of tetrahedra is the horizontal
    direction of the sum of the bodies' x axes, which point forward. Other structures have no
    heading: they may roll over, and bars may spin about their axes.
    """
    # The shares are exactly 1 if all bodies have the same mass.
    shares = structure.mass / structure.mass[0]
    weighted = shares[:, np.newaxis] * np.ascontiguousarray(poses[..., 4:].T)
    centre = weighted.sum(axis=1).T / shares.sum()
    if not structure.points_ahead:
        return CentrePath(times, centre, np.full(len(times), math.nan))
    w, x, y, z = np.ascontiguousarray(poses.T)[:4]
    ahead, left = (w * w + x * x - y * y - z * z).sum(axis=0), 2.0 * (x * y + w * z).sum(axis=0)
    heading = np.arctan2(left, ahead)
    # The same as np.unwrap(), but much faster.
    heading[1:] -= math.tau * np.round((heading[1:] - heading[:-1]) / math.tau).cumsum()
    return CentrePath(times, centre, heading)


def path_of_centre(trajectory: xarray.Dataset, structure: Structure) -> CentrePath:
    """Path of the robot's centre of mass, at all samples of a recorded trajectory."""
    poses = np.concatenate([trajectory.q_WB.values, trajectory.p_WB.values], axis=2)
    return follow(trajectory.time.values, poses, structure)


def distance_walked(trajectory: xarray.Dataset, structure: Structure) -> np.ndarray:
    """Displacement (times,) in m along the world's x axis since the start, at all samples of a
    recorded trajectory; negative if backward.

    It is the displacement of the first marker (in a row of tetrahedra the bottom left node of T1,
    the first one), or of the centre of mass for a robot without markers."""
    x = followed_nodes(trajectory.p_WN.values, structure)[:, 0, 0]
    return x - x[0]


def off_ground(trajectory: xarray.Dataset) -> xarray.DataArray:
    """Boolean array (times, contact nodes) for a recorded trajectory: True where a contact node
    bears no normal force."""
    return trajectory.normal_force == 0.0


def intervals(times: np.ndarray, active: np.ndarray) -> list[Span]:
    """Intervals where a Boolean signal is true, as starts and ends (s).

    `times` (samples,) are in s and ascend; `active` (samples,) is the signal. A sample tells what
    was true in the step that ends there, such as contact. Therefore an interval begins one sample
    before the first true one.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], active, [False]]).astype(int)))
    ends = times[np.maximum(edges - 1, 0)]
    return [(float(a), float(b)) for a, b in ends.reshape(-1, 2)]


def share_of_time(active: xarray.DataArray) -> float:
    """Share of time, 0 to 1, during which a Boolean signal is true. `active` (times,) has the
    coordinate `time` in s; see intervals() for what a sample means."""
    times = active.time.values
    length = sum(end - start for start, end in intervals(times, active.values))
    return length / float(times[-1] - times[0])


def dominant_frequency(times: np.ndarray, signal: np.ndarray) -> float:
    """Frequency in Hz of the highest peak in the spectrum of a signal (samples,).

    `times` (samples,) are in s and ascend. They may be uneven; the signal is interpolated. NaN if
    the signal does not oscillate.
    """
    if np.ptp(signal) <= _STEADY * np.abs(signal).max():
        return math.nan
    even = np.linspace(times[0], times[-1], len(times))
    swing = np.interp(even, times, signal)
    swing = (swing - swing.mean()) * np.hanning(len(even))
    spectrum = np.abs(np.fft.rfft(swing, _PADDING * len(even)))
    frequencies = np.fft.rfftfreq(_PADDING * len(even), even[1] - even[0])
    return float(frequencies[spectrum.argmax()])


def last_step(trajectory: xarray.Dataset) -> Span | None:
    """Start and end (s) of the robot's last step: one period of the oscillators' signals, late in a
    recorded trajectory.

    The period is taken from the signal with the largest swing in the second half of the trajectory.
    The step ends where this signal rises through its mean for the last time. None if no signal
    oscillates, or if the second half is shorter than two periods.
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
