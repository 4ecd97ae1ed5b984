"""Velocities of the points of a rigid body, for all six of its motions."""

from __future__ import annotations

import numpy as np


def rigid_motions(p: np.ndarray) -> np.ndarray:
    """Velocities (points, 3, 6) of points p (points, 3) of a rigid body.

    The six motions are rotations about x, y and z through the origin with 1 rad/s, then
    translations along x, y and z with 1 m/s.
    """
    turns = np.cross(np.eye(3), p[:, np.newaxis]).transpose(0, 2, 1)
    return np.concatenate([turns, np.broadcast_to(np.eye(3), turns.shape)], axis=2)
