"""Path of the robot's centre of mass: positions, heading, curvature."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tetra_drake.robot.structure import Structure

PERIOD = 0.25
"""Time (s) between points of a result's path. It is at most half of the fastest gait's period. The
robot turns by far less than half a turn in this time, so its heading can be unwrapped."""
_SWAY = 2e-3
"""Size (m) of a path that may be swaying on the spot. Such a path counts as straight."""


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
    centre = centre_of_mass(poses[..., 4:], structure)
    if not structure.points_ahead:
        return CentrePath(times, centre, np.full(len(times), math.nan))
    w, x, y, z = np.ascontiguousarray(poses.T)[:4]
    ahead, left = (w * w + x * x - y * y - z * z).sum(axis=0), 2.0 * (x * y + w * z).sum(axis=0)
    heading = np.arctan2(left, ahead)
    # The same as np.unwrap(), but much faster.
    heading[1:] -= math.tau * np.round((heading[1:] - heading[:-1]) / math.tau).cumsum()
    return CentrePath(times, centre, heading)


def centre_of_mass(p_WB: np.ndarray, structure: Structure) -> np.ndarray:
    """Centre of mass (k, 3) in m, from the bodies' origins p_WB (k, n, 3)."""
    # The factors are exactly 1 if all bodies have the same mass.
    shares = structure.mass / structure.mass[0]
    weighted = shares[:, np.newaxis] * np.ascontiguousarray(p_WB.T)
    return weighted.sum(axis=1).T / shares.sum()


def curvature(points: np.ndarray) -> float:
    """Curvature (1/m) of a path: of the circle fitted to its points (k, 2) in m.

    The curvature is positive if the path bends to the left, and 0 on a line. Taubin's fit (IEEE
    Trans. PAMI 13, 1991, 1115), with p relative to the mean of the points: the circle is
    bend / (2 size) (p . p - size^2) + normal . p = 0. The unit vector (bend, normal) minimises the
    mean square of the left side. A term is added that keeps the curvature of a path small if the
    path is hardly larger than _SWAY. For a path of 10 cm the term has no effect.
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
    # (bend, normal) is the eigenvector with the smallest eigenvalue.
    bend, normal_x, normal_y = np.linalg.eigh(moments)[1][:, 0].tolist()
    bend /= size
    # Twice the area swept by the ray from the circle's centre, times +-1 / radius.
    swept = bend * (x[:-1] @ y[1:] - y[:-1] @ x[1:])
    swept += normal_x * (y[-1] - y[0]) - normal_y * (x[-1] - x[0])
    return math.copysign(bend, bend * swept)
