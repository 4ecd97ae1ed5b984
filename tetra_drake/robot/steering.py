"""Steering of oscillators: a turn, or a function from time to the turn."""

from __future__ import annotations

import numbers
from collections.abc import Callable

from tetra_drake.errors import InputError

SteeringSignal = Callable[[float], float]
"""Function from time (s) to the turn, -1 to 1."""


def constant_steering(turn: float) -> SteeringSignal:
    """Steering function that gives the same turn, -1 to 1, at all times; a positive turn raises the
    input of left oscillators. Raises InputError unless the turn is a number; checked_turn() checks
    its limits later."""
    if isinstance(turn, bool) or not isinstance(turn, numbers.Real):
        expected = "a number from -1 to 1, or a function of the time in s"
        raise InputError("steering", "", f"found {turn!r}, expected {expected}")
    return lambda time: turn


def checked_turn(turn: float, *, time: float) -> float:
    """The turn as a float. Raises InputError unless it is a number from -1 to 1; the message names
    the `time` (s) for which a steering function gave it."""
    if not isinstance(turn, numbers.Real) or not abs(turn) <= 1.0:
        raise InputError("steering", f"at {time:g} s", f"found {turn!r:.60}, expected -1 to 1")
    return float(turn)
