"""Settings as dataclasses: fields with units and limits, checked, built and written back.

Works on any dataclass whose fields come from the helpers below. Types: float, int, str, bool,
another dataclass, `X | None`, `list[X]`, `dict[str, X]`, and tagged kinds: a union of dataclasses,
written `!Name {...}` as in Drake's YAML. A *tree* is what YAML holds (dicts, lists, scalars) with
all numbers in SI; the dict of a tagged kind has its tag under "_tag", as in pydrake.common.yaml.
"""

from __future__ import annotations

import contextlib
import copy
import dataclasses
import difflib
import operator
import types
import typing
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

import yaml
from pydrake.common.yaml import yaml_load_typed

from tetra_drake.errors import InputError
from tetra_drake.scenario.units import quantity_to_si

T = TypeVar("T")
Tree = dict[str, Any]
Show = Callable[[float, str], str]

REQUIRED: Any = object()
"""The default of a field that has none: a file, or one of its bases, must give it."""

TAG = "_tag"

_SCALARS: dict[Any, tuple[Any, ...]] = {
    int: ("an integer", int),
    float: ("a number", float, int),
    bool: ("true or false", bool),
    str: ("text", str),
}
"""What each type is called, and the types of values that it takes."""


def setting(*, default: Any = REQUIRED, **limits: Any) -> Any:
    """A field of any type. Numbers may be limited by above, at_least, at_most; innermost lists by
    `length`; `words` are texts allowed instead of a number."""
    if default is REQUIRED:  # Drake constructs the dataclass before it sets the values
        return dataclasses.field(default=None, metadata=limits | {"required": True})
    return dataclasses.field(default_factory=lambda: copy.deepcopy(default), metadata=limits)


def quantity(unit: str, *, default: Any = REQUIRED, **limits: Any) -> Any:
    """A field of numbers in the SI unit `unit`, written as text with a unit."""
    return setting(default=default, unit=unit, **limits)


def choice(*choices: str, default: Any = REQUIRED) -> Any:
    """A field that holds one of the texts `choices`."""
    return setting(default=default, choices=choices)


@dataclass(frozen=True)
class Check:
    """Checks raw trees against dataclasses and turns them into SI trees.

    Quantities are texts with units. A `complete` tree has every required field, and its quantities
    may be numbers, in SI. Raises InputError: source and key, what was found and expected.
    """

    source: str
    complete: bool = False

    def section(self, schema: Any, raw: Any, key: str = "") -> Tree:
        """The tree of a dataclass."""
        tag = f"!{schema.__name__}"
        if not isinstance(raw, dict) or raw.get(TAG, tag) != tag:
            raise self._unexpected(key, raw, "a mapping of keys")
        fields = {f.name: f for f in dataclasses.fields(schema)}
        hints = typing.get_type_hints(schema)
        path = {name: f"{key}.{name}" if key else str(name) for name in (*raw, *fields)}
        tree: Tree = {}
        for name in (name for name in raw if name != TAG):
            if name not in fields:
                raise InputError(self.source, path[name], f"unknown key; {_hint(name, fields)}")
            tree[name] = self.value(hints[name], fields[name].metadata, raw[name], path[name])
        for name in [n for n in fields if n not in tree] if self.complete else []:
            if fields[name].metadata.get("required"):
                problem = "is missing; give it, or name a `base` that has it"
                raise InputError(self.source, path[name], problem)
            if dataclasses.is_dataclass(hints[name]):
                tree[name] = self.section(hints[name], {}, path[name])
        return tree

    def value(self, kind: Any, limits: Mapping[str, Any], value: Any, key: str) -> Any:
        """The tree of a value of type `kind`."""
        if dataclasses.is_dataclass(value) and not isinstance(value, type):
            value = {TAG: f"!{type(value).__name__}", **tree_of(value)}
        elif hasattr(value, "tolist"):  # numpy's arrays and numbers
            value = value.tolist()
        if value is None and types.NoneType in _members(kind):
            return None
        kinds = {f"!{k.__name__}": k for k in _members(kind) if k is not types.NoneType}
        if len(kinds) > 1:
            tag = str(value.get(TAG, "")) if isinstance(value, dict) else ""
            if tag not in kinds:
                problem = f"found {tag or _describe(value)}; {_hint(tag, kinds)}"
                raise InputError(self.source, key, problem)
            return {TAG: tag, **self.section(kinds[tag], value, key)}
        (kind,) = kinds.values()
        item, container = typing.get_args(kind)[-1:], typing.get_origin(kind)
        if dataclasses.is_dataclass(kind):
            return self.section(kind, value, key)
        if container is list:
            if not isinstance(value, (list, tuple)):
                raise self._unexpected(key, value, "a list")
            length = limits.get("length", len(value))
            if len(value) != length and typing.get_origin(item[0]) is not list:
                problem = f"found {len(value)} items, expected {length}"
                raise InputError(self.source, key, problem)
            return [self.value(item[0], limits, v, f"{key}[{i}]") for i, v in enumerate(value)]
        if container is dict:
            if not isinstance(value, dict) or any(not isinstance(name, str) for name in value):
                raise self._unexpected(key, value, "a mapping with texts as keys")
            return {
                name: self.value(item[0], limits, v, f"{key}.{name}") for name, v in value.items()
            }
        try:
            return self._scalar(kind, limits, value)
        except ValueError as error:
            raise InputError(self.source, key, str(error)) from error

    def _scalar(self, kind: type, limits: Mapping[str, Any], value: Any) -> Any:
        if isinstance(value, str) and value in limits.get("words", ()):
            return value
        if "unit" in limits and isinstance(value, str):
            return _within(limits, quantity_to_si(value, limits["unit"]), shown=f"'{value}'")
        if "unit" in limits and not self.complete:
            wanted = f"a quantity that converts to {limits['unit']}"
            raise ValueError(f"found {_describe(value)} without a unit, expected {wanted}")
        if kind is float and isinstance(value, str):  # YAML 1.1 takes 1e-3 for text
            with contextlib.suppress(ValueError):
                value = float(value)
        if type(value) not in _SCALARS[kind][1:]:
            raise ValueError(f"found {_describe(value)}, expected {_SCALARS[kind][0]}")
        if kind in (int, float) and not abs(value) < 1e300:  # NaN, infinity, beyond floating point
            raise ValueError(f"found {str(value)[:40]}, expected a finite number")
        if value not in limits.get("choices", (value,)):
            raise ValueError(f"found '{value}', expected one of {', '.join(limits['choices'])}")
        return kind(_within(limits, value, shown=str(value)))

    def _unexpected(self, key: str, found: Any, wanted: str) -> InputError:
        return InputError(self.source, key, f"found {_describe(found)}, expected {wanted}")


def build(schema: type[T], tree: Tree) -> T:
    """The dataclass of a complete tree that has been checked."""
    built: T = yaml_load_typed(
        schema=schema, data=dump_yaml(tree), defaults=schema(), retain_map_defaults=False
    )
    return built


def tree_of(node: Any, show: Show | None = None) -> Tree:
    """The complete tree of a dataclass; with `show`, without defaults and with quantities as the
    text that show(number, unit) gives."""
    hints, blank = typing.get_type_hints(type(node)), type(node)()
    return {
        f.name: _tree(hints[f.name], getattr(node, f.name), f.metadata.get("unit"), show)
        for f in dataclasses.fields(node)
        if show is None or getattr(node, f.name) != getattr(blank, f.name)
    }


def _tree(kind: Any, value: Any, unit: str | None, show: Show | None) -> Any:
    kinds = [k for k in _members(kind) if k is not types.NoneType]
    if dataclasses.is_dataclass(value):
        tag = {TAG: f"!{type(value).__name__}"} if len(kinds) > 1 else {}
        return tag | tree_of(value, show)
    item = typing.get_args(kinds[0])[-1:]
    if isinstance(value, list):
        return [_tree(item[0], v, unit, show) for v in value]
    if isinstance(value, dict):
        return {name: _tree(item[0], v, unit, show) for name, v in value.items()}
    return show(value, unit) if show and unit and value is not None else value


def with_values(tree: Tree, values: Mapping[str, Any], source: str) -> Tree:
    """A copy of the tree with other values, unchecked, for dotted keys."""
    tree = copy.deepcopy(tree)
    for key, value in values.items():
        *sections, name = key.split(".")
        node = tree
        for section in sections:
            if node.get(section) is None:
                node[section] = {}
            node = node[section]
            if not isinstance(node, dict):
                raise InputError(source, key, f"unknown key; '{section}' is not a section")
        node[name] = value
    return tree


def merge(base: Any, changes: Any) -> Any:
    """The base with what `changes` gives; lists, and kinds of another tag, are replaced."""
    if not (isinstance(base, dict) and isinstance(changes, dict)):
        return changes
    if base.get(TAG) != changes.get(TAG):
        return changes
    return base | {k: merge(base[k], v) if k in base else v for k, v in changes.items()}


def parse_yaml(content: str) -> Any:
    """What YAML text holds; raises ValueError if it is not YAML."""
    try:
        return yaml.load(content, _Loader)
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        raise ValueError(f"is not YAML: {error}") from error


def dump_yaml(tree: Tree) -> str:
    """The tree as YAML text."""
    return yaml.dump(tree, Dumper=_Dumper, sort_keys=False)


class _Loader(yaml.SafeLoader):
    """YAML with tagged kinds, in which no key may be given twice."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        keys = [self.construct_object(key, deep=True) for key, _ in node.value]
        for key in keys:
            if keys.count(key) > 1:
                raise yaml.MarkedYAMLError(f"found the key '{key}' twice", node.start_mark)
        return super().construct_mapping(node, deep)

    def construct_kind(self, name: str, node: yaml.Node) -> dict[Any, Any]:
        if isinstance(node, yaml.MappingNode):
            return {TAG: f"!{name}", **self.construct_mapping(node, deep=True)}
        if node.value:
            raise yaml.MarkedYAMLError(f"found !{name} without a mapping of keys", node.start_mark)
        return {TAG: f"!{name}"}


class _Dumper(yaml.SafeDumper):
    """YAML with tagged kinds, and with lists of scalars on one line."""

    def represent_dict(self, data: Any) -> yaml.MappingNode:
        entries = {name: value for name, value in data.items() if name != TAG}
        return self.represent_mapping(data.get(TAG, "tag:yaml.org,2002:map"), entries)

    def represent_list(self, data: Any) -> yaml.SequenceNode:
        flat = not any(isinstance(item, (list, dict)) for item in data)
        return self.represent_sequence("tag:yaml.org,2002:seq", data, flow_style=flat)


_Loader.add_multi_constructor("!", _Loader.construct_kind)
_Dumper.add_representer(dict, _Dumper.represent_dict)
_Dumper.add_representer(list, _Dumper.represent_list)


def _members(kind: Any) -> tuple[Any, ...]:
    """The members of a union type; any other type alone."""
    union = typing.get_origin(kind) in (typing.Union, types.UnionType)
    return typing.get_args(kind) if union else (kind,)


def _describe(value: Any) -> str:
    """What was found, for a message."""
    if isinstance(value, dict):
        return str(value.get(TAG, "a mapping"))
    kinds = {types.NoneType: "nothing", list: "a list", bool: str(value).lower()}
    return kinds.get(type(value), f"'{value}'" if isinstance(value, str) else str(value))


def _within(limits: Mapping[str, Any], value: Any, *, shown: str) -> Any:
    for name, words, holds in (
        ("above", "more than", operator.gt),
        ("at_least", "at least", operator.ge),
        ("at_most", "at most", operator.le),
    ):
        if name in limits and not holds(value, limits[name]):
            raise ValueError(f"found {shown}, expected {words} {limits[name]}")
    return value


def _hint(name: Any, known: Iterable[str]) -> str:
    close = difflib.get_close_matches(str(name), list(known), n=1)
    return f"did you mean '{close[0]}'?" if close else f"expected one of {', '.join(known)}"
