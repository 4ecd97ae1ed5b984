"""Placement of measurements: the frame of a log, and offsets of markers.

A frame is the pose of the model's world in the log: its rotation (3, 3), and its origin (3,) in m.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

Frame = tuple[np.ndarray, np.ndarray]


def aligned(p: np.ndarray, seen: np.ndarray) -> Frame:
    """The frame that brings points p (k, 3) of a model nearest to the `seen` ones (k, 3)."""
    here, there = p.mean(axis=0), seen.mean(axis=0)
    left, _, right = np.linalg.svd((seen - there).T @ (p - here))
    turn = left * [1.0, 1.0, np.linalg.det(left @ right)] @ right  # no reflection
    return turn, there - turn @ here


def aligned_with_offsets(
    p: np.ndarray, R: np.ndarray, seen: np.ndarray, frame: Frame, share: float, *, is_free: bool
) -> tuple[Frame, np.ndarray]:
    """The frame near `frame`, or just that unless `is_free`, and the offsets (nodes, 3) of markers
    in the axes R (times, nodes, 3, 3) of bodies that bring nodes p (times, nodes, 3) nearest to the
    `seen` markers. `share` is the standard deviation of a coordinate over the one of an offset."""
    is_whole = np.isfinite(seen).all(axis=2, keepdims=True)

    def split(x: np.ndarray) -> tuple[Frame, np.ndarray, np.ndarray]:
        turn = Rotation.from_rotvec(is_free * x[:3]).as_matrix() @ frame[0]
        origin = frame[1] + is_free * x[3:]
        beside = np.einsum("tnij,tni->tnj", R, (seen - origin) @ turn - p)
        beside = np.where(is_whole, beside, 0.0)
        offsets = beside.sum(axis=0) / (is_whole.sum(axis=0) + share**2)
        rest = np.append(is_whole * (beside - offsets), share * offsets)
        return (turn, origin), offsets, rest

    return split(least_squares(lambda x: split(x)[2], np.zeros(6)).x)[:2]
