"""The path of the robot's centre, its heading along it, and how the path bends."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tetra_drake.robot.structure import Structure

PERIOD = 0.25
"""Time (s) between the instants of a result's path: half of the fastest gait's period or less, and
the robot turns by far less than half a turn within it, so that its heading can be unwrapped."""

_SWAY = 2e-3
"""m: a path of this size or less is put down to swaying on the spot, and counts as straight."""


@dataclass(frozen=True)
class CentrePath:
    """Path of the robot's centre of mass, and its heading."""

    times: np.ndarray
    """(k,): in s, ascending."""
    centre: np.ndarray
    """(k, 3): in World, in m."""
    heading: np.ndarray
    """(k,): from World's x axis to the left, in rad; whole turns count. NaN for robots that are no
    row."""


def follow(times: np.ndarray, poses: np.ndarray, structure: Structure) -> CentrePath:
    """The path of a robot from the poses (k, n, 7) of its bodies at some times (k,) in s.

    A pose is the quaternion, w first, and the origin in m. The heading of a row is the direction in
    the horizontal plane of the sum of the bodies' x axes, which point from the rear to the tips.
    Other structures have none: they may roll over, and bars do not turn about their axes with them.
    """
    centre = centre_of_mass(poses[..., 4:], structure)
    if not structure.points_ahead:
        return CentrePath(times, centre, np.full(len(times), math.nan))
    w, x, y, z = np.ascontiguousarray(poses.T)[:4]
    ahead, left = (w * w + x * x - y * y - z * z).sum(axis=0), 2.0 * (x * y + w * z).sum(axis=0)
    heading = np.arctan2(left, ahead)
    # As np.unwrap() would, in a fraction of its time.
    heading[1:] -= math.tau * np.round((heading[1:] - heading[:-1]) / math.tau).cumsum()
    return CentrePath(times, centre, heading)


def centre_of_mass(p_WB: np.ndarray, structure: Structure) -> np.ndarray:
    """(k, 3): the centre of mass in m from the bodies' origins p_WB (k, n, 3)."""
    # Factors of exactly 1 where all bodies are alike.
    shares = structure.mass / structure.mass[0]
    weighted = shares[:, np.newaxis] * np.ascontiguousarray(p_WB.T)
    return weighted.sum(axis=1).T / shares.sum()


def curvature(points: np.ndarray) -> float:
    """Curvature in 1/m of the circle nearest to points (k, 2) in m, in the order they are passed:
    positive to the left, 0 on a line; towards 0 for points that hardly move.

    Taubin's fit (IEEE Trans. PAMI 13, 1991, 1115) with p from the mean of the points: the circle is
    bend / (2 size) (p . p - size^2) + normal . p = 0, and (bend, normal), a unit vector, makes the
    mean square of this least. Added to it is what lets a bend count little on a path hardly larger
    than the sway; on one of 10 cm, it changes nothing that matters.
    """
    (x, y), count = points.T, len(points)
    x, y = x - x.sum() / count, y - y.sum() / count
    square = x * x + y * y
    size = math.sqrt(square.sum() / count)
    if size < 1e-3 * _SWAY:
        return 0.0
    table = np.array([(square - size * size) / (2.0 * size), x, y])
    moments = table @ table.T / count
    moments[0, 0] += (_SWAY * _SWAY / size) ** 2
    # The eigenvector of the smallest eigenvalue.
    bend, normal_x, normal_y = np.linalg.eigh(moments)[1][:, 0].tolist()
    bend /= size
    # Twice the area that the ray from the circle's centre sweeps, times +-1 / radius.
    swept = bend * (x[:-1] @ y[1:] - y[:-1] @ x[1:])
    swept += normal_x * (y[-1] - y[0]) - normal_y * (x[-1] - x[0])
    return math.copysign(bend, bend * swept)
