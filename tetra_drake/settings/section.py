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
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, NamedTuple, Self, Union

import pydantic
from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema, ErrorDetails

from tetra_drake.errors import InputError
from tetra_drake.settings.quantities import EMPTY, Quantity, unit_of
from tetra_drake.settings.refusals import TAG, described, hint
from tetra_drake.settings.units import plainest

Tree = dict[str, Any]
Show = Callable[[float, str], str]
"""Function that makes a text from a number and its SI unit."""

_PYDANTIC_NAMES = {"gt": "exclusiveMinimum", "ge": "minimum", "le": "maximum", "oneOf": "anyOf"}
"""What pydantic writes in a JSON Schema, and what belongs there. Tags are no part of a mapping, so
a mapping may fit several kinds."""


def _complete_schema(schema: Tree, section: type[Section]) -> None:
    """Changes pydantic's JSON Schema of a section to what files may contain."""
    del schema["title"]
    schema.pop("required", None)  # a base may have the keys
    schema |= EMPTY
    for key, text in section.keys_of_files.items():
        schema["properties"][key] = {"type": "string", "default": None, "description": text}
    _correct_schema(schema)


def _correct_schema(node: Any) -> None:
    """Corrects a part of pydantic's JSON Schema. Defaults become texts with units."""
    if isinstance(node, list):
        for item in node:
            _correct_schema(item)
    if not isinstance(node, dict):
        return
    for name, correct in _PYDANTIC_NAMES.items():
        if name in node:
            node[correct] = node.pop(name)
    if not str(node.get("title", "!")).startswith("!"):
        del node["title"]
    default = node.get("default")
    if "anyOf" in node and isinstance(default, dict):
        del node["default"]
    if "unit" in node and isinstance(default, float):
        node["default"] = plainest(default, node["unit"])
    for item in node.values():
        _correct_schema(item)


class Section(BaseModel):
    """Section of settings. Numbers are SI; values cannot be changed in place."""

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        strict=True,
        allow_inf_nan=False,
        use_attribute_docstrings=True,
        json_schema_extra=_complete_schema,
    )

    keys_of_files: ClassVar[dict[str, str]] = {}
    """Keys that only files have, and what they are."""

    tag: ClassVar[str] = ""
    """Name of the kind in files; the name of the class if not given."""

    def __init__(self, **values: Any) -> None:
        values = python_value(values)
        try:
            super().__init__(**values)
        except ValidationError as error:
            raise _input_error(error, type(self), values, type(self).__name__) from None

    # Otherwise pydantic would also call it in the validation of a tree.
    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]

    def __setattr__(self, name: str, value: Any = None) -> None:
        problem = "cannot be changed in place; with_changes() of a scenario makes a changed copy"
        raise InputError(type(self).__name__, name, problem)

    __delattr__ = __setattr__

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        cls.tag = cls.__dict__.get("tag", cls.__name__)

    @pydantic.model_validator(mode="before")
    @classmethod
    def _without_tag(cls, tree: Any) -> Any:
        """The keys of a mapping. Nothing is a section of defaults."""
        if not isinstance(tree, dict) or tree.get(TAG) != cls.tag:
            return {} if tree is None else tree
        return {name: value for name, value in tree.items() if name != TAG}

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
        tree = python_value(tree)
        try:
            return cls.model_validate(tree, context=IN_FILE)
        except ValidationError as error:
            raise _input_error(error, cls, tree, source, key) from None


IN_FILE = "in a file"
"""Context of a validation where quantities need units. Without it, numbers are SI."""


class Kinds:
    """Annotation of a union of sections as tagged kinds. A mapping without a tag is of the first
    kind."""

    def __get_pydantic_core_schema__(
        self, source: Any, handler: pydantic.GetCoreSchemaHandler
    ) -> CoreSchema:
        kinds = typing.get_args(source)

        def tag_of(value: Any) -> str | None:
            if isinstance(value, dict | None):
                return str((value or {}).get(TAG, kinds[0].tag))
            return value.tag if isinstance(value, Section) else None

        def write(section: Section, dump: pydantic.SerializerFunctionWrapHandler) -> Any:
            return {TAG: section.tag} | dump(section)

        tagged = [Annotated[kind, Tag(kind.tag), Field(title=f"!{kind.tag}")] for kind in kinds]
        union = Union[tuple(tagged)]  # noqa: UP007
        return handler.generate_schema(
            Annotated[union, Discriminator(tag_of), pydantic.WrapSerializer(write)]
        )


def _hashable(value: Any) -> Any:
    """Converts lists and mappings to tuples."""
    if isinstance(value, dict):
        value = list(value.items())
    return tuple(map(_hashable, value)) if isinstance(value, (list, tuple)) else value


def keys_of(section: type[Section]) -> dict[str, FieldInfo]:
    """Fields of a section by their keys in files."""
    return {field.alias or name: field for name, field in section.model_fields.items()}


def sections_in(annotation: Any) -> Iterator[type[Section]]:
    """All sections that a type names."""
    if isinstance(annotation, type) and issubclass(annotation, Section):
        yield annotation
    for part in typing.get_args(annotation):
        yield from sections_in(part)


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


_UNKNOWN = "extra_forbidden", "invalid_key"
"""Types of pydantic's errors of keys that a section does not have."""


def _input_error(
    error: ValidationError, section: type[Section], tree: Any, source: object, key: str = ""
) -> InputError:
    """The error of a section at `key` as an InputError that names `source`."""
    errors = error.errors(include_url=False)
    # An unknown key tells why another is missing. A value that fits no member of a union has an
    # error per member; the innermost is best.
    first = max(errors, key=lambda one: (one["type"] in _UNKNOWN, len(one["loc"])))
    place = _place(first["loc"], section, tree)
    inner, problem = _in_words(first, place)
    if first["type"] == "missing" and "base" in section.keys_of_files:
        tag = (place.value or {}).get(TAG)
        whole = f", as !{tag} replaces a base's kind" if tag else ""
        problem += whole or ", or name a `base` that has it"
    return InputError(source, joined(key, inner), problem)


class _Place(NamedTuple):
    """What a tree has at a place, and what is declared there."""

    key: str
    value: Any
    sections: list[type[Section]]
    """Sections that are possible there."""
    kinds: list[type[Section]]
    """These, and the other kinds of a section whose tag is known."""
    unit: str


def _place(loc: Sequence[str | int], section: type[Section], tree: Any) -> _Place:
    """The place of pydantic's error in the validation of a tree as a section."""
    key, sections, kinds, unit, is_name = "", [section], [section], "", False
    for part in loc:  # also contains tags and names of union members, which are no keys
        if isinstance(tree, list) and isinstance(part, int):
            key, tree = joined(key, f"[{part}]"), tree[part]
        elif isinstance(tree, dict) and part in tree and part != TAG:
            key, tree = joined(key, str(part)), tree[part]
        tagged = [kind for kind in kinds if kind.tag == part]
        fields = keys_of(sections[0]) if len(sections) == 1 else {}
        if is_name:
            is_name = False
        elif len(sections) > 1 and tagged:
            sections = tagged
        elif part in fields:
            field = fields[str(part)]
            sections = kinds = list(sections_in(field.annotation))
            unit, is_name = unit_of(field), typing.get_origin(field.annotation) is dict
    return _Place(key, tree, sections, kinds, unit)


def _in_words(error: ErrorDetails, place: _Place) -> tuple[str, str]:
    """Key and problem of an error at a place."""
    key, kind, context = place.key, error["type"], error.get("ctx", {})
    found = f"found {described(place.value)}"
    name = str(error["loc"][-1]) if error["loc"] else ""
    if kind == "value_error":
        cause = context["error"]
        return joined(key, getattr(cause, "key", "")), getattr(cause, "problem", str(cause))
    if kind == "missing":
        return joined(key, name), "is missing; give it"
    if name == TAG:
        return key, f"{found}, expected a mapping of keys"
    if kind in _UNKNOWN:
        return key, f"unknown key; {_advice(name, place)}"
    if kind.startswith("union_tag"):
        return key, f"{found}; {hint(found, [f'!{one.tag}' for one in place.kinds])}"
    expected = re.sub(".* should (be|have) ", "", error["msg"]).replace(" after validation", "")
    for limit in {"gt", "ge", "le"} & context.keys():
        expected = f"{expected.rpartition(' ')[0]} {plainest(context[limit], place.unit)}"
    return key, f"{found}, expected {re.sub('a valid dict.*', 'a mapping of keys', expected)}"


def _advice(name: str, place: _Place) -> str:
    """Advice about an unknown key: other kinds or inner sections that have it, or a similar one."""
    named = [f"!{kind.tag}" for kind in place.kinds if name in keys_of(kind)]
    named += [f"'{key}'" for section in place.sections for key in _keys_named(name, section)]
    if named:
        return f"did you mean {' or '.join(dict.fromkeys(named))}?"
    return hint(name, [key for section in place.sections for key in keys_of(section)])


def _keys_named(name: str, section: type[Section]) -> Iterator[str]:
    """Dotted keys in a section that end with a name."""
    for key, field in keys_of(section).items():
        for kind in sections_in(field.annotation):
            if name in keys_of(kind):
                yield f"{key}.{name}"
            yield from (f"{key}.{inner}" for inner in _keys_named(name, kind))


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
