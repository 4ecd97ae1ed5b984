"""Which steps MuJoCo's integrators can take on the robot."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tetra_drake.benchmark.errors import CLOSE_IN, ErrorStatistics

Array = np.ndarray

STEPS_MS = {
    "Euler": (1.0, 0.5, 0.25, 0.125),
    "implicitfast": (4.0, 2.0, 1.0, 0.5, 0.25, 0.125),
    "discrete": (20.0, 10.0, 5.0, 2.0, 1.0),
}
"""The steps to choose from, by integrator: MuJoCo's default, the one it recommends, and the one
it advises for stiff springs and strong damping. Finer ones cost more than the reference."""

REFERENCE = ("implicitfast", 0.0625)
"""Integrator and step (ms) of the distances that MuJoCo's are held against."""


@dataclass(frozen=True)
class Choice:
    """One way to simulate in MuJoCo, and why it is in the table."""

    integrator: str
    step_ms: float
    reason: str


def choose_steps(
    integrator: str,
    steps_ms: Sequence[float],
    walk: Callable[[float], Array],
    *,
    exact_in: Array,
    counted: Array,
) -> list[Choice]:
    """The largest step that is stable on all gaits, and the largest that has converged: one
    choice, two, or none if nothing is stable.

    `steps_ms` descend; `walk` gives the gaits' distances (in) for one of them. A step has
    converged if its median error against `exact_in` is at most CLOSE_IN over the gaits that
    are `counted`; if none has, the second choice is the step that comes nearest.
    """
    stable: list[tuple[float, float]] = []
    for step_ms in steps_ms:
        found = walk(step_ms)
        if np.isfinite(found).all():
            error = ErrorStatistics.of(found - exact_in, counted).median_in
            stable.append((error, step_ms))
            if error <= CLOSE_IN:
                break
    if not stable:
        return []
    _, largest = stable[0]
    error, nearest = min(stable)
    reason = "largest converged" if error <= CLOSE_IN else "nearest, not converged"
    if nearest == largest:
        return [Choice(integrator, largest, f"largest stable, {reason}")]
    return [Choice(integrator, largest, "largest stable"), Choice(integrator, nearest, reason)]
