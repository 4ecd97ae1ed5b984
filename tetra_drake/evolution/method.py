"""The method of a run: evaluator, objective and optimiser, each by name and settings.

What was given from Python has a digest of its code and of the values that the code uses, so that
a run is never resumed with anything else.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import inspect
import json
import sys
import types
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from tetra_drake.errors import InputError
from tetra_drake.scenario.schema import Scenario


@dataclass(frozen=True)
class Part:
    """One part of a method."""

    name: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    """The fields of a dataclass instance; empty where the scenario holds the settings."""
    digest: str | None = None
    """SHA-256 of what was given from Python; None for what the package brings."""

    @classmethod
    def of(cls, given: object) -> Part:
        """The part that a function, a class or an instance is."""
        kind: Any = given if isinstance(given, (type, types.FunctionType)) else type(given)
        settings = {}
        if dataclasses.is_dataclass(given) and not isinstance(given, type):
            values = {f.name: getattr(given, f.name) for f in dataclasses.fields(given)}
            settings = json.loads(json.dumps(values, default=lambda value: type(value).__name__))
        if (kind.__module__ or "").startswith("tetra_drake."):
            return cls(kind.__qualname__, settings)
        text = "\0".join(_pieces(given, {}))
        digest = hashlib.sha256(text.encode()).hexdigest()
        return cls(f"{kind.__module__}.{kind.__qualname__}", settings, digest)


@dataclass(frozen=True)
class Method:
    """The parts of a run that its scenario does not hold."""

    evaluator: Part
    """The engine."""
    objective: Part
    optimizer: Part

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
            evaluator=Part(scenario.simulation.engine),
            objective=Part("fitness") if objective is None else Part.of(objective),
            optimizer=Part.of(optimizer) if optimizer else Part(type(scenario.optimizer).__name__),
        )

    @classmethod
    def from_json(cls, raw: Mapping[str, Any], source: object) -> Method:
        """The method in a manifest, where dataclasses.asdict puts it; InputError if damaged."""
        parts = {}
        for f in dataclasses.fields(cls):
            try:
                parts[f.name] = Part(**raw[f.name])
            except (KeyError, TypeError) as error:
                raise InputError(source, f.name, "is missing or damaged") from error
        return cls(**parts)

    @property
    def given_from_python(self) -> list[str]:
        """The parts that a command line cannot give: "objective", "optimizer"."""
        return [name for name, part in vars(self).items() if part.digest is not None]

    def check_same(self, other: Method, source: object) -> None:
        """Raises InputError, with the part as key, unless `other` is the same method."""
        for name, ours in vars(self).items():
            theirs: Part = getattr(other, name)
            if ours == theirs:
                continue
            now = f"another {name} of this name" if ours.name == theirs.name else theirs.name
            settings = f" {json.dumps(ours.settings)}" if ours.settings else ""
            problem = f"the run was made with {ours.name}{settings}, not {now}"
            if ours.digest is not None:
                call = f"tetra_drake.evolve(None, {str(source)!r}, resume=True, {name}=...)"
                problem += f"; resume it from Python, with its own: {call}"
            raise InputError(source, name, problem)


def _pieces(value: Any, seen: dict[int, Any]) -> Iterator[str]:
    """Text of all that decides what `value` does, each object once."""
    if isinstance(value, (str, bytes, int, float, complex, type(None))):
        yield repr(value)
    elif id(value) not in seen:
        seen[id(value)] = value  # kept, so that no other object gets its id
        yield type(value).__qualname__
        for part in _parts(value):
            yield from _pieces(part, seen)


_TRANSPARENT = (functools.partial, types.MethodType)
"""Pickled as what they consist of."""


def _parts(value: Any) -> Iterable[Any]:
    """What an object consists of."""
    if isinstance(value, (list, tuple)):
        return value
    if isinstance(value, Mapping):
        return value.items()
    if isinstance(value, (set, frozenset)):
        return sorted(map(repr, value))
    if isinstance(value, (type, types.FunctionType)):
        name = f"{value.__module__}.{value.__qualname__}"
        if not _is_own(value.__module__):
            return [name]
        return [name, *(_class(value) if isinstance(value, type) else _function(value))]
    opaque = not _is_own(type(value).__module__) and not isinstance(value, _TRANSPARENT)
    if opaque and hasattr(value, "__wrapped__"):  # as made by staticmethod, functools.cache, numba
        return [value.__wrapped__]
    try:
        reduced = value.__reduce_ex__(2)  # as for pickle: class and values, or a name
    except Exception:
        return [getattr(value, "__name__", "")]
    return reduced if isinstance(reduced, tuple) else [reduced]


def _function(function: types.FunctionType) -> list[Any]:
    """Its source, or else its bytecode, its defaults, and the values it finds outside."""
    try:
        code: Any = inspect.getsource(function)
    except (OSError, TypeError):  # typed into an interpreter, or read from standard input
        code = _bytecode(function.__code__)
    outside = inspect.getclosurevars(function)
    defaults = [function.__defaults__, function.__kwdefaults__]
    return [code, *defaults, dict(outside.nonlocals), dict(outside.globals)]


def _bytecode(code: types.CodeType) -> list[Any]:
    constants = [_bytecode(c) if isinstance(c, types.CodeType) else c for c in code.co_consts]
    return [code.co_code, code.co_names, constants]


def _class(kind: type) -> list[Any]:
    """Its bases and members, without what Python and decorators add."""
    members = {
        name: getattr(member, "fget", member)
        for name, member in sorted(vars(kind).items())
        if not name.startswith("__") or name in ("__init__", "__call__")
    }
    return [kind.__bases__, members]


def _is_own(module: str | None) -> bool:
    """Whether a module is the user's: neither this package nor an installed or standard one."""
    top = (module or "").partition(".")[0]
    file = getattr(sys.modules.get(module or ""), "__file__", None) or ""
    known = top in sys.stdlib_module_names and top != "__main__"
    return not (known or top == "tetra_drake" or "site-packages" in file)
