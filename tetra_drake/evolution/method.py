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
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.evolution.optimizers.steady_state import SteadyState
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
        cls, scenario: Scenario, *, objective: object | None = None, optimizer: object = SteadyState
    ) -> Method:
        """The method of a run; without an objective its own is the scenario's fitness."""
        return cls(
            evaluator=Part(scenario.simulation.engine),
            objective=Part("fitness") if objective is None else Part.of(objective),
            optimizer=Part.of(optimizer),
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
            problem = f"the run was made with {ours.name} {json.dumps(ours.settings)}, not {now}"
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
        if isinstance(value, (type, types.FunctionType)):
            yield f"{value.__module__}.{value.__qualname__}"
            if _is_own(value.__module__):
                inner = _class(value, seen) if isinstance(value, type) else _function(value, seen)
                yield from inner
        elif isinstance(value, types.CodeType):
            yield f"{value.co_code.hex()} {value.co_names}"
            yield from _pieces(value.co_consts, seen)
        elif isinstance(value, (set, frozenset)):
            yield repr(sorted(map(repr, value)))
        elif isinstance(value, (np.ndarray, np.generic)):
            yield f"{value.dtype} {value.shape} {value.tobytes().hex()}"
        elif isinstance(value, (types.ModuleType, types.BuiltinFunctionType)):
            yield value.__name__
        else:
            for key, item in _contents(value).items():
                yield repr(key)
                yield from _pieces(item, seen)


def _contents(value: Any) -> Mapping[Any, Any]:
    """What an object consists of."""
    if isinstance(value, Mapping):
        return value
    if isinstance(value, (list, tuple)):
        return dict(enumerate(value))
    if isinstance(value, functools.partial):
        return {"function": value.func, "arguments": value.args, "keywords": value.keywords}
    if isinstance(value, types.MethodType):
        return {"function": value.__func__, "object": value.__self__}
    return {"class": type(value), "values": getattr(value, "__dict__", {})}


def _function(function: types.FunctionType, seen: dict[int, Any]) -> Iterator[str]:
    """Its source, or else its bytecode, its defaults, and the values it finds outside."""
    try:
        yield inspect.getsource(function)
    except (OSError, TypeError):  # typed into an interpreter, or read from standard input
        yield from _pieces(function.__code__, seen)
    outside = inspect.getclosurevars(function)
    defaults = [function.__defaults__, function.__kwdefaults__]
    yield from _pieces([*defaults, dict(outside.nonlocals), dict(outside.globals)], seen)


def _class(kind: type, seen: dict[int, Any]) -> Iterator[str]:
    """Its bases and members, without what Python and decorators add."""
    yield from _pieces(kind.__bases__, seen)
    for name, member in sorted(vars(kind).items()):
        if not name.startswith("__") or name in ("__init__", "__call__"):
            inner = getattr(member, "fget", getattr(member, "__func__", member))
            yield from _pieces([name, inner], seen)


def _is_own(module: str | None) -> bool:
    """Whether a module is the user's: neither this package nor an installed or standard one."""
    top = (module or "").partition(".")[0]
    file = getattr(sys.modules.get(module or ""), "__file__", None) or ""
    known = top in sys.stdlib_module_names and top != "__main__"
    return not (known or top == "tetra_drake" or "site-packages" in file)
