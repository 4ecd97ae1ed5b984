"""Sections of settings as pydantic models: tagged kinds, trees, and errors of one line.

A *tree* is what a YAML file holds: mappings, lists, numbers and texts. Quantities are texts with
units. A tagged kind, written `!Name {...}` as in Drake's YAML, is a mapping with its tag under TAG.
"""

from __future__ import annotations

import typing
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import pydantic
from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema, ErrorDetails, core_schema

from tetra_drake.errors import InputError
from tetra_drake.scenario.quantities import Quantity, unit_of
from tetra_drake.scenario.refusals import TAG, described, hint, refuse

Tree = dict[str, Any]
Show = Callable[[float, str], str]
"""Makes a text of a number and its SI unit."""


class Section(BaseModel):
    """Settings that belong together. Numbers are SI, values cannot be changed in place."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    has_base: ClassVar[bool] = False
    """True if a file may give what another file, its `base`, does not."""

    tag: ClassVar[str] = ""
    """Name of the kind in files; the name of the class if not given."""

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
        if not isinstance(tree, dict) or tree.get(TAG, cls.tag) != cls.tag:
            refuse("", f"found {described(tree)}, expected a mapping of keys")
        for name in tree:
            if name != TAG and name not in keys_of(cls):
                refuse(str(name), f"unknown key; {cls._advice(str(name))}")
        return {name: python_value(value) for name, value in tree.items() if name != TAG}

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self) and other._compared() == self._compared()

    def __hash__(self) -> int:
        return hash(self._compared())

    def values(self) -> dict[str, Any]:
        """The values by their dotted keys."""
        return flattened(self.model_dump())

    def _compared(self) -> Any:
        # In order, which numbers the bodies and oscillators of a structure.
        return _hashable(self.values())

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
            raise InputError(source, joined(key, refused["key"]), refused["problem"]) from None


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


@dataclass(frozen=True)
class Varied:
    """Marks a number that the default disturbances vary; those of the same name by one factor."""

    name: str = ""


def varied(section: Section, key: str = "") -> Iterator[tuple[str, str]]:
    """The keys of numbers within a section that are marked as Varied, and the marks' names."""
    for name, field in type(section).model_fields.items():
        value, inner = getattr(section, name), joined(key, name)
        yield from ((inner, mark.name) for mark in field.metadata if isinstance(mark, Varied))
        parts = value.items() if isinstance(value, dict) else [("", value)]
        for part, item in parts:
            if isinstance(item, Section):
                yield from varied(item, joined(inner, part))


def python_value(value: Any) -> Any:
    """A value with Python's lists and numbers in place of tuples and of what numpy has."""
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, (list, tuple)):
        return [python_value(item) for item in value]
    return value


def _place(error: ErrorDetails, tree: Any) -> tuple[str, int, Any]:
    """The key that an error is at, its number of parts, and what the tree holds there."""
    key, depth = "", 0
    for part in error["loc"]:  # where pydantic also names the members of unions
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
    if error["type"] in _LIMITS:
        words, name = _LIMITS[error["type"]]
        unit = unit_of(keys_of(section)[str(error["loc"][0])])
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


def joined(key: str, inner: str) -> str:
    """The key of what has the key `inner` within what is at `key`."""
    return f"{key}{inner}" if inner.startswith("[") else f"{key}.{inner}".strip(".")


def written(value: Any, show: Show = "{!r} {}".format) -> Any:
    """A value of a tree as a file holds it: `show` makes the texts of quantities."""
    if isinstance(value, Quantity):
        return show(float(value), value.unit) if value.unit else float(value)
    if isinstance(value, dict):
        return {name: written(item, show) for name, item in value.items()}
    if isinstance(value, list):
        return [written(item, show) for item in value]
    return value


def flattened(tree: Tree, key: str = "") -> dict[str, Any]:
    """The values of a tree by their dotted keys."""
    values: dict[str, Any] = {}
    for name, value in tree.items():
        inner = joined(key, name)
        values |= flattened(value, inner) if isinstance(value, dict) else {inner: value}
    return values
