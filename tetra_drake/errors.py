"""The ways things end that are not results: bad input, and a simulation that fails or takes too
long."""

from __future__ import annotations

import functools


class InputError(ValueError):
    """Input a person gave cannot be used; the message is one line made for that person.

    `source` is the file (or option) at fault, `key` the place in it, and the
    message says what was found and what was expected.
    """

    def __init__(self, source: object, key: str, problem: str) -> None:
        self.source = str(source)
        self.key = key
        self.problem = problem
        message = f"{source}: {key}: {problem}" if key else f"{source}: {problem}"
        super().__init__(" ".join(message.split()))


class SimulationFailure(RuntimeError):
    """A simulation ended before its duration: `time` (s) says when, `reason` why."""

    wall_time = 0.0
    """What the simulation cost, in s, where the engine says it."""

    def __init__(self, *, time: float, reason: str) -> None:
        self.time = time
        self.reason = reason
        super().__init__(f"simulation failed at t = {time:.4f} s: {reason}")

    def __reduce__(self) -> tuple[object, ...]:
        # Keyword-only arguments defeat the default; failures must cross process borders.
        return functools.partial(type(self), time=self.time, reason=self.reason), ()


class Diverged(SimulationFailure):
    """The motion left the physical range: not finite, too fast, or beyond the integrator."""


class StepBudgetExceeded(SimulationFailure):
    """The integrator used up its allowance of derivative evaluations."""


class TimeBudgetExceeded(Exception):
    """A simulation took too long by the clock. No RuntimeError, as engines take those for
    divergence."""

    wall_time = 0.0
    """As of SimulationFailure."""
