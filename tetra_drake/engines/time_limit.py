"""Limit for the CPU time of simulations. Each thread has its own.

A busy or sleeping machine does not fail a gait, as it would by a limit of wall time.
"""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Iterator
from contextvars import ContextVar

from tetra_drake.errors import TimeBudgetExceeded

_deadline = ContextVar("deadline", default=(math.inf, math.inf))
"""Deadline on the clock time.thread_time(), and the budget (s)."""


@contextlib.contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Context manager: simulations in the block raise TimeBudgetExceeded when the thread has
    computed for `seconds` (s) since its beginning."""
    token = _deadline.set((time.thread_time() + seconds, seconds))
    try:
        yield
    finally:
        _deadline.reset(token)


def check_time() -> None:
    """Raises TimeBudgetExceeded if the CPU time of time_limit() has passed in this thread. Engines
    call it often during a simulation."""
    deadline, seconds = _deadline.get()
    if time.thread_time() > deadline:
        raise TimeBudgetExceeded(f"not done after {seconds:g} s")
