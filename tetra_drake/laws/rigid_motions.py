"""Velocities of the points of a rigid body, for all six of its motions."""

from __future__ import annotations

import numpy as np


def rigid_motions(p: np.ndarray) -> np.ndarray:
    """Velocities (points, 3, 6) of points p (points, 3) of a rigid body.

    The six motions are rotations about x, y and z through the origin with 1 rad/s, then
    translations along x, y and z with 1 m/s.
    """
    motions = np.zeros((len(p), 3, 6))
    x, y, z = p.T
    motions[:, 1, 0], motions[:, 2, 0] = -z, y
    motions[:, 0, 1], motions[:, 2, 1] = z, -x
    motions[:, 0, 2], motions[:, 1, 2] = -y, x
    motions[:, :, 3:] = np.eye(3)
    return motions
