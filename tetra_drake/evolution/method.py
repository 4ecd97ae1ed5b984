"""The method of a run: evaluator, objective and optimiser, each by name and settings.

What was given from Python has a digest of its code and of the values that the code uses, so that
a run is never resumed with anything else.
"""

from __future__ import annotations

import ast
import contextlib
import dataclasses
import functools
import hashlib
import inspect
import json
import sys
import textwrap
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
        if isinstance(value, functools.partial):
            yield from _pieces([value.func, value.args, value.keywords], seen)
        elif isinstance(value, types.MethodType):
            yield from _pieces([value.__func__, value.__self__], seen)
        elif isinstance(value, types.FunctionType):
            yield from _function_pieces(value, seen)
        elif isinstance(value, types.CodeType):
            yield f"{value.co_code.hex()} {value.co_names}"
            yield from _pieces(value.co_consts, seen)
        elif isinstance(value, (set, frozenset)):
            yield repr(sorted(map(repr, value)))
        elif isinstance(value, (np.ndarray, np.generic)):
            yield f"{value.dtype} {value.shape} {value.tobytes().hex()}"
        elif isinstance(value, (types.ModuleType, types.BuiltinFunctionType)):
            yield value.__name__
        elif isinstance(value, type):
            yield from _class_pieces(value, seen)
        else:
            if isinstance(value, (list, tuple)):
                items: Mapping[Any, Any] = dict(enumerate(value))
            elif isinstance(value, Mapping):
                items = value
            else:
                items = {"class": type(value), "values": getattr(value, "__dict__", {})}
            for key in items:
                yield repr(key)
                yield from _pieces(items[key], seen)


def _function_pieces(function: types.FunctionType, seen: dict[int, Any]) -> Iterator[str]:
    """Its source, or else its bytecode, its defaults, and the values it finds outside."""
    yield f"{function.__module__}.{function.__qualname__}"
    if not _is_own(function.__module__):
        return
    try:
        source = textwrap.dedent(inspect.getsource(function))
        with contextlib.suppress(SyntaxError):  # a part of a line
            source = ast.unparse(ast.parse(source))  # without comments
        yield source
    except (OSError, TypeError):  # typed into an interpreter, or read from standard input
        yield from _pieces(function.__code__, seen)
    outside = inspect.getclosurevars(function)
    yield from _pieces([function.__defaults__, function.__kwdefaults__], seen)
    yield from _pieces([dict(outside.nonlocals), dict(outside.globals)], seen)


def _class_pieces(kind: type, seen: dict[int, Any]) -> Iterator[str]:
    yield f"{kind.__module__}.{kind.__qualname__}"
    if not _is_own(kind.__module__):
        return
    yield from _pieces(kind.__bases__, seen)
    for name, member in sorted(vars(kind).items()):
        if not name.startswith("__") or name in ("__init__", "__call__"):
            inner = getattr(member, "fget", getattr(member, "__func__", member))
            yield name
            yield from _pieces(inner, seen)


def _is_own(module: str | None) -> bool:
    """Whether a module is the user's: neither this package nor an installed or standard one."""
    top = (module or "").partition(".")[0]
    file = getattr(sys.modules.get(module or ""), "__file__", None) or ""
    known = top in sys.stdlib_module_names and top != "__main__"
    return not (known or top == "tetra_drake" or "site-packages" in file)
