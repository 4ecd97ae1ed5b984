"""The wall time that a simulation may take, in any thread, on engines without lanes."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Iterator
from contextvars import ContextVar

from tetra_drake.errors import TimeBudgetExceeded

_deadline = ContextVar("deadline", default=(math.inf, math.inf))
"""Deadline by time.perf_counter(), and the budget (s)."""


@contextlib.contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """A block in which simulations end with TimeBudgetExceeded after this wall time."""
    token = _deadline.set((time.perf_counter() + seconds, seconds))
    try:
        yield
    finally:
        _deadline.reset(token)


def check_time() -> None:
    """Raises TimeBudgetExceeded if the time is up; every engine calls it again and again."""
    deadline, seconds = _deadline.get()
    if time.perf_counter() > deadline:
        raise TimeBudgetExceeded(f"not done after {seconds:g} s")
