"""Exceptions: bad input, failed simulations, exceeded time budgets."""

from __future__ import annotations

import contextlib
import functools
import math
import numbers
import re
from collections.abc import Callable, Mapping, Sequence
from types import NoneType
from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

_LONGEST, _QUOTED, _CUT, _LONGEST_PATH = 270, 60, 200, 4096
"""Largest numbers of characters in a message: of key and problem together; of a key or a quotation,
and of a problem, if key and problem have more; of the source."""
_IN_WORDS = {
    bool: "True or False",
    str: "a text",
    list: "a list",
    Sequence: "a list",
    Mapping: "a mapping",
    Callable: "a function",
    NoneType: "None",
    numbers.Real: "a number",
}


class InputError(ValueError):
    """Error of input that cannot be used. The message is one line.

    `source` is the file, option or function, `key` the position in it ("" for the whole).
    `problem` says what was found and what was expected.
    """

    def __init__(self, source: object, key: str, problem: str) -> None:
        self.source = str(source)
        self.key = key
        self.problem = _one_line(problem)
        if len(key) + len(self.problem) > _LONGEST:
            # Long quotations are cut; one may be a whole file.
            problem = re.sub(rf"'([^']{{{_QUOTED}}})[^']+'", r"'\1 ...'", self.problem)
            problem = re.sub(rf"([^\s']{{{_QUOTED}}})[^\s']+", r"\1 ...", problem)
            key, self.problem = _cut(key, _QUOTED), _cut(problem, _CUT)
        origin = f"{_cut(self.source, _LONGEST_PATH)}: {key}".removesuffix(": ")
        super().__init__(_one_line(f"{origin}: {self.problem}"))

    def _render_traceback_(self) -> list[str]:
        """The lines that IPython and notebooks show for the error: its message, no traceback."""
        return [f"{type(self).__name__}: {self}"]


def _one_line(text: str) -> str:
    """The text on one line: runs of spaces and line feeds become one space; see escaped()."""
    return escaped(" ".join(text.split()))


def escaped(text: str) -> str:
    """The text with escapes in place of control characters, because a terminal would obey them."""
    return "".join(letter if letter.isprintable() else ascii(letter)[1:-1] for letter in text)


def _cut(text: str, length: int) -> str:
    return text if len(text) <= length else f"{text[:length]} ..."


def check_whole(
    source: object, key: str, number: Any, *, least: int, most: int | None = None
) -> int:
    """A number as int. Raises InputError unless it is a whole number from `least` to `most` (None
    for no limit). `source` and `key` tell the error where the number was given."""
    is_whole = isinstance(number, numbers.Integral) and not isinstance(number, bool)
    if not is_whole or number < least or (most is not None and number > most):
        limits = f"{least} or more" if most is None else f"{least} to {most}"
        raise InputError(source, key, f"found {number!r:.60}, expected an integer, {limits}")
    return int(number)


def check_type(source: object, key: str, value: object, *kinds: Any) -> None:
    """Raises InputError unless a value has one of the types `kinds`. True and False do not count as
    numbers. `source` and `key` tell the error where the value was given."""
    is_wrong = isinstance(value, bool) and bool not in kinds
    is_wrong |= isinstance(value, int) and value.bit_length() > 1000  # no float can have it
    if is_wrong or not isinstance(value, kinds):
        expected = " or ".join(_IN_WORDS.get(kind, kind.__name__) for kind in kinds)
        raise InputError(source, key, f"found {value!r:.60}, expected {expected}")


def check_positive(source: object, key: str, number: Any) -> None:
    """Raises InputError, naming `source` and `key`, unless a number is finite and above 0."""
    check_type(source, key, number, numbers.Real)
    if not 0.0 < number < math.inf:
        raise InputError(source, key, f"found {number}, expected a number above 0")


def checked_numbers(
    given: npt.ArrayLike, *shapes: tuple[int, ...], source: str, key: str, finite: bool = False
) -> np.ndarray:
    """Converts an argument to real numbers (floats) of one of the given shapes. Raises InputError
    for anything else, and with `finite` for nan and inf. Its message names `source`, the class or
    function, and `key`, the argument, with the index of a number that is not finite."""
    import numpy as np  # the command line starts without it

    found = ""
    with contextlib.suppress(TypeError, ValueError):
        array = np.asarray(given)
        if array.dtype.kind in "iuf" and not np.ma.is_masked(given):
            if array.shape not in shapes:
                found = f"the shape {array.shape}"
            elif finite and (bad := ~np.isfinite(array)).any():
                found, key = str(array[bad][0]), f"{key}{np.argwhere(bad)[0].tolist()}"
            else:
                return array.astype(float)
    expected = f"{'finite' if finite else 'real'} numbers of shape {shapes[0]}"
    raise InputError(source, key, f"found {found or repr(given):.60}, expected {expected}")


class SimulationFailure(RuntimeError):
    """A simulation that failed at `time` (s) for a `reason`."""

    kind = "failed"
    """First word of the reason in a record."""
    fitness = -math.inf
    """Fitness of a gait that failed, for optimisers."""
    wall_time = 0.0
    """Wall time of the simulation in s; 0 if the engine does not measure it."""
    scenario: Any = None
    gait: Any = None
    """Scenario and gait of the simulation; set by simulate_many() only."""
    name = ""
    """Name of the gait."""

    def __init__(self, *, time: float, reason: str) -> None:
        self.time = time
        self.reason = reason
        super().__init__(f"simulation failed at t = {time:.4f} s: {reason}")

    def __repr__(self) -> str:
        gait = f"{self.name} on scenario {self.scenario.name}: " if self.name else ""
        return f"<{type(self).__name__} {gait}{self}>"

    def __reduce__(self) -> tuple[object, ...]:
        # The default cannot pickle keyword-only arguments. Worker processes send failures.
        return functools.partial(type(self), time=self.time, reason=self.reason), ()


class Diverged(SimulationFailure):
    """Failure of a simulation whose motion is not finite, too fast, or too hard for the
    integrator."""

    kind = "diverged"

    @classmethod
    def too_fast(cls, *, time: float, limit: float) -> Self:
        """The failure of a robot that has a body faster than `limit` (m/s), at `time` (s)."""
        reason = f"a body moves faster than simulation.max_speed, {limit:.4g} m/s"
        return cls(time=time, reason=reason)


class StepBudgetExceeded(SimulationFailure):
    """Failure of a simulation that used up its budget of derivative evaluations."""

    kind = "step budget"


class TimeBudgetExceeded(Exception):
    """Failure of a simulation that used up its limit of CPU time. It is not a RuntimeError,
    because engines treat a RuntimeError as divergence."""

    kind = "time budget"
    wall_time = 0.0
    """Wall time of the simulation in s; 0 if the engine does not measure it."""
