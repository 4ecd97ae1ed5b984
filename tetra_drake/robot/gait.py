"""Gait: numbers by name from which oscillators or a policy make the signals of a robot. And
steering of oscillators: a turn, or a function from time to the turn.
"""

from __future__ import annotations

import math
import numbers
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from tetra_drake.errors import InputError
from tetra_drake.laws.oscillator import GaitParameter
from tetra_drake.scenario.world import World

if TYPE_CHECKING:
    from tetra_drake.formatting import TextTable

Body = tuple[tuple[str, float | str], ...]
"""Numbers of a robot: scenario keys, and values as texts with units, or as numbers without one."""

SteeringSignal = float | Callable[[float], float]
"""Turn, -1 to 1, or function from time (s) to the turn."""

_MOST = 15
"""Largest number of parameters that are printed."""


@dataclass(frozen=True)
class Gait:
    """Gait: numbers by name from which oscillators or a policy make the signals of a robot, and the
    body that evolved with them, if any: what evolution searches for."""

    name: str
    parameters: Mapping[str, float] = field(hash=False)
    """Numbers by name, in SI units, such as "tau_A"; see Scenario.parameters."""
    turn: float = 0.0
    """Steering, -1 to 1. Left oscillators get the input u0 (1 + turn), right ones u0 (1 - turn)."""
    body: Body = ()
    """Numbers of the robot that evolved with the gait; see Scenario.evolve."""
    scenario: str = field(default="", compare=False)
    """Name of the scenario that the gait was made for; "" if it is unknown."""

    def __str__(self) -> str:
        return f"{self.name}\n{self._table.text()}"

    def __repr__(self) -> str:
        return f"<Gait {self.name}>"

    def _repr_html_(self) -> str:
        from tetra_drake.formatting import heading_html

        return heading_html(self.name) + self._table.html()

    @property
    def _table(self) -> TextTable:
        """Table of the parameters, the turn unless it is 0, and the numbers of the body; of a long
        one the beginning."""
        from tetra_drake.formatting import TextTable

        turn = {"turn": self.turn} if self.turn else {}
        found = {**self.parameters, **turn, **dict(self.body)}
        rows = [[name, _four_digits(value)] for name, value in found.items()][:_MOST]
        more = [["...", f"{len(found) - _MOST} more"]] if len(found) > _MOST else []
        return TextTable(["parameter", "value"], rows + more, (0, 1))

    def to_json(self, scenario: World) -> dict[str, Any]:
        """Content of a gait file, for json.dumps(). It has the name of the scenario that the gait
        was made for, or the name of `scenario` if that is unknown."""
        content: dict[str, Any] = {"schema": 3, "name": self.name}
        content["scenario"] = self.scenario or scenario.name
        content["parameters"] = dict(self.parameters)
        optional = {"turn": self.turn, "body": dict(self.body)}
        return content | {key: value for key, value in optional.items() if value}


def _four_digits(value: float | str) -> str:
    """A number, or the number of a quantity given as text, with four significant digits."""
    number, blank, unit = str(value).partition(" ")
    return f"{float(number):.4g}{blank}{unit}"


def check_parameters(
    given: Mapping[str, float], expected: Mapping[str, GaitParameter], source: object, key: str = ""
) -> dict[str, float]:
    """The values of `given` in the order of the parameters `expected`. One that may be missing gets
    its default. Raises InputError, naming source and key, for other names, or for a value that is
    too small or not finite."""
    values, missing = dict[str, float](), list[str]()
    for name, one in expected.items():
        default = one.ratio * values[one.leader] if one.leader in values else one.default
        value = given.get(name, default)
        if value is None:
            missing.append(name)
        elif not (one.least <= value and math.isfinite(value)):
            limit = "a finite number" if one.least == -math.inf else f"{one.least:g} or more"
            place = f"{key}.{name}".strip(".")
            raise InputError(source, place, f"found {value}, expected {limit}")
        else:
            values[name] = value
    unknown = [name for name in given if name not in expected]
    problems = {"lacks {} names": missing, "has {} unknown names": unknown}.items()
    texts = [f"{text.format(len(some))}, such as '{some[0]}'" for text, some in problems if some]
    if texts:
        found = f"found {len(given)}, expected the {len(expected)} of the scenario"
        raise InputError(source, key, f"{found}; {' and '.join(texts)}")
    return values


def checked_turn(turn: float, *, time: float) -> float:
    """The turn as a float. Raises InputError unless it is a number from -1 to 1; the message names
    the `time` (s) for which a steering function gave it."""
    if not isinstance(turn, numbers.Real) or not abs(turn) <= 1.0:
        raise InputError("steering", f"at {time:g} s", f"found {turn!r:.60}, expected -1 to 1")
    return float(turn)
