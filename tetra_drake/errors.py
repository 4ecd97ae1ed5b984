"""The ways things end that are not results: bad input, and a simulation that fails or takes too
long."""

from __future__ import annotations

import functools
import re
from typing import Any

_QUOTED, _LONGEST, _LONGEST_PATH = 200, 600, 4096
"""Characters of anything quoted, of a problem and of a source, at most."""


class InputError(ValueError):
    """Input a person gave cannot be used; the message is one line made for that person.

    `source` is the file (or option) at fault, `key` the place in it, and the
    message says what was found and what was expected.
    """

    def __init__(self, source: object, key: str, problem: str) -> None:
        self.source = str(source)
        self.key = key
        self.problem = _shortened(problem)
        place = f"{_cut(self.source, _LONGEST_PATH)}: {_cut(key, _QUOTED)}".removesuffix(": ")
        super().__init__(_one_line(f"{place}: {self.problem}"))


def _shortened(problem: str) -> str:
    """The problem on one line, without most of what it quotes, if that is long: it may be a whole
    file."""
    problem = _one_line(problem)
    problem = re.sub(rf"'([^']{{{_QUOTED}}})[^']+'", r"'\1 ...'", problem)
    problem = re.sub(rf"([^\s']{{{_QUOTED}}})[^\s']+", r"\1 ...", problem)
    return problem if len(problem) <= _LONGEST else _cut(problem, _QUOTED)


def _one_line(text: str) -> str:
    """The text on one line, with escapes for control characters, which a terminal would obey."""
    line = " ".join(text.split())
    return "".join(letter if letter.isprintable() else ascii(letter)[1:-1] for letter in line)


def _cut(text: str, length: int) -> str:
    return text if len(text) <= length else f"{text[:length]} ..."


class SimulationFailure(RuntimeError):
    """A simulation ended before its duration: `time` (s) says when, `reason` why."""

    wall_time = 0.0
    """Wall time of the simulation in s, if the engine says it."""
    scenario: Any = None
    gait: Any = None
    """Scenario and gait that were simulated, of a failure among the outcomes of many."""
    name = ""
    """Name of this gait."""

    def __init__(self, *, time: float, reason: str) -> None:
        self.time = time
        self.reason = reason
        super().__init__(f"simulation failed at t = {time:.4f} s: {reason}")

    def __repr__(self) -> str:
        gait = f"{self.name} on scenario {self.scenario.name}: " if self.name else ""
        return f"<{type(self).__name__} {gait}{self}>"

    def __reduce__(self) -> tuple[object, ...]:
        # Keyword-only arguments defeat the default; failures must cross process borders.
        return functools.partial(type(self), time=self.time, reason=self.reason), ()


MAX_SPEED = 10.16
"""m/s (400 in/s): where a body is faster, a simulation has diverged."""


class Diverged(SimulationFailure):
    """The motion left the physical range: not finite, too fast, or beyond the integrator."""


class StepBudgetExceeded(SimulationFailure):
    """The integrator used up its allowance of derivative evaluations."""


class TimeBudgetExceeded(Exception):
    """A simulation took too long by the clock. No RuntimeError, as engines take those for
    divergence."""

    wall_time = 0.0
    """Wall time of the simulation in s, if the engine says it."""
