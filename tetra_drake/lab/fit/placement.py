"""Placement of measurements: the clock and the frame of a log, and offsets of markers.

A frame is the pose of the model's world in the log: its rotation (3, 3), and its origin (3,) in m.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.optimize import OptimizeResult, least_squares
from scipy.spatial.transform import Rotation

from tetra_drake.errors import InputError

OFFSETS, APART = 41, 0.02
"""Least number of offsets of a clock, and greatest difference (s) between them, that are tried
before the best one is refined."""
EXACT = 1e-10
"""Relative tolerance of the refinement, in the sum of squares and in the unknowns."""

Frame = tuple[np.ndarray, np.ndarray]
OverTime = Callable[[np.ndarray], np.ndarray]
"""Something that moves, at times (times,) in s."""


class Placement(NamedTuple):
    """Clock and frame of a log, and markers in it."""

    shift: float
    """Offset (s) of the clock."""
    frame: Frame
    offsets: np.ndarray
    """Offsets (nodes, 3) in m of markers from their nodes, in the axes of bodies."""
    p: np.ndarray
    """Positions (times, nodes, 3) in m of the markers in the log, as predicted."""


def aligned(p: np.ndarray, seen: np.ndarray) -> Frame:
    """The frame that brings points p (k, 3) of a model nearest to the `seen` ones (k, 3)."""
    here, there = p.mean(axis=0), seen.mean(axis=0)
    left, _, right = np.linalg.svd((seen - there).T @ (p - here))
    turn = left * [1.0, 1.0, np.linalg.det(left @ right)] @ right  # no reflection
    return turn, there - turn @ here


def nearest(
    places: OverTime,
    axes: OverTime,
    times: Callable[[float], np.ndarray],
    seen: np.ndarray,
    *,
    clock: tuple[float, float],
    frame: Frame | None,
    share: float,
) -> Placement:
    """The placement that brings a motion nearest to the `seen` markers (times, nodes, 3) in m.

    Args:
        places: positions of the nodes (times, nodes, 3) in m.
        axes: rotation matrices of their bodies (times, nodes, 3, 3).
        times: times (times,) in s of a log for an offset (s) of its clock.
        seen: positions of the markers, NaN in gaps.
        clock: least and greatest offset of the clock in s.
        frame: the frame; None to find it.
        share: standard deviation of a coordinate over the one of a marker's offset along an axis;
            0 for markers without offsets.
    """
    is_there = np.isfinite(seen)
    is_whole = is_there.all(axis=2, keepdims=True)
    whole, counts = is_whole[:, :, 0], is_whole.sum(axis=0)

    def placed(shift: float, frame: Frame | None) -> Placement:
        p = places(times(shift))
        turn, origin = frame = frame or aligned(p[whole], seen[whole])
        offsets = np.zeros(p.shape[1:])
        if share:
            R = axes(times(shift))
            beside = np.einsum("tnij,tni->tnj", R, (seen - origin) @ turn - p)
            offsets = np.where(is_whole, beside, 0.0).sum(axis=0) / (counts + share**2)
            p = p + np.einsum("tnij,nj->tni", R, offsets)
        return Placement(shift, frame, offsets, p @ turn.T + origin)

    def residuals(found: Placement) -> np.ndarray:
        return np.append((found.p - seen)[is_there], share * found.offsets)

    (low, high), start = clock, placed(clock[0], frame)
    if low < high:
        tried, step = np.linspace(
            low, high, max(OFFSETS, math.ceil((high - low) / APART)), retstep=True
        )
        misfits = [(residuals(placed(shift, frame)) ** 2).sum() for shift in tried]
        start = placed(float(tried[np.argmin(misfits)]), frame)
        low, high = max(start.shift - step, low), min(start.shift + step, high)
    elif frame or not share:
        return start

    def moved(x: np.ndarray) -> Placement:
        turn, origin = start.frame
        if x.size > 1:
            turn, origin = Rotation.from_rotvec(x[1:4]).as_matrix() @ turn, origin + x[4:]
        own = (turn, origin) if x.size > 1 else frame
        return placed(float(np.clip(start.shift + x[0], low, high)), own)

    unknowns = 7 if share and not frame else 1
    tolerances = {"ftol": EXACT, "xtol": EXACT, "x_scale": "jac"}
    found = least_squares(lambda x: residuals(moved(x)), np.zeros(unknowns), **tolerances)
    return moved(unknowns_of(found, "frame"))


def unknowns_of(solution: OptimizeResult, key: str) -> np.ndarray:
    """The unknowns that a search by SciPy has found. Raises InputError, naming `key`, if the search
    has ended before it converged."""
    if not solution.success:
        raise InputError("fit", key, f"the search does not converge: {solution.message}")
    return np.asarray(solution.x)
