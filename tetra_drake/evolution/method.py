"""What makes a run besides scenario and seed: evaluator, objective and optimiser.

Each is kept by name and settings, and what was given from Python also by a digest of its code and
of the values that the code uses. So a run is never continued with anything else unnoticed.
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
        kind = given if isinstance(given, (type, types.FunctionType)) else type(given)
        name = f"{kind.__module__}.{kind.__qualname__}"
        settings = {}
        if dataclasses.is_dataclass(given) and not isinstance(given, type):
            values = {f.name: getattr(given, f.name) for f in dataclasses.fields(given)}
            settings = {key: _plain(value) for key, value in values.items()}
        if (kind.__module__ or "").startswith("tetra_drake."):
            return cls(name, settings)
        digest = hashlib.sha256()
        for piece in _pieces(given, {}):
            digest.update(piece.encode() + b"\0")
        return cls(name, settings, digest.hexdigest())


@dataclass(frozen=True)
class Method:
    """The parts of a run that its scenario does not hold."""

    evaluator: Part
    """The engine."""
    objective: Part
    optimizer: Part

    @classmethod
    def of(
        cls, scenario: Scenario, *, objective: object | None = None, optimizer: object | None = None
    ) -> Method:
        """The method of a run; None stands for the scenario's fitness and the thesis's EA."""
        return cls(
            evaluator=Part(scenario.simulation.engine),
            objective=Part("fitness") if objective is None else Part.of(objective),
            optimizer=Part("SteadyState") if optimizer is None else Part.of(optimizer),
        )

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
            problem = f"the run was made with {_described(ours)}, not {_described(theirs)}"
            if ours.name == theirs.name:
                problem = f"the run was made with another version of {ours.name}"
                problem += f" ({json.dumps(ours.settings)})" if ours.settings else ""
            if ours.digest is not None:
                problem += (
                    f"; resume it from Python with the {name} it began with: "
                    f"tetra_drake.evolve(None, {str(source)!r}, resume=True, {name}=...)"
                )
            raise InputError(source, name, problem)

    def to_json(self) -> dict[str, Any]:
        """The method as a manifest holds it."""
        return dataclasses.asdict(self)

    @classmethod
    def from_json(cls, raw: Mapping[str, Any], source: object) -> Method:
        """The method as a manifest holds it; InputError where that makes no sense."""
        parts = {}
        for f in dataclasses.fields(cls):
            try:
                parts[f.name] = Part(**raw[f.name])
            except (KeyError, TypeError) as error:
                raise InputError(source, f.name, "is missing or damaged") from error
        return cls(**parts)


def _described(part: Part) -> str:
    if part.digest is None:
        return {"fitness": "the scenario's fitness"}.get(part.name, part.name)
    return f"{part.name}, given from Python"


def _plain(value: Any) -> Any:
    """The value if JSON can hold it, else its text."""
    try:
        return json.loads(json.dumps(value))
    except (TypeError, ValueError):
        return repr(value)


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
