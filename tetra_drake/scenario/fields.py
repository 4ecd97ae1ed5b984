"""Settings as dataclasses: fields with units and limits, checked, built and written back.

Everything here works on any dataclass whose fields come from the helpers below. Their types:
float, int, str, bool, another dataclass, `X | None`, lists and maps (`list[X]`, `dict[str, X]`),
and tagged kinds: a union of dataclasses, written `!Name {...}` as Drake's YAML does.

A *tree* is what YAML holds, with all numbers in SI: dicts, lists and scalars; the dict of a tagged
kind has its tag under the key "_tag", as in pydrake.common.yaml.
"""

from __future__ import annotations

import contextlib
import copy
import dataclasses
import difflib
import types
import typing
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

import yaml
from pydrake.common.yaml import yaml_load_typed

from tetra_drake.errors import InputError
from tetra_drake.scenario.units import quantity_to_si

T = TypeVar("T")
Tree = dict[str, Any]

REQUIRED: Any = object()
"""The default of a field that has none: a file, or one of its bases, must give it."""

TAG = "_tag"


def _field(placeholder: Any, default: Any, metadata: dict[str, Any]) -> Any:
    """A field that Drake can construct without a value; `required` says that it needs one."""
    if default is REQUIRED:
        return dataclasses.field(default=placeholder, metadata=metadata | {"required": True})
    if isinstance(default, (list, dict)):
        return dataclasses.field(default_factory=lambda: copy.deepcopy(default), metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


def quantity(unit: str, *, default: Any = REQUIRED, **limits: Any) -> Any:
    """Numbers of the SI unit `unit`, written as text with a unit.

    Limits: above, at_least, at_most; `words` (texts allowed instead); `length` of innermost lists.
    """
    return _field(float("nan"), default, {"unit": unit, **limits})


def number(*, default: Any = REQUIRED, **limits: Any) -> Any:
    """Numbers without a unit; limits as for a quantity."""
    return _field(float("nan"), default, limits)


def count(*, at_least: int, default: Any = REQUIRED) -> Any:
    """Integers."""
    return _field(0, default, {"at_least": at_least})


def choice(*choices: str, default: Any = REQUIRED) -> Any:
    """One of the texts `choices`."""
    return _field("", default, {"choices": choices})


def text(*, default: Any = REQUIRED) -> Any:
    """Any text."""
    return _field("", default, {})


def flag(*, default: Any = REQUIRED) -> Any:
    """True or false."""
    return _field(False, default, {})


@dataclass(frozen=True)
class Check:
    """Checks raw trees against dataclasses and turns them into SI trees.

    Every method raises InputError with the key at fault, what was found, and what was expected.
    """

    source: str
    """What errors name: a file, as a rule."""
    numbers_are_si: bool = False
    """Whether a quantity may be a number, in SI, besides text with a unit."""
    complete: bool = False
    """Whether every required field must be there."""

    def section(self, schema: type, raw: Any, key: str = "") -> Tree:
        """The tree of a dataclass."""
        if (
            not isinstance(raw, dict)
            or raw.get(TAG, f"!{schema.__name__}") != f"!{schema.__name__}"
        ):
            raise self._error(key, f"found {describe(raw)}, expected a mapping of keys")
        prefix = f"{key}." if key else ""
        fields = {f.name: f for f in dataclasses.fields(schema)}
        hints = typing.get_type_hints(schema)
        tree: Tree = {}
        for name, value in raw.items():
            if name in fields:
                tree[name] = self.value(
                    hints[name], fields[name].metadata, value, key=f"{prefix}{name}"
                )
            elif name != TAG:
                raise self._error(
                    f"{prefix}{name}", f"unknown key{_suggestion(str(name), list(fields))}"
                )
        for name in fields if self.complete else ():
            if name not in tree and fields[name].metadata.get("required"):
                raise self._error(
                    f"{prefix}{name}", "is missing; give it, or name a `base` that has it"
                )
            if name not in tree and dataclasses.is_dataclass(hints[name]):
                tree[name] = self.section(hints[name], {}, f"{prefix}{name}")
        return tree

    def value(self, kind: Any, limits: Mapping[str, Any], value: Any, *, key: str) -> Any:
        """The tree of a value of type `kind`."""
        value = _plain(value)
        kinds = [k for k in _union(kind) if k is not types.NoneType]
        if value is None and len(kinds) < len(_union(kind)):
            return None
        if len(kinds) > 1:
            return self._tagged(kinds, value, key)
        kind = kinds[0]
        if dataclasses.is_dataclass(kind):
            return self.section(typing.cast(type, kind), value, key)
        if typing.get_origin(kind) is list:
            return self._list(kind, limits, value, key)
        if typing.get_origin(kind) is dict:
            return self._map(kind, limits, value, key)
        try:
            return self._scalar(kind, limits, value)
        except ValueError as error:
            raise self._error(key, str(error)) from error

    def _tagged(self, kinds: list[type], value: Any, key: str) -> Tree:
        tags = {f"!{kind.__name__}": kind for kind in kinds}
        if not isinstance(value, dict) or TAG not in value:
            raise self._error(key, f"found {describe(value)}, expected one of {', '.join(tags)}")
        tag = str(value[TAG])
        if tag not in tags:
            raise self._error(key, f"unknown kind {tag}{_suggestion(tag, list(tags))}")
        return {TAG: tag, **self.section(tags[tag], value, key)}

    def _list(self, kind: Any, limits: Mapping[str, Any], value: Any, key: str) -> list[Any]:
        if not isinstance(value, list):
            raise self._error(key, f"found {describe(value)}, expected a list")
        (item,) = typing.get_args(kind)
        innermost = typing.get_origin(item) is not list
        if innermost and len(value) != limits.get("length", len(value)):
            raise self._error(key, f"found {len(value)} items, expected {limits['length']}")
        return [self.value(item, limits, v, key=f"{key}[{i}]") for i, v in enumerate(value)]

    def _map(self, kind: Any, limits: Mapping[str, Any], value: Any, key: str) -> Tree:
        if not isinstance(value, dict) or TAG in value:
            raise self._error(key, f"found {describe(value)}, expected a mapping of keys")
        _, item = typing.get_args(kind)
        for name in value:
            if not isinstance(name, str):
                raise self._error(key, f"found the key {describe(name)}, expected text")
        return {name: self.value(item, limits, v, key=f"{key}.{name}") for name, v in value.items()}

    def _scalar(self, kind: type, limits: Mapping[str, Any], value: Any) -> Any:
        if isinstance(value, str) and value in limits.get("words", ()):
            return value
        if "unit" in limits and isinstance(value, str):
            return _within(quantity_to_si(value, limits["unit"]), limits, shown=f"'{value}'")
        if "unit" in limits and not self.numbers_are_si:
            wanted = f"a quantity that converts to {limits['unit']}"
            raise ValueError(f"found {describe(value)} without a unit, expected {wanted}")
        if kind in (int, float):
            found = _finite_number(kind, value)
            return kind(_within(found, limits, shown=str(found)))
        if not isinstance(value, kind):
            wanted = "true or false" if kind is bool else "text"
            raise ValueError(f"found {describe(value)}, expected {wanted}")
        if "choices" in limits and value not in limits["choices"]:
            raise ValueError(f"found '{value}', expected one of {', '.join(limits['choices'])}")
        return value

    def _error(self, key: str, problem: str) -> InputError:
        return InputError(self.source, key, problem)


def build(schema: type[T], tree: Tree) -> T:
    """The dataclass of a complete tree that has been checked."""
    built: T = yaml_load_typed(
        schema=schema, data=dump_yaml(tree), defaults=schema(), retain_map_defaults=False
    )
    return built


def tree_of(node: Any, write: Callable[[Any, str], Any] = lambda value, unit: value) -> Tree:
    """The complete tree of a dataclass, without what is None.

    `write` turns each value of a field with a unit into what the tree shall hold.
    """
    hints = typing.get_type_hints(type(node))
    tree: Tree = {}
    for f in dataclasses.fields(node):
        if getattr(node, f.name) is not None:
            kinds = _tagged_kinds(hints[f.name])
            tree[f.name] = _value_tree(getattr(node, f.name), f.metadata.get("unit"), kinds, write)
    return tree


def with_values(tree: Tree, values: Mapping[str, Any], *, source: str) -> Tree:
    """A copy of the tree with the values of dotted keys replaced; not checked yet."""
    tree = copy.deepcopy(tree)
    for key, value in values.items():
        *sections, name = key.split(".")
        node = tree
        for section in sections:
            if node.get(section) is None:
                node[section] = {}
            node = node[section]
            if not isinstance(node, dict):
                raise InputError(source, key, f"'{section}' is a value, expected a section")
        node[name] = value
    return tree


def merge(base: Tree, changes: Tree) -> Tree:
    """The base with what `changes` gives; a list, or a kind with another tag, replaces."""
    if changes.get(TAG) != base.get(TAG):
        return changes
    both = {n for n in base.keys() & changes.keys() if isinstance(base[n], dict)}
    merged = {n: merge(base[n], changes[n]) for n in both if isinstance(changes[n], dict)}
    return {**base, **changes, **merged}


def parse_yaml(content: str) -> Any:
    """What YAML text holds, tagged kinds included; raises ValueError if it is not YAML."""
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
                raise yaml.constructor.ConstructorError(
                    None, None, f"found the key '{key}' twice", node.start_mark
                )
        return super().construct_mapping(node, deep)

    def construct_kind(self, suffix: str, node: yaml.Node) -> dict[Any, Any]:
        if isinstance(node, yaml.MappingNode):
            return {TAG: f"!{suffix}", **self.construct_mapping(node, deep=True)}
        if node.value:
            raise yaml.constructor.ConstructorError(
                None, None, f"found !{suffix} without a mapping of keys", node.start_mark
            )
        return {TAG: f"!{suffix}"}


_Loader.add_multi_constructor("!", _Loader.construct_kind)


class _Dumper(yaml.SafeDumper):
    """YAML with tagged kinds, and lists of scalars on one line."""

    def represent_dict(self, data: Any) -> yaml.MappingNode:
        entries = {name: value for name, value in data.items() if name != TAG}
        return self.represent_mapping(data.get(TAG, "tag:yaml.org,2002:map"), entries)

    def represent_list(self, data: Any) -> yaml.SequenceNode:
        flat = not any(isinstance(item, (list, dict)) for item in data)
        return self.represent_sequence("tag:yaml.org,2002:seq", data, flow_style=flat)


_Dumper.add_representer(dict, _Dumper.represent_dict)
_Dumper.add_representer(list, _Dumper.represent_list)


def describe(value: Any) -> str:
    """What was found, for a message."""
    if value is None:
        return "nothing"
    if isinstance(value, dict):
        return str(value.get(TAG, "a mapping"))
    kinds = {list: "a list", bool: str(value).lower()}
    return kinds.get(type(value), f"'{value}'" if isinstance(value, str) else str(value))


def _value_tree(value: Any, unit: str | None, kinds: list[type], write: Any) -> Any:
    if dataclasses.is_dataclass(value):
        tag = {TAG: f"!{type(value).__name__}"} if type(value) in kinds else {}
        return {**tag, **tree_of(value, write)}
    if isinstance(value, list):
        return [_value_tree(item, unit, kinds, write) for item in value]
    if isinstance(value, dict):
        return {name: _value_tree(item, unit, kinds, write) for name, item in value.items()}
    return value if unit is None else write(value, unit)


def _union(kind: Any) -> tuple[Any, ...]:
    """The members of a union; of anything else, itself."""
    union = typing.get_origin(kind) in (typing.Union, types.UnionType)
    return typing.get_args(kind) if union else (kind,)


def _tagged_kinds(kind: Any) -> list[type]:
    """The dataclasses between which tags choose, anywhere in a type."""
    kinds = [k for k in _union(kind) if k is not types.NoneType]
    if len(kinds) > 1:
        return kinds
    return [k for item in typing.get_args(kinds[0]) for k in _tagged_kinds(item)]


def _plain(value: Any) -> Any:
    """A value from Python as YAML would give it."""
    if dataclasses.is_dataclass(value):
        return {TAG: f"!{type(value).__name__}", **tree_of(value)}
    if hasattr(value, "tolist"):  # numpy's arrays and scalars
        value = value.tolist()
    return list(value) if isinstance(value, tuple) else value


def _finite_number(kind: type, value: Any) -> float:
    if kind is float and isinstance(value, str):  # YAML 1.1 takes 1e-3 for text
        with contextlib.suppress(ValueError):
            value = float(value)
    if isinstance(value, bool) or not isinstance(value, (kind, int)):
        wanted = "an integer" if kind is int else "a number"
        raise ValueError(f"found {describe(value)}, expected {wanted}")
    found = typing.cast(float, value)
    if not abs(found) < 1e300:  # NaN, infinity, and integers beyond floating point
        raise ValueError(f"found {str(found)[:40]}, expected a finite number")
    return found


def _within(found: float, limits: Mapping[str, Any], *, shown: str) -> float:
    if "above" in limits and not found > limits["above"]:
        raise ValueError(f"found {shown}, expected more than {limits['above']}")
    if "at_least" in limits and not found >= limits["at_least"]:
        raise ValueError(f"found {shown}, expected at least {limits['at_least']}")
    if "at_most" in limits and not found <= limits["at_most"]:
        raise ValueError(f"found {shown}, expected at most {limits['at_most']}")
    return found


def _suggestion(name: str, known: list[str]) -> str:
    close = difflib.get_close_matches(name, known, n=1)
    return f"; did you mean '{close[0]}'?" if close else f"; expected one of {', '.join(known)}"
