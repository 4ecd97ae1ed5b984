"""Limit for the wall time of simulations. Each thread has its own."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Iterator
from contextvars import ContextVar

from tetra_drake.errors import TimeBudgetExceeded

_deadline = ContextVar("deadline", default=(math.inf, math.inf))
"""Deadline on the clock time.perf_counter(), and the budget (s)."""


@contextlib.contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Context manager: simulations in the block raise TimeBudgetExceeded when `seconds` (s) of wall
    time have passed since its beginning."""
    token = _deadline.set((time.perf_counter() + seconds, seconds))
    try:
        yield
    finally:
        _deadline.reset(token)


def check_time() -> None:
    """Raises TimeBudgetExceeded if the wall time of time_limit() has passed in this thread. Engines
    call it often during a simulation."""
    deadline, seconds = _deadline.get()
    if time.perf_counter() > deadline:
        raise TimeBudgetExceeded(f"not done after {seconds:g} s")
