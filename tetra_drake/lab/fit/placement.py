"""Placement of a log of motion: nodes of its markers, its frame, and offsets of markers.

A frame is the pose of the model's world in the log: its rotation (3, 3), and its origin (3,) in m.
"""

from __future__ import annotations

import itertools

import numpy as np
from scipy.optimize import least_squares, linear_sum_assignment
from scipy.spatial.transform import Rotation

Frame = tuple[np.ndarray, np.ndarray]

UPS = np.vstack([np.eye(3)[::-1], -np.eye(3)[::-1]])
"""Axes of a log that may point up, the likeliest first: z, y, x, and the opposite ones."""
UPRIGHT, FAR, CLEAR, PASSES = 0.97, 0.1, 3.0, 3
"""Limits of a match: least cosine of the tilt of an upward axis; greatest distance of markers from
nodes as a share of the markers' size, and as a multiple of the least one; number of passes."""


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


def matches(p: np.ndarray, seen: np.ndarray, may_be: np.ndarray, noise: float) -> list[list[int]]:
    """Nodes of markers `seen` (markers, 3), at nodes p (nodes, 3) where `may_be` (markers, nodes):
    the best choice, and those that are as good with a `noise` in m. Only choices with the likeliest
    upward axis count; there is none where markers are not near nodes."""
    found: dict[tuple[int, ...], tuple[int, float]] = {}
    # Starts are 30 degrees apart. Some markers of a regular robot may be at several places of it.
    centres = np.vstack([p.mean(axis=0), p if len(seen) < len(p) else p[:0]])
    turns = itertools.product(*map(Rotation.create_group, ("O", "C3")))
    for (upright, yaw), centre in itertools.product(turns, centres):
        turn = (upright * yaw).as_matrix()
        origin = seen.mean(axis=0) - turn @ centre
        for _ in range(PASSES):
            squares = ((seen[:, np.newaxis] - p @ turn.T - origin) ** 2).sum(axis=2)
            nodes = linear_sum_assignment(np.where(may_be, squares, 1e12))[1]
            turn, origin = aligned(p[nodes], seen)
        distance = float(np.linalg.norm(seen - p[nodes] @ turn.T - origin))
        for rank in np.flatnonzero(UPS @ turn[:, 2] > UPRIGHT):
            found[*nodes.tolist()] = int(rank), distance
    least = min((distance for _, distance in found.values()), default=0.0)
    size = np.linalg.norm(seen - seen.mean(axis=0))
    near = CLEAR * (least + noise * np.sqrt(seen.size))
    close = sorted((rank, [*nodes]) for nodes, (rank, x) in found.items() if x <= near)
    return [nodes for rank, nodes in close if rank == close[0][0] and least <= FAR * size]
