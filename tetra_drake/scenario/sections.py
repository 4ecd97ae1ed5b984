"""Sections of settings as pydantic models: units, tagged kinds, and errors of one line.

A *tree* is what a YAML file holds: mappings, lists, numbers and texts. Quantities are texts with
units. A tagged kind, written `!Name {...}` as in Drake's YAML, is a mapping with its tag under TAG.
"""

from __future__ import annotations

import difflib
import types
import typing
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NoReturn, Self

import pydantic
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from tetra_drake.errors import InputError
from tetra_drake.scenario.units import quantity_to_si

Tree = dict[str, Any]
Show = Callable[[float, str], str]

TAG = "_tag"
FROM_FILE = {"units": True}
"""Context of a validation in which quantities need units. Without it, numbers are SI."""


def quantity(unit: str, *, words: Mapping[str, float] | None = None, **settings: Any) -> Any:
    """A field of numbers in the SI unit `unit`, which files hold as texts with units.

    words: texts that stand for a number. settings: those of pydantic.Field (default, gt, ge, le).
    """
    return Field(json_schema_extra={"unit": unit, "words": dict(words or {})}, **settings)


def named_quantities(units: Mapping[str, str], **settings: Any) -> Any:
    """A field of numbers by name, each in the SI unit of its name; "" for a number without one."""
    return Field(json_schema_extra={"units": dict(units)}, **settings)


def refuse(key: str, problem: str) -> NoReturn:
    """Ends a validation with a problem at a key, relative to the section that is checked."""
    raise PydanticCustomError("refused", "refused", {"key": key, "problem": problem})


class Section(BaseModel):
    """Settings that belong together. Numbers are SI, values cannot be changed in place."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    @pydantic.model_validator(mode="before")
    @classmethod
    def _check_keys(cls, tree: Any) -> Any:
        if not isinstance(tree, dict) or tree.get(TAG, cls.__name__) != cls.__name__:
            refuse("", f"found {described(tree)}, expected a mapping of keys")
        for name in tree:
            if name != TAG and name not in keys_of(cls):
                refuse(str(name), f"unknown key; {cls._advice(str(name))}")
        return {name: value for name, value in tree.items() if name != TAG}

    @pydantic.field_validator("*", mode="before")
    @classmethod
    def _read_units(cls, value: Any, info: pydantic.ValidationInfo) -> Any:
        field = cls.model_fields[str(info.field_name)]
        return _read(value, _extra(field), needs_units=bool(info.context))

    @classmethod
    def _advice(cls, name: str) -> str:
        """Advice on an unknown key: a key of a section, or a similar one."""
        sections = {key: members(field.annotation) for key, field in keys_of(cls).items()}
        keys = [
            f"'{key}.{name}'"
            for key, kinds in sections.items()
            if any(is_section(kind) and name in keys_of(kind) for kind in kinds)
        ]
        return f"did you mean {' or '.join(keys)}?" if keys else hint(name, keys_of(cls))

    @classmethod
    def from_tree(cls, tree: Any, source: object, *, key: str = "") -> Self:
        """The section of a tree, found at `key`; raises InputError that names `source` and key."""
        try:
            return cls.model_validate(tree, context=FROM_FILE)
        except ValidationError as error:
            problem = input_error(error, cls, tree, source)
            raise InputError(source, _joined(key, problem.key), problem.problem) from None


def keys_of(section: type[Section]) -> dict[str, FieldInfo]:
    """The fields of a section by the keys that stand for them in files."""
    return {field.alias or name: field for name, field in section.model_fields.items()}


class Kinds:
    """Marks a union of sections as tagged kinds, of which a mapping without a tag is the first."""

    def __get_pydantic_core_schema__(
        self, source: Any, handler: pydantic.GetCoreSchemaHandler
    ) -> CoreSchema:
        kinds = {kind.__name__: kind for kind in members(source)}

        def name(value: Any) -> str:
            if isinstance(value, Section):
                return type(value).__name__
            return str(value.get(TAG) or _untagged(value, kinds))

        def check(value: Any) -> Any:
            if not isinstance(value, (dict, Section)) or name(value) not in kinds:
                wanted = name(value) if isinstance(value, (dict, Section)) else ""
                refuse("", f"found {described(value)}; {hint(f'!{wanted}', tags(kinds))}")
            if isinstance(value, dict):
                _check_kind(value, name(value), kinds)
            return value

        choices = {kind: handler(section) for kind, section in kinds.items()}
        union = core_schema.tagged_union_schema(choices, discriminator=name)
        return core_schema.no_info_before_validator_function(check, union)


def _check_kind(tree: Tree, name: str, kinds: Mapping[str, type[Section]]) -> None:
    """Refuses a key that only another kind has."""
    for key in tree:
        others = [other for other, kind in kinds.items() if key in keys_of(kind)]
        if others and name not in others:
            refuse(key, f"unknown key of !{name}; did you mean {' or '.join(tags(others))}?")


def tags(kinds: Iterable[str]) -> list[str]:
    """The tags of kinds as they are written."""
    return [f"!{name}" for name in kinds]


def _untagged(tree: Tree, kinds: Mapping[str, type[Section]]) -> str:
    """The kind of a mapping without a tag: the first, unless only another one has all its keys."""
    fitting = [name for name, kind in kinds.items() if tree.keys() <= keys_of(kind).keys()]
    first = next(iter(kinds))
    return first if first in fitting or not fitting else ""


def members(annotation: Any) -> list[Any]:
    """The members of a union type, None aside; any other type alone."""
    if typing.get_origin(annotation) is typing.Annotated:
        annotation = typing.get_args(annotation)[0]
    if typing.get_origin(annotation) in (typing.Union, types.UnionType):
        nested = [members(member) for member in typing.get_args(annotation)]
        return [kind for kinds in nested for kind in kinds if kind is not types.NoneType]
    return [annotation]


def is_section(kind: Any) -> bool:
    """True if a type is a section."""
    return isinstance(kind, type) and issubclass(kind, Section)


def _extra(field: FieldInfo) -> dict[str, Any]:
    return field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}


def _read(value: Any, extra: Mapping[str, Any], *, needs_units: bool, key: str = "") -> Any:
    """A value with its quantities in SI."""
    if hasattr(value, "tolist"):  # numpy's arrays and numbers
        value = value.tolist()
    if isinstance(value, tuple):
        value = list(value)
    if isinstance(value, list):
        items = enumerate(value)
        return [_read(v, extra, needs_units=needs_units, key=f"{key}[{i}]") for i, v in items]
    if isinstance(value, dict) and "units" in extra:
        for name in value:
            if name not in extra["units"]:
                refuse(f"{key}.{name}", f"unknown name; {hint(name, extra['units'])}")
    if isinstance(value, dict) and extra:
        units = extra.get("units") or dict.fromkeys(value, extra.get("unit"))
        return {
            name: _read(v, {"unit": units[name]}, needs_units=needs_units, key=f"{key}.{name}")
            for name, v in value.items()
        }
    return _number(value, extra, needs_units, key)


def _number(value: Any, extra: Mapping[str, Any], needs_units: bool, key: str) -> Any:
    unit = extra.get("unit")
    if not unit:
        return value
    if isinstance(value, str) and value in extra.get("words", {}):
        return extra["words"][value]
    if isinstance(value, str):
        try:
            return quantity_to_si(value, unit)
        except ValueError as error:
            refuse(key, str(error))
    if needs_units and type(value) in (int, float) and value != 0:
        expected = f"expected a quantity that converts to {unit}"
        refuse(key, f"found {described(value)} without a unit, {expected}")
    return value


def input_error(
    error: ValidationError, section: type[Section], tree: Any, source: object
) -> InputError:
    """The first problem of a validation as an error of one line."""
    errors = error.errors(include_url=False)
    of_one_field = [each for each in errors if each["loc"][:1] == errors[0]["loc"][:1]]
    # A value that fits no member of a union has an error for each: the innermost says most.
    first = max(of_one_field, key=lambda each: _depth(_place(each["loc"], section, tree)[0]))
    key, value, field = _place(first["loc"], section, tree)
    if first["type"] == "refused":
        context = first["ctx"]
        return InputError(source, _joined(key, context["key"]), context["problem"])
    if first["type"] == "missing":
        return InputError(source, key, "is missing; give it, or name a `base` that has it")
    expected = first["msg"].removeprefix("Input should be ")
    if first["type"] in _LIMITS:
        unit = _extra(field).get("unit", "") if field else ""
        words, name = _LIMITS[first["type"]]
        expected = f"{words} {first['ctx'][name]:.4g} {unit}".rstrip()
    elif "actual_length" in first.get("ctx", {}):
        length = first["ctx"].get("min_length", first["ctx"].get("max_length"))
        expected = f"{length} items, not {first['ctx']['actual_length']}"
    return InputError(source, key, f"found {described(value)}, expected {expected}")


_LIMITS = {
    "greater_than": ("more than", "gt"),
    "greater_than_equal": ("at least", "ge"),
    "less_than_equal": ("at most", "le"),
}
"""Words for the kinds of limits, and the names by which pydantic gives their numbers."""


def _depth(key: str) -> int:
    return key.count(".") + key.count("[")


def _place(
    location: tuple[int | str, ...], section: Any, tree: Any
) -> tuple[str, Any, FieldInfo | None]:
    """The key of a location with its value in the tree and its field.

    Names of kinds and types, which pydantic puts into a location, are no keys.
    """
    key, field = "", None
    kinds = [section]
    for part in location:
        holder = next((k for k in kinds if is_section(k) and part in keys_of(k)), None)
        if holder is None and not _holds(tree, part):
            kinds = [k for k in kinds if getattr(k, "__name__", "") == part] or kinds
            continue
        if holder is not None:
            field = keys_of(holder)[str(part)]
            kinds = members(field.annotation)
        else:
            kinds = [m for k in kinds for a in typing.get_args(k) for m in members(a)]
        key = f"{key}[{part}]" if isinstance(part, int) else _joined(key, part)
        tree = tree[part] if _holds(tree, part) else None
    return key, tree, field


def _holds(tree: Any, part: int | str) -> bool:
    if isinstance(tree, list):
        return isinstance(part, int) and part < len(tree)
    return isinstance(tree, dict) and part in tree


def _joined(key: str, name: str) -> str:
    return f"{key}{name}" if name.startswith(("[", ".")) else f"{key}.{name}".strip(".")


def described(value: Any) -> str:
    """A value of a tree in words, for a message."""
    if isinstance(value, dict):
        return f"!{value[TAG]}" if TAG in value else "a mapping"
    if value is None:
        return "nothing"
    if isinstance(value, list):
        return "a list"
    if isinstance(value, bool):
        return str(value).lower()
    return f"'{value}'" if isinstance(value, str) else str(value)[:40]


def hint(name: Any, known: Iterable[str]) -> str:
    """Advice on a misspelt name."""
    names = list(known)
    close = difflib.get_close_matches(str(name), names, n=1)
    if close:
        return f"did you mean '{close[0]}'?"
    return f"expected one of {', '.join(names)}" if names else "expected none"


class Whole(Tree):
    """A tree that replaces another one as a whole; see merge()."""


def merge(base: Any, changes: Any) -> Any:
    """The base with what `changes` gives; lists, and kinds of another tag, are replaced."""
    both = isinstance(base, dict) and isinstance(changes, dict)
    if not both or isinstance(changes, Whole) or changes.get(TAG, base.get(TAG)) != base.get(TAG):
        return changes
    return base | {k: merge(base[k], v) if k in base else v for k, v in changes.items()}


def tree_of(section: Section, *, show: Show = "{!r} {}".format, sparse: bool = True) -> Tree:
    """The tree of a section; `show` gives the text of a quantity from number and unit.

    If `sparse`, values that are their fields' defaults are left out. Kinds are given in full, so
    that another default does not change what a record means.
    """
    tree: Tree = {}
    for name, field in type(section).model_fields.items():
        value = getattr(section, name)
        if sparse and not field.is_required() and value == field.get_default():
            continue
        tree[name] = _tree(value, field.annotation, _extra(field), show, sparse)
    return tree


def _tree(value: Any, kind: Any, extra: Mapping[str, Any], show: Show, sparse: bool) -> Any:
    """The tree of a value of a type."""
    kinds = members(kind)
    items = typing.get_args(kinds[0])
    if isinstance(value, Section):
        if len(kinds) == 1:
            return tree_of(value, show=show, sparse=sparse)
        return {TAG: type(value).__name__} | tree_of(value, show=show, sparse=False)
    if isinstance(value, list):
        return [_tree(item, items[-1], extra, show, sparse) for item in value]
    if isinstance(value, dict):
        units = extra.get("units") or dict.fromkeys(value, extra.get("unit"))
        return {
            name: _tree(item, items[-1], {"unit": units[name]}, show, sparse)
            for name, item in value.items()
        }
    unit = extra.get("unit")
    return show(value, unit) if unit and isinstance(value, float) else value


def tree_of_changes(changes: Mapping[str, Any], source: object) -> Tree:
    """Changes by dotted keys, and mappings of keys, as the tree that a file would hold."""
    tree: Tree = {}
    for key, value in changes.items():
        value = _given(value)
        for name in reversed(key.split(".")):
            value = {name: value}
        tree = _joined_trees(tree, value, key, source)
    return tree


def _given(value: Any) -> Any:
    """A value from Python as a file would hold it."""
    if isinstance(value, Section):
        return Whole({TAG: type(value).__name__} | tree_of(value, sparse=False))
    if isinstance(value, str) and value.startswith("!"):
        return {TAG: value.removeprefix("!")}
    if isinstance(value, (list, tuple)):
        return [_given(item) for item in value]
    if isinstance(value, Mapping):
        return {name: _given(item) for name, item in value.items()}
    return value


def _joined_trees(first: Tree, second: Tree, key: str, source: object) -> Tree:
    """Both trees in one; InputError, naming `key`, where both give a value."""
    tree = dict(first)
    for name, value in second.items():
        if name in tree:
            plain = isinstance(tree[name], dict) and isinstance(value, dict)
            if not plain or Whole in (type(tree[name]), type(value)):
                raise InputError(source, key, "is given twice")
            value = _joined_trees(tree[name], value, key, source)
        tree[name] = value
    return tree
