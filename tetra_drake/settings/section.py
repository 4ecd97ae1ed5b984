"""Sections of settings as pydantic models: tagged kinds, trees, and errors of one line.

A *tree* is the content of a YAML file: mappings, lists, numbers and texts. Quantities are texts
with units. A tagged kind, written `!Name {...}` as in Drake's YAML, is a mapping with its tag under
TAG.
"""

from __future__ import annotations

import functools
import os
import re
import typing
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import pydantic
from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema, ErrorDetails, core_schema

from tetra_drake.errors import InputError
from tetra_drake.settings.quantities import Quantity, unit_of
from tetra_drake.settings.refusals import TAG, described, hint, refuse

Tree = dict[str, Any]
Show = Callable[[float, str], str]
"""Function that makes a text from a number and its SI unit."""


class Section(BaseModel):
    """Section of settings. Numbers are SI; values cannot be changed in place."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    has_base: ClassVar[bool] = False
    """True if a file may have a `base` that provides missing values."""

    tag: ClassVar[str] = ""
    """Name of the kind in files; the name of the class if not given."""

    def __init__(self, **values: Any) -> None:
        try:
            super().__init__(**values)
        except ValidationError as error:
            raise _input_error(error, type(self).__name__) from None

    # Otherwise pydantic would also call it in the validation of a tree.
    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]

    def __setattr__(self, name: str, value: Any = None) -> None:
        problem = "cannot be changed in place; with_changes() of a scenario makes a changed copy"
        raise InputError(type(self).__name__, name, problem)

    __delattr__ = __setattr__

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        cls.tag = cls.__dict__.get("tag", cls.__name__)

    @pydantic.model_validator(mode="wrap")
    @classmethod
    def _explain(
        cls,
        tree: Any,
        validate: pydantic.ModelWrapValidatorHandler[Self],
        info: pydantic.ValidationInfo,
    ) -> Self:
        """Replaces pydantic's errors by one message."""
        try:
            return validate(tree)
        except ValidationError as error:
            errors = error.errors(include_url=False)
            # A value that fits no member of a union has an error per member. The innermost is best.
            of_field = [one for one in errors if one["loc"][:1] == errors[0]["loc"][:1]]
            first = max(of_field, key=lambda one: _place(one, tree)[1])
        key, problem = _in_words(first, cls, tree)
        if first["type"] == "missing" and info.context and info.context["has_base"]:
            whole = f", as !{cls.tag} replaces a base's kind"
            problem += whole if TAG in (tree or {}) else ", or name a `base` that has it"
        refuse(key, problem)

    @pydantic.model_validator(mode="before")
    @classmethod
    def _check_keys(cls, tree: Any) -> Any:
        tree = {} if tree is None else tree
        if not isinstance(tree, dict) or tree.get(TAG, cls.tag) != cls.tag:
            refuse("", f"found {described(tree)}, expected a mapping of keys")
        fields, values = keys_of(cls), {}
        for name, value in tree.items():
            if name != TAG and name not in fields:
                named = [f"'{key}'" for key in dict.fromkeys(_keys_named(str(name), cls))]
                advice = f"did you mean {' or '.join(named)}?" if named else hint(name, fields)
                refuse(str(name), f"unknown key; {advice}")
            if name != TAG:
                values[name] = _with_mappings(python_value(value), fields[name].annotation)
        return values

    def __eq__(self, other: object) -> bool:
        # The order counts: it numbers the bodies and oscillators of a structure.
        return type(other) is type(self) and [*other.values().items()] == [*self.values().items()]

    def __hash__(self) -> int:
        return hash(_hashable(self.values()))

    def values(self) -> dict[str, Any]:
        """Values by dotted keys."""
        return flattened(self.model_dump())

    @functools.cached_property
    def lengths(self) -> tuple[float, ...]:
        """All lengths in m. A copy with disturbed numbers keeps them."""
        numbers = _quantities(self.model_dump())
        return tuple(float(number) for number in numbers if number.unit == "m")

    @classmethod
    def from_tree(cls, tree: Any, source: object, *, key: str = "") -> Self:
        """The section of a tree at `key`. Raises InputError that names `source` and key."""
        # A context means that quantities need units. Without one, numbers are SI.
        try:
            return cls.model_validate(tree, context={"has_base": cls.has_base})
        except ValidationError as error:
            raise _input_error(error, source, key) from None


def _input_error(error: ValidationError, source: object, key: str = "") -> InputError:
    """The error of a section at `key` as an InputError that names `source`."""
    refused = error.errors(include_url=False)[0]["ctx"]
    return InputError(source, joined(key, refused["key"]), refused["problem"])


def _hashable(value: Any) -> Any:
    """Converts lists and mappings to tuples."""
    if isinstance(value, dict):
        value = list(value.items())
    return tuple(map(_hashable, value)) if isinstance(value, (list, tuple)) else value


def keys_of(section: type[Section]) -> dict[str, FieldInfo]:
    """Fields of a section by their keys in files."""
    return {field.alias or name: field for name, field in section.model_fields.items()}


def _with_mappings(value: Any, annotation: Any) -> Any:
    """A value with an empty mapping in place of nothing, where its type is a mapping."""
    if typing.get_origin(annotation) is not dict or not isinstance(value, dict | None):
        return value
    _, of_items = typing.get_args(annotation)
    return {name: _with_mappings(item, of_items) for name, item in (value or {}).items()}


def _keys_named(name: str, section: type[Section]) -> Iterator[str]:
    """Dotted keys in a section that end with a name."""
    for key, field in keys_of(section).items():
        for kind in _union(field.annotation):
            if isinstance(kind, type) and issubclass(kind, Section):
                if name in keys_of(kind):
                    yield f"{key}.{name}"
                yield from (f"{key}.{inner}" for inner in _keys_named(name, kind))


class Kinds:
    """Annotation of a union of sections as tagged kinds. A mapping without a tag is of the first
    kind."""

    def __get_pydantic_core_schema__(
        self, source: Any, handler: pydantic.GetCoreSchemaHandler
    ) -> CoreSchema:
        kinds = {kind.tag: kind for kind in _union(source)}

        def read(value: Any, info: core_schema.ValidationInfo) -> Section:
            if type(value) in kinds.values():
                return typing.cast(Section, value)
            return _kind(value, kinds).model_validate(value, context=info.context)

        def write(section: Section) -> Tree:
            return {TAG: section.tag} | section.model_dump()

        serializer = core_schema.plain_serializer_function_ser_schema(write)
        return core_schema.with_info_plain_validator_function(read, serialization=serializer)


def _kind(value: Any, kinds: Mapping[str, type[Section]]) -> type[Section]:
    """The kind of a mapping. Refuses a key that only another kind has."""
    value = {} if value is None else value
    tags = [f"!{name}" for name in kinds]
    if not isinstance(value, dict):
        refuse("", f"found {described(value)}; {hint('!', tags)}")
    name = value.get(TAG, next(iter(kinds)))
    if f"!{name}" not in tags:
        refuse("", f"found !{name}; {hint(f'!{name}', tags)}")
    for key in value:
        others = [f"!{other}" for other, kind in kinds.items() if key in keys_of(kind)]
        if others and f"!{name}" not in others:
            refuse(key, f"unknown key of !{name}; did you mean {' or '.join(others)}?")
    return kinds[name]


def _union(annotation: Any) -> tuple[Any, ...]:
    """Members of a union type; the type itself if it is no union."""
    return typing.get_args(annotation) or (annotation,)


@dataclass(frozen=True)
class Varied:
    """Annotation of a number that the default disturbances vary. Numbers with the same `name` get
    the same factor."""

    name: str = ""


def varied(section: Section, key: str = "") -> Iterator[tuple[str, str]]:
    """Keys of the numbers in a section that are marked as Varied, with the names of the marks."""
    for name, field in type(section).model_fields.items():
        value, inner = getattr(section, name), joined(key, name)
        yield from ((inner, mark.name) for mark in field.metadata if isinstance(mark, Varied))
        parts = value.items() if isinstance(value, dict) else [("", value)]
        for part, item in parts:
            if isinstance(item, Section):
                yield from varied(item, joined(inner, part))


def python_value(value: Any) -> Any:
    """Converts tuples, arrays and numbers of numpy, and paths to lists, numbers and texts."""
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, (list, tuple)):
        return [python_value(item) for item in value]
    if isinstance(value, Mapping):
        return {name: python_value(item) for name, item in value.items()}
    return value


def _place(error: ErrorDetails, tree: Any) -> tuple[str, int, Any]:
    """Key of an error, number of the key's parts, and the tree's value there."""
    key, depth = "", 0
    for part in error["loc"]:  # also contains names of union members, which are no keys
        if isinstance(tree, list) and isinstance(part, int):
            key = joined(key, f"[{part}]")
        elif isinstance(tree, dict) and part in tree:
            key = joined(key, str(part))
        else:
            continue
        tree, depth = tree[part], depth + 1
    if error["type"] == "missing":
        return joined(key, str(error["loc"][-1])), depth + 1, None
    return key, depth, tree


def _in_words(error: ErrorDetails, section: type[Section], tree: Any) -> tuple[str, str]:
    """Key and problem of an error in the validation of a tree as a section."""
    key, _, value = _place(error, tree)
    context = error.get("ctx", {})
    if error["type"] == "refused":
        return joined(key, context["key"]), context["problem"]
    if error["type"] == "missing":
        return key, "is missing; give it"
    expected = error["msg"].removeprefix("Input should be ")
    if error["type"] in LIMIT_WORDS:
        name, words, _ = LIMIT_WORDS[error["type"]]
        unit = unit_of(keys_of(section)[str(error["loc"][0])])
        if "length" in name:
            unit = f"items, not {len(value or ())}"
        expected = f"{words} {context[name]:.4g} {unit}".rstrip()
    return key, f"found {described(value)}, expected {expected}"


LIMIT_WORDS = {
    "greater_than": ("gt", "more than", "> {}"),
    "greater_than_equal": ("ge", "at least", "≥ {}"),
    "less_than": ("lt", "less than", "< {}"),
    "less_than_equal": ("le", "at most", "≤ {}"),
    "too_short": ("min_length", "at least", "≥ {} items"),
    "too_long": ("max_length", "at most", "≤ {} items"),
}
"""Limits by pydantic's types of errors: pydantic's names of their numbers, words for them in
errors, and their texts on the page of keys."""


def joined(key: str, inner: str) -> str:
    """Joins a key and an inner key, such as "robot" and "gravity", or "pairs" and "[0]"."""
    return f"{key}{inner}" if inner.startswith("[") else f"{key}.{inner}".strip(".")


def parts_of(key: str) -> list[str | int]:
    """Names in a dotted key, and indices of list items: "loads.n3[2]" has "loads", "n3" and 2."""
    parts: list[str | int] = []
    for part in key.split("."):
        name, _, indices = part.partition("[") if _ITEMS.search(part) else (part, "", "")
        parts += [name, *map(int, re.findall(r"\d+", indices))]
    return parts


_ITEMS = re.compile(r"[^\[](\[\d+\])+$")
"""Indices at the end of a key, such as "[2]"."""


def value_at(tree: Any, key: str) -> Any:
    """Value of a tree at a dotted key; None if there is none."""
    for part in parts_of(key):
        if isinstance(tree, dict):
            tree = tree.get(part)
        elif isinstance(tree, list) and isinstance(part, int) and part < len(tree):
            tree = tree[part]
        else:
            return None
    return tree


def written(value: Any, show: Show = "{!r} {}".format) -> Any:
    """A tree's value for a file. `show` makes the texts of quantities."""
    if isinstance(value, Quantity):
        return show(float(value), value.unit) if value.unit else float(value)
    if isinstance(value, dict):
        return {name: written(item, show) for name, item in value.items()}
    if isinstance(value, list):
        return [written(item, show) for item in value]
    return value


def _quantities(value: Any) -> Iterator[Quantity]:
    """All quantities in a tree's value."""
    if isinstance(value, Quantity):
        yield value
    elif isinstance(value, (dict, list)):
        for item in value.values() if isinstance(value, dict) else value:
            yield from _quantities(item)


def flattened(tree: Tree, key: str = "") -> dict[str, Any]:
    """Values of a tree by dotted keys."""
    values: dict[str, Any] = {}
    for name, value in tree.items():
        inner = joined(key, name)
        values |= flattened(value, inner) if isinstance(value, dict) else {inner: value}
    return values
