"""Settings as dataclasses: fields with units and limits, checked, built and written back.

Works on any dataclass whose fields come from the helpers below. Types: float, int, str, bool,
another dataclass, `X | None`, `list[X]`, `dict[str, X]`, and tagged kinds: a union of dataclasses,
written `!Name {...}` as in Drake's YAML; without a tag, a mapping is the first of them. A *tree* is
what YAML holds (dicts, lists, scalars) with all numbers in SI; the dict of a tagged kind has its
tag under "_tag". Annotations are read as types, so a module with such dataclasses must not postpone
them.
"""

from __future__ import annotations

import contextlib
import copy
import dataclasses
import difflib
import functools
import operator
import types
import typing
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NoReturn

import yaml

from tetra_drake.errors import InputError
from tetra_drake.scenario.units import quantity_to_si

Tree = dict[str, Any]
Limits = Mapping[str, Any]
Show = Callable[[float, str], str]

TAG = "_tag"

_SCALARS: dict[Any, tuple[Any, ...]] = {
    int: ("an integer", int),
    float: ("a number", float, int),
    bool: ("true or false", bool),
    str: ("text", str),
}
"""What each type is called, and the types of values that it takes."""

_LIMITS: dict[str, tuple[str, Callable[[Any, Any], bool]]] = {
    "above": ("more than", operator.gt),
    "at_least": ("at least", operator.ge),
    "at_most": ("at most", operator.le),
}


def setting(*, default: Any = dataclasses.MISSING, **limits: Any) -> Any:
    """A field of any type, required in a file or its bases if it has no default.

    Numbers may be limited by above, at_least, at_most; innermost lists by `length`; texts by
    `choices`, which a number may have besides; the names in a dict by `units`, the SI unit of each
    one's number, "" for none.
    """
    if default is dataclasses.MISSING:
        return dataclasses.field(metadata=limits)
    factory = functools.partial(copy.deepcopy, default)
    return dataclasses.field(default_factory=factory, metadata=limits, kw_only=True)


def quantity(unit: str, **limits: Any) -> Any:
    """A field of numbers in the SI unit `unit`, written as text with a unit."""
    return setting(unit=unit, **limits)


@dataclasses.dataclass(frozen=True)
class Check:
    """Checks raw values, as YAML holds them, against types; raises InputError.

    Quantities are texts with units, in the resulting tree SI. Dataclasses hold SI numbers, and
    replace what they change as a whole. If `complete`, dataclasses result: every required field
    must be there, and quantities may be numbers, in SI.
    """

    source: object
    complete: bool = False

    def value(
        self, kind: Any, value: Any, key: str = "", limits: Limits = types.MappingProxyType({})
    ) -> Any:
        """The checked value of a type, found at `key`."""
        try:
            return self._value(kind, value, key, limits)
        except InputError:
            raise
        except ValueError as error:
            raise InputError(self.source, key, str(error)) from error

    def _value(self, kind: Any, value: Any, key: str, limits: Limits) -> Any:
        if dataclasses.is_dataclass(value) and not isinstance(value, type):
            value = {TAG: f"!{type(value).__name__}", **tree_of(value)}
            if not self.complete:
                checked = Check(self.source, complete=True).value(kind, value, key, limits)
                return Whole(_tree(kind, checked, limits, None, sparse=False))
        elif hasattr(value, "tolist"):  # numpy's arrays and numbers
            value = value.tolist()
        if value is None and types.NoneType in typing.get_args(kind):
            return None
        kinds = _kinds(kind)
        if len(kinds) > 1:
            return self._tagged_section(kinds, value, key)
        (kind,) = kinds
        if dataclasses.is_dataclass(kind):
            return self._section(kind, value, key)
        if typing.get_origin(kind) is list:
            return self._list(kind, value, key, limits)
        if typing.get_origin(kind) is dict:
            return self._dict(kind, value, key, limits)
        return self._scalar(kind, value, limits)

    def _tagged_section(self, kinds: Iterable[Any], value: Any, key: str) -> Any:
        schemas = {f"!{kind.__name__}": kind for kind in kinds}
        tag = _tag(value, schemas) if isinstance(value, dict) else ""
        if tag not in schemas:
            raise ValueError(f"found {tag or _describe(value)}; {hint(tag, schemas)}")
        section = self._section(schemas[tag], value, key)
        return section if self.complete else {TAG: tag} | section

    def _list(self, kind: Any, value: Any, key: str, limits: Limits) -> list[Any]:
        (item,) = typing.get_args(kind)
        if not isinstance(value, (list, tuple)):
            raise ValueError(f"found {_describe(value)}, expected a list")
        length = limits.get("length", len(value))
        innermost = typing.get_origin(item) is not list
        if innermost and len(value) != length:
            raise ValueError(f"found {len(value)} items, expected {length}")
        return [self.value(item, v, f"{key}[{i}]", limits) for i, v in enumerate(value)]

    def _dict(self, kind: Any, value: Any, key: str, limits: Limits) -> Tree:
        _, item = typing.get_args(kind)
        if not isinstance(value, dict) or any(not isinstance(name, str) for name in value):
            raise ValueError(f"found {_describe(value)}, expected a mapping with texts as keys")
        units = limits.get("units", dict.fromkeys(value, limits.get("unit")))
        tree: Tree = {}
        for name, number in value.items():
            path = f"{key}.{name}"
            if name not in units:
                raise InputError(self.source, path, f"unknown name; {hint(name, units)}")
            tree[name] = self.value(item, number, path, {**limits, "unit": units[name]})
        return tree

    def _section(self, schema: Any, raw: Any, key: str) -> Any:
        tag = f"!{schema.__name__}"
        if not isinstance(raw, dict) or raw.get(TAG, tag) != tag:
            raise ValueError(f"found {_describe(raw)}, expected a mapping of keys")
        fields = {f.name: f for f in dataclasses.fields(schema)}
        path = {name: f"{key}.{name}" if key else str(name) for name in (*raw, *fields)}
        for name in raw:
            if name not in fields and name != TAG:
                advice = _sections_with(name, fields.values()) or hint(name, fields)
                raise InputError(self.source, path[name], f"unknown key; {advice}")
        tree: Tree = {}
        for name, f in fields.items():
            required = self.complete and f.default_factory is dataclasses.MISSING
            if name in raw or (required and dataclasses.is_dataclass(f.type)):
                tree[name] = self.value(f.type, raw.get(name, {}), path[name], f.metadata)
            elif required:
                problem = "is missing; give it, or name a `base` that has it"
                raise InputError(self.source, path[name], problem)
        return schema(**tree) if self.complete else tree

    def _scalar(self, kind: type, value: Any, limits: Limits) -> Any:
        found, choices, unit = _describe(value), limits.get("choices", ()), limits.get("unit")
        if isinstance(value, str) and value in choices:
            return value
        if unit and isinstance(value, str):
            value = quantity_to_si(value, unit)
        elif unit and value != 0 and not self.complete:
            wanted = f"a quantity that converts to {unit}"
            raise ValueError(f"found {found} without a unit, expected {wanted}")
        elif kind is float and isinstance(value, str) and "e" in value:  # YAML 1.1: 1e-3 is text
            with contextlib.suppress(ValueError):
                value = float(value)
        if type(value) not in _SCALARS[kind][1:]:
            raise ValueError(f"found {found}, expected {_SCALARS[kind][0]}")
        if kind is str and choices:
            raise ValueError(f"found {found}, expected one of {', '.join(choices)}")
        if kind in (int, float) and not abs(value) < 1e300:  # NaN, infinity, beyond floating point
            raise ValueError(f"found {found}, expected a finite number")
        for name, (words, holds) in _LIMITS.items():
            if name in limits and not holds(value, limits[name]):
                limit = f"{limits[name]:.4g} {unit or ''}".strip()
                raise ValueError(f"found {found}, expected {words} {limit}")
        return kind(value)


class Whole(Tree):
    """A tree that replaces another one as a whole; see merge()."""


def tree_of(node: Any, show: Show | None = None, *, sparse: bool = False) -> Tree:
    """The tree of a dataclass; `show` gives the text of a quantity from number and unit.

    If `sparse`, values that are their fields' defaults, and tags of first kinds, are left out.
    """
    return {
        f.name: _tree(f.type, value, f.metadata, show, sparse)
        for f, value in ((f, getattr(node, f.name)) for f in dataclasses.fields(node))
        if not (sparse and callable(f.default_factory) and value == f.default_factory())
    }


def _tree(kind: Any, value: Any, limits: Limits, show: Show | None, sparse: bool) -> Any:
    kind, *others = _kinds(kind)
    if dataclasses.is_dataclass(value):
        untagged = not others or (sparse and type(value) is kind)
        tag = {} if untagged else {TAG: f"!{type(value).__name__}"}
        return tag | tree_of(value, show, sparse=sparse)
    if isinstance(value, list):
        return [_tree(typing.get_args(kind)[0], v, limits, show, sparse) for v in value]
    if isinstance(value, dict):
        item, units = typing.get_args(kind)[1], limits.get("units", {})
        own = {k: {**limits, "unit": units.get(k, limits.get("unit"))} for k in value}
        return {k: _tree(item, v, own[k], show, sparse) for k, v in value.items()}
    unit = limits.get("unit")
    return show(value, unit) if show and unit and isinstance(value, float) else value


def tree_of_changes(changes: Mapping[str, Any], base: Tree, source: object) -> Tree:
    """Changes by dotted keys, and mappings of keys, as the tree that a file would hold.

    A tagged kind whose tag is not given is that of the base.
    """
    tree: Tree = {}
    for key, value in changes.items():
        for name in reversed(key.split(".")):
            value = {name: value}
        tree = _joined(tree, value, key, source)
    return _tagged(tree, base)


def _joined(first: Tree, second: Tree, key: str, source: object) -> Tree:
    """Both trees in one; InputError, naming `key`, where both give a value."""
    tree = dict(first)
    for name, value in second.items():
        if name in tree:
            if not (isinstance(tree[name], dict) and isinstance(value, dict)):
                raise InputError(source, key, "is given twice")
            value = _joined(tree[name], value, key, source)
        tree[name] = value
    return tree


def _tagged(tree: Tree, base: Tree) -> Tree:
    """The tree with the tags of the base where it gives none."""
    tagged = {TAG: base[TAG]} | tree if TAG in base else dict(tree)
    for name, value in tree.items():
        if isinstance(value, dict) and isinstance(base.get(name), dict):
            tagged[name] = _tagged(value, base[name])
    return tagged


def with_values(tree: Tree, values: Mapping[str, float]) -> Tree:
    """A copy of the tree with other SI numbers, unchecked, by dotted keys that it has."""
    tree = copy.deepcopy(tree)
    for key, value in values.items():
        *sections, name = key.split(".")
        functools.reduce(operator.getitem, sections, tree)[name] = value
    return tree


def merge(base: Any, changes: Any) -> Any:
    """The base with what `changes` gives; lists, and kinds of another tag, are replaced."""
    both = isinstance(base, dict) and isinstance(changes, dict)
    if not both or isinstance(changes, Whole) or base.get(TAG) != changes.get(TAG):
        return changes
    return base | {k: merge(base[k], v) if k in base else v for k, v in changes.items()}


def parse_yaml(content: str, source: object) -> Any:
    """What YAML text holds; raises InputError if it is not YAML."""
    try:
        return yaml.load(content, _Loader)
    except yaml.MarkedYAMLError as error:
        # Without the lines that the error shows: the file may be any.
        mark = error.problem_mark or error.context_mark
        place = f", line {mark.line + 1}, column {mark.column + 1}" if mark else ""
        raise InputError(source, "", f"is not YAML{place}: {error.problem}") from error
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        raise InputError(source, "", f"is not YAML: {error}") from error


def dump_yaml(tree: Tree) -> str:
    """The tree as YAML text."""
    return yaml.dump(tree, Dumper=_Dumper, sort_keys=False, default_flow_style=None)


class _Loader(yaml.SafeLoader):
    """YAML with tagged kinds, in which no key may be given twice."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        keys = [self.construct_object(key, deep=True) for key, _ in node.value]
        for key in keys:
            if keys.count(key) > 1:
                problem = f"found the key '{key}' twice"
                raise yaml.MarkedYAMLError(problem=problem, problem_mark=node.start_mark)
        return super().construct_mapping(node, deep)

    def construct_kind(self, name: str, node: Any) -> dict[Any, Any]:
        if node.value and not isinstance(node, yaml.MappingNode):
            problem = f"found !{name} without a mapping of keys"
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=node.start_mark)
        return {TAG: f"!{name}"} | (self.construct_mapping(node, deep=True) if node.value else {})


class _Dumper(yaml.SafeDumper):
    """YAML with tagged kinds and without mappings on one line."""

    def represent_dict(self, data: Any) -> yaml.MappingNode:
        entries = {name: value for name, value in data.items() if name != TAG}
        tag = data.get(TAG, "tag:yaml.org,2002:map")
        return self.represent_mapping(tag, entries, flow_style=False)


_Loader.add_multi_constructor("!", _Loader.construct_kind)
_Dumper.add_representer(dict, _Dumper.represent_dict)


def _kinds(kind: Any) -> list[Any]:
    """The members of a union type, None aside; any other type alone."""
    members = typing.get_args(kind) if isinstance(kind, types.UnionType) else (kind,)
    return [member for member in members if member is not types.NoneType]


def _tag(value: Tree, kinds: Mapping[str, Any]) -> str:
    """The tag of a mapping: if not given, the first, unless only another kind has all the keys."""
    fits = [t for t, k in kinds.items() if value.keys() <= {f.name for f in dataclasses.fields(k)}]
    first = next(iter(kinds))
    return str(value.get(TAG, "" if fits and first not in fits else first))


def _describe(value: Any) -> str:
    """What was found, for a message."""
    if isinstance(value, dict):
        return str(value.get(TAG, "a mapping"))[:40]
    kinds = {types.NoneType: "nothing", list: "a list", bool: str(value).lower()}
    return kinds.get(type(value), f"'{value}'" if isinstance(value, str) else str(value)[:40])


def _sections_with(name: Any, fields: Iterable[dataclasses.Field[Any]]) -> str:
    """Which keys of sections may be meant by a name without its section; "" if none has it."""
    keys = [
        f"'{f.name}.{name}'"
        for f in fields
        for kind in _kinds(f.type)
        if dataclasses.is_dataclass(kind) and name in {g.name for g in dataclasses.fields(kind)}
    ]
    return f"did you mean {' or '.join(dict.fromkeys(keys))}?" if keys else ""


def refuse(source: object, key: str, *, found: object, expected: str) -> NoReturn:
    """Raises InputError for a value."""
    raise InputError(source, key, f"found {found}, expected {expected}")


def hint(name: Any, known: Iterable[str]) -> str:
    """What a misspelt name may have been meant for."""
    close = difflib.get_close_matches(str(name), list(known), n=1)
    if close:
        return f"did you mean '{close[0]}'?"
    return f"expected one of {', '.join(known)}" if known else "expected none"
