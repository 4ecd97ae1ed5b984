"""Sections of settings as pydantic models: units, tagged kinds, and errors of one line.

A *tree* is what a YAML file holds: mappings, lists, numbers and texts. Quantities are texts with
units. A tagged kind, written `!Name {...}` as in Drake's YAML, is a mapping with its tag under TAG.
"""

from __future__ import annotations

import difflib
import itertools
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, ClassVar, NoReturn, Self

import pydantic
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema, ErrorDetails, PydanticCustomError, core_schema

from tetra_drake.errors import InputError
from tetra_drake.scenario.units import quantity_to_si

Tree = dict[str, Any]
Show = Callable[[float, str], str]

TAG = "_tag"


def quantity(unit: str | Mapping[str, str], **settings: Any) -> Any:
    """A field of numbers in the SI unit `unit`, which files hold as texts with units.

    unit: units by name for a mapping of numbers; "" for a number without one.
    settings: those of pydantic.Field (default, gt, ge, le).
    """
    return Field(json_schema_extra={"unit": unit}, **settings)  # type: ignore[dict-item]


def refuse(key: str, problem: str) -> NoReturn:
    """Ends a validation with a problem at a key, relative to what is validated."""
    raise PydanticCustomError("refused", "{key}: {problem}", {"key": key, "problem": problem})


class Section(BaseModel):
    """Settings that belong together. Numbers are SI, values cannot be changed in place."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    has_base: ClassVar[bool] = False
    """True if a file may give what another file, its `base`, does not."""

    @pydantic.model_validator(mode="wrap")
    @classmethod
    def _explain(
        cls,
        tree: Any,
        validate: pydantic.ModelWrapValidatorHandler[Self],
        info: pydantic.ValidationInfo,
    ) -> Self:
        """Puts pydantic's first error into words."""
        try:
            return validate(tree)
        except ValidationError as error:
            errors = error.errors(include_url=False)
            # A value that fits no member of a union has an error for each: the innermost says most.
            of_field = [one for one in errors if one["loc"][:1] == errors[0]["loc"][:1]]
            first = max(of_field, key=lambda one: _place(one, tree)[1])
        key, problem = _in_words(first, cls, tree)
        if first["type"] == "missing" and info.context and info.context["has_base"]:
            problem += ", or name a `base` that has it"
        refuse(key, problem)

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
        unit = _unit(cls.model_fields[str(info.field_name)])
        if isinstance(unit, dict) and isinstance(value, dict):
            for name in value:
                if name not in unit:
                    refuse(str(name), f"unknown name; {hint(name, unit)}")

        def read(number: Any, unit: str, key: str) -> Any:
            return _read_number(number, unit, key, needs_unit=bool(info.context))

        return each_number(python_value(value), unit, read)

    @pydantic.model_serializer(mode="wrap")
    def _write_units(
        self, serialize: pydantic.SerializerFunctionWrapHandler, info: pydantic.SerializationInfo
    ) -> Tree:
        tree = serialize(self)
        if not info.context:
            return tree
        show = info.context["show"]

        def write(number: Any, unit: str, key: str) -> Any:
            return show(number, unit) if isinstance(number, float) else number

        for name in tree:
            tree[name] = each_number(tree[name], _unit(type(self).model_fields[name]), write)
        return tree

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self) and other.content() == self.content()

    def __hash__(self) -> int:
        return hash(self.content())

    def content(self) -> tuple[tuple[str, Any], ...]:
        """The values by their dotted keys, in order, by which sections are compared. The order
        counts, as it numbers the bodies and oscillators of a structure."""
        values = flattened(self.model_dump())
        return tuple((key, _hashable(value)) for key, value in values.items())

    @classmethod
    def _advice(cls, name: str) -> str:
        """Advice on an unknown key: a key of a section, or a similar one."""
        keys = [f"'{key}'" for key in dict.fromkeys(_keys_named(name, cls))]
        return f"did you mean {' or '.join(keys)}?" if keys else hint(name, keys_of(cls))

    @classmethod
    def from_tree(cls, tree: Any, source: object, *, key: str = "") -> Self:
        """The section of a tree, found at `key`; raises InputError that names `source` and key."""
        # A context means that quantities need units. Without one, numbers are SI.
        try:
            return cls.model_validate(tree, context={"has_base": cls.has_base})
        except ValidationError as error:
            refused = error.errors(include_url=False)[0]["ctx"]
            raise InputError(source, _joined(key, refused["key"]), refused["problem"]) from None


def _hashable(value: Any) -> Any:
    """A value with tuples in place of lists and mappings."""
    if isinstance(value, dict):
        value = list(value.items())
    return tuple(map(_hashable, value)) if isinstance(value, (list, tuple)) else value


def keys_of(section: type[Section]) -> dict[str, FieldInfo]:
    """The fields of a section by the keys that stand for them in files."""
    return {field.alias or name: field for name, field in section.model_fields.items()}


def _keys_named(name: str, section: type[Section]) -> Iterator[str]:
    """Dotted keys within a section whose last part is a name."""
    for key, field in keys_of(section).items():
        for kind in _union(field.annotation):
            if isinstance(kind, type) and issubclass(kind, Section):
                if name in keys_of(kind):
                    yield f"{key}.{name}"
                yield from (f"{key}.{inner}" for inner in _keys_named(name, kind))


class Kinds:
    """Marks a union of sections as tagged kinds, of which a mapping without a tag is the first."""

    def __get_pydantic_core_schema__(
        self, source: Any, handler: pydantic.GetCoreSchemaHandler
    ) -> CoreSchema:
        kinds = {kind.__name__: kind for kind in _union(source)}

        def read(value: Any, info: core_schema.ValidationInfo) -> Section:
            if type(value) in kinds.values():
                return typing.cast(Section, value)
            return _kind(value, kinds).model_validate(value, context=info.context)

        def write(section: Section, info: core_schema.SerializationInfo) -> Tree:
            return {TAG: type(section).__name__} | section.model_dump(context=info.context)

        serializer = core_schema.plain_serializer_function_ser_schema(write, info_arg=True)
        return core_schema.with_info_plain_validator_function(read, serialization=serializer)


def _kind(value: Any, kinds: Mapping[str, type[Section]]) -> type[Section]:
    """The kind of a mapping; refuses a key that only another kind has."""
    tags = [f"!{name}" for name in kinds]
    if not isinstance(value, dict):
        refuse("", f"found {described(value)}; {hint('!', tags)}")
    name = value.get(TAG, next(iter(kinds)))
    if name not in kinds:
        refuse("", f"found !{name}; {hint(f'!{name}', tags)}")
    for key in value:
        others = [f"!{other}" for other, kind in kinds.items() if key in keys_of(kind)]
        if others and f"!{name}" not in others:
            refuse(key, f"unknown key of !{name}; did you mean {' or '.join(others)}?")
    return kinds[name]


def _union(annotation: Any) -> tuple[Any, ...]:
    """The members of a union type; a type without members alone."""
    return typing.get_args(annotation) or (annotation,)


def _unit(field: FieldInfo) -> Any:
    """The unit of a field's numbers, units by name, or ""."""
    extra = field.json_schema_extra
    return extra.get("unit", "") if isinstance(extra, dict) else ""


def python_value(value: Any) -> Any:
    """A value with Python's lists and numbers in place of tuples and of what numpy has."""
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, (list, tuple)):
        return [python_value(item) for item in value]
    return value


def each_number(
    value: Any, unit: str | Mapping[str, str], change: Callable[[Any, str, str], Any], key: str = ""
) -> Any:
    """A value with change(number, unit, key) in place of each number that has a unit."""
    if isinstance(value, list):
        items = enumerate(value)
        return [each_number(item, unit, change, f"{key}[{i}]") for i, item in items]
    if isinstance(value, dict) and unit:
        units = dict.fromkeys(value, unit) if isinstance(unit, str) else unit
        return {
            name: each_number(item, units[name], change, f"{key}.{name}".strip("."))
            for name, item in value.items()
        }
    return change(value, unit, key) if unit and isinstance(unit, str) else value


def _read_number(value: Any, unit: str, key: str, *, needs_unit: bool) -> Any:
    """A number in the SI unit `unit`; what is no number is left to pydantic."""
    if isinstance(value, str):
        try:
            return quantity_to_si(value, unit)
        except ValueError as error:
            refuse(key, str(error))
    if needs_unit and type(value) in (int, float) and value != 0:
        expected = f"expected a quantity that converts to {unit}"
        refuse(key, f"found {described(value)} without a unit, {expected}")
    return value


def _place(error: ErrorDetails, tree: Any) -> tuple[str, int, Any]:
    """The key that an error is at, its number of parts, and what the tree holds there."""
    key, depth = "", 0
    for part in error["loc"]:  # where pydantic also names the members of unions
        if isinstance(tree, list) and isinstance(part, int):
            key = _joined(key, f"[{part}]")
        elif isinstance(tree, dict) and part in tree:
            key = _joined(key, str(part))
        else:
            continue
        tree, depth = tree[part], depth + 1
    if error["type"] == "missing":
        return _joined(key, str(error["loc"][-1])), depth + 1, None
    return key, depth, tree


def _in_words(error: ErrorDetails, section: type[Section], tree: Any) -> tuple[str, str]:
    """Key and problem of an error in the validation of a tree as a section."""
    key, _, value = _place(error, tree)
    context = error.get("ctx", {})
    if error["type"] == "refused":
        return _joined(key, context["key"]), context["problem"]
    if error["type"] == "missing":
        return key, "is missing; give it"
    expected = error["msg"].removeprefix("Input should be ")
    if error["type"] in _LIMITS:
        words, name = _LIMITS[error["type"]]
        unit = _unit(keys_of(section)[str(error["loc"][0])])
        if "length" in name:
            unit = f"items, not {len(value)}"
        expected = f"{words} {context[name]:.4g} {unit}".rstrip()
    return key, f"found {described(value)}, expected {expected}"


_LIMITS = {
    "greater_than": ("more than", "gt"),
    "greater_than_equal": ("at least", "ge"),
    "less_than_equal": ("at most", "le"),
    "too_short": ("at least", "min_length"),
    "too_long": ("at most", "max_length"),
}
"""Words for the kinds of limits, and the names by which pydantic gives their numbers."""


def _joined(key: str, inner: str) -> str:
    """The key of what has the key `inner` within what is at `key`."""
    return f"{key}{inner}" if inner.startswith("[") else f"{key}.{inner}".strip(".")


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


_MOST_NAMES, _LONGEST_NAME = 2000, 100
"""Upper limits of what is compared with a misspelt name, which takes a while."""


def hint(name: Any, names: Iterable[str]) -> str:
    """Advice on a misspelt name."""
    names = list(itertools.islice(names, _MOST_NAMES))
    close = difflib.get_close_matches(str(name)[:_LONGEST_NAME], names, n=1)
    if close:
        return f"did you mean '{close[0]}'?"
    return f"expected one of {', '.join(names)}" if names else "expected none"


def no_such(what: str, name: str, shipped: Sequence[str]) -> str:
    """The problem with a name, or a path, of what is neither shipped nor a file."""
    last = name.rpartition("/")[2][:_LONGEST_NAME]
    if close := difflib.get_close_matches(last, shipped, n=1):
        return f"no such {what}; did you mean '{close[0]}'?"
    return f"no such {what} (shipped: {', '.join(shipped)})"


class Whole(Tree):
    """A tree that replaces another one as a whole; see merge()."""


def merge(base: Any, changes: Any) -> Any:
    """The base with what `changes` gives; lists, and kinds of another tag, are replaced."""
    if not isinstance(changes, dict):
        return changes
    if not isinstance(base, dict) or isinstance(changes, Whole):
        base = {}
    if TAG in changes and changes[TAG] != base.get(TAG):
        base = {}
    merged = dict(base)
    for name, value in changes.items():
        merged[name] = merge(base.get(name), value)
    return merged


def tree_of(section: Section, *, show: Show = "{!r} {}".format, sparse: bool = False) -> Tree:
    """The tree of a section in full, so that another default does not change what a file means.

    show: gives the text of a quantity from number and unit.
    sparse: True to leave out values that are their fields' defaults.
    """
    return section.model_dump(context={"show": show}, exclude_defaults=sparse)


def flattened(tree: Tree, key: str = "") -> dict[str, Any]:
    """The values of a tree by their dotted keys."""
    values: dict[str, Any] = {}
    for name, value in tree.items():
        inner = _joined(key, name)
        values |= flattened(value, inner) if isinstance(value, dict) else {inner: value}
    return values
