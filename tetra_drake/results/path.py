"""The path of the robot's centre, its heading along it, and how the path bends."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

PERIOD = 0.25
"""Time (s) between the instants of a result's path: half of the fastest gait's period or less, and
the robot turns by far less than half a turn within it, so that its heading can be unwrapped."""

_SWAY = 2e-3
"""m: a path of this size or less is put down to swaying on the spot, and counts as straight."""


@dataclass(frozen=True)
class CentrePath:
    """Path of the robot's centre, the mean of its bodies' origins, and its heading."""

    times: np.ndarray
    """(k,): in s, ascending."""
    centre: np.ndarray
    """(k, 3): in World, in m."""
    heading: np.ndarray
    """(k,): from World's x axis to the left, in rad; whole turns count."""


def follow(times: np.ndarray, poses: np.ndarray) -> CentrePath:
    """The path of a robot from the poses (k, n, 7) of its bodies at some times (k,) in s.

    A pose is the quaternion, w first, and the origin in m. The heading is the direction in the
    horizontal plane of the sum of the bodies' x axes, which point from the rear to the tips.
    """
    columns = np.ascontiguousarray(poses.T)
    w, x, y, z = columns[:4]
    ahead, left = (w * w + x * x - y * y - z * z).sum(axis=0), 2.0 * (x * y + w * z).sum(axis=0)
    heading = np.arctan2(left, ahead)
    # As np.unwrap() would, in a fraction of its time.
    heading[1:] -= math.tau * np.round((heading[1:] - heading[:-1]) / math.tau).cumsum()
    return CentrePath(times, columns[4:].sum(axis=1).T / poses.shape[1], heading)


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
