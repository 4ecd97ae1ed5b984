"""What the figures show of a trajectory (see trajectory.make_dataset), in SI units."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tetra_drake.intervals import intervals
from tetra_drake.robot.structure import BOTTOM_LEFT, NODES

if TYPE_CHECKING:
    import xarray

_STEADY = 0.01
"""A signal that swings by less than this share of its size does not oscillate."""


def distance_walked(trajectory: xarray.Dataset) -> xarray.DataArray:
    """(time,): x1, the way of T1's bottom left node along x since the start, in m."""
    x = trajectory.p_WN.isel(tetrahedron=0, node=BOTTOM_LEFT).sel(axis="x")
    return x - x.isel(time=0)


def relative_distances(trajectory: xarray.Dataset) -> xarray.DataArray:
    """(time, tetrahedron): x of each tetrahedron's centre of mass from that of T1, in m."""
    x = trajectory.p_WN.sel(axis="x").mean("node")
    return x - x.isel(tetrahedron=0)


def actuated_cable(junction: str) -> str:
    """One of the two cables that the junction's signal drives; the other mirrors it."""
    return f"{junction} outer {NODES[BOTTOM_LEFT]}"


def off_ground(trajectory: xarray.Dataset) -> xarray.DataArray:
    """(time, contact): whether the contact node bears no normal force."""
    return trajectory.normal_force == 0.0


def lifted(trajectory: xarray.Dataset) -> xarray.DataArray:
    """(time, tetrahedron): whether no contact node of the tetrahedron bears a normal force."""
    import xarray

    off, bodies = off_ground(trajectory), trajectory.tetrahedron
    nodes = [off.contact.str.startswith(f"{body} ") for body in bodies.values]
    return xarray.concat([off[:, own.values].all("contact") for own in nodes], dim=bodies).T


def share_of_time(active: xarray.DataArray) -> float:
    """The share of the time, 0 to 1, in which `active` (time,) holds."""
    times = active.time.values
    length = sum(end - start for start, end in intervals(times, active.values))
    return length / float(times[-1] - times[0])


def last_step(trajectory: xarray.Dataset) -> tuple[float, float] | None:
    """Start and end (s) of a typical step late in the trajectory, of one period of the signals.

    In the second half of the trajectory, it ends where the signal with the largest swing last
    rises through its mean, and lasts as long as the median of that signal's periods. None
    if no signal oscillates there.
    """
    times = trajectory.time.values
    late = trajectory.signal.values[times >= times.mean()]
    times = times[times >= times.mean()]
    signal = late[:, np.ptp(late, axis=0).argmax()]
    if np.ptp(signal) <= _STEADY * np.abs(signal).max():
        return None
    y = signal - signal.mean()
    i = np.flatnonzero((y[:-1] < 0.0) & (y[1:] >= 0.0))
    crossings = times[i] - y[i] * (times[i + 1] - times[i]) / (y[i + 1] - y[i])
    if crossings.size < 2:
        return None
    return float(crossings[-1] - np.median(np.diff(crossings))), float(crossings[-1])
