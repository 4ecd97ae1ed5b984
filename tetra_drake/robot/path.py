"""Path of the robot's centre of mass: positions and heading."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tetra_drake.robot.structure import Structure

PERIOD = 0.25
"""Time (s) between points of a result's path. It is at most half of the fastest gait's period. The
robot turns by far less than half a turn in this time, so its heading can be unwrapped."""


@dataclass(frozen=True)
class CentrePath:
    """Path of the robot's centre of mass, and the robot's heading."""

    times: np.ndarray
    """Times (k,) in s, ascending."""
    centre: np.ndarray
    """Positions (k, 3) in the world frame, in m."""
    heading: np.ndarray
    """Angles (k,) from the world's x axis to the left, in rad, without jumps at full turns. NaN for
    robots other than rows of tetrahedra."""


def follow(times: np.ndarray, poses: np.ndarray, structure: Structure) -> CentrePath:
    """The path of a robot, from the poses (k, n, 7) of its n bodies at times (k,) in s.

    A pose is a quaternion, w first, and the position of the body's origin in m. The heading of a
    row of tetrahedra is the horizontal direction of the sum of the bodies' x axes, which point
    forward. Other structures have no heading: they may roll over, and bars may spin about their
    axes.
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
