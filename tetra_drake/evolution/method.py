"""The method of a run: its objective and its optimiser, by name.

A name is what a person compares and what a run without its parts is refused by. What proves that
the parts are the same when a run is resumed is its record: the optimiser must ask for the recorded
vectors, and a recorded gait must get its fitness again (see trials.check_fitness).
"""

from __future__ import annotations

import dataclasses
import json
import types
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from tetra_drake.errors import InputError
from tetra_drake.scenario.schema import Scenario

FITNESS = "fitness"
"""The name of the scenario's objective."""


@dataclass(frozen=True)
class Method:
    """The parts of a run that its scenario does not hold; those from Python have a module."""

    objective: str
    optimizer: str

    @classmethod
    def of(
        cls,
        scenario: Scenario,
        *,
        objective: object | None = None,
        optimizer: object | None = None,
    ) -> Method:
        """The method of a run; what is not given is the scenario's."""
        return cls(
            objective=FITNESS if objective is None else _name(objective),
            optimizer=_name(scenario.optimizer if optimizer is None else optimizer),
        )

    @classmethod
    def from_json(cls, raw: Mapping[str, Any], source: object) -> Method:
        """The method in a manifest; InputError if damaged."""
        names = [field.name for field in dataclasses.fields(cls)]
        for name in names:
            if not isinstance(raw.get(name), str):
                raise InputError(source, name, "is missing or damaged")
        return cls(**{name: raw[name] for name in names})

    @property
    def given_from_python(self) -> list[str]:
        """The parts that a command line cannot give: "objective", "optimizer"."""
        return [part for part, name in vars(self).items() if "." in name]

    def check_same(self, other: Method, source: object) -> None:
        """Raises InputError, with the part as key, unless `other` has the same names."""
        for part, ours in vars(self).items():
            theirs = getattr(other, part)
            if ours == theirs:
                continue
            problem = f"the run was made with {ours}, not {theirs}"
            if part in self.given_from_python:
                call = f"tetra_drake.evolve(None, {str(source)!r}, resume=True, {part}=...)"
                problem += f"; resume it from Python, with its own: {call}"
            raise InputError(source, part, problem)


def _name(given: object) -> str:
    """What a function, a class or an instance is called: with its module, unless that is of this
    package, and with the fields of a user's dataclass."""
    kind: Any = given if isinstance(given, (type, types.FunctionType)) else type(given)
    module = kind.__module__ or "__main__"  # code that was executed from a text has none
    if module.startswith("tetra_drake."):
        return str(kind.__qualname__)
    name = f"{module}.{kind.__qualname__}"
    if not dataclasses.is_dataclass(given) or isinstance(given, type):
        return name
    fields = {field.name: getattr(given, field.name) for field in dataclasses.fields(given)}
    return f"{name} {json.dumps(fields, default=lambda value: type(value).__name__)}"
