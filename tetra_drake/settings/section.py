"""Sections of settings: pydantic models that are read from YAML, with errors of one line.

A *tree* is the content of a YAML file: mappings, lists, numbers and texts. Quantities are texts
with units. A tagged kind, written `!Name {...}` as in Drake's YAML, is a mapping with its tag under
TAG.
"""

from __future__ import annotations

import ast
import functools
import inspect
import itertools
import os
import re
import sys
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Self, Union

import pydantic
from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, ValidationError
from pydantic_core import CoreSchema

from tetra_drake import on_demand
from tetra_drake.errors import InputError
from tetra_drake.settings.plugins import KINDS, entries, loaded, refusal
from tetra_drake.settings.quantities import EMPTY, Quantity
from tetra_drake.settings.refusals import TAG, Tree, input_error, joined
from tetra_drake.settings.units import plainest

Show = Callable[[float, str], str]
"""Function that formats a number and its SI unit as text."""


def _complete_schema(schema: Tree, section: type[Section]) -> None:
    """Adapts pydantic's JSON Schema of a section to files, in place: adds descriptions, units of
    defaults, and the keys that only files have."""
    schema |= EMPTY
    for key, text in section.keys_of_files.items():
        schema["properties"][key] = {"type": "string", "default": None, "description": text}
    for node in parts_in(schema):
        if not isinstance(node, dict):
            continue
        for name, correct in _CORRECT_NAMES.items():
            if name in node:
                node[correct] = node.pop(name)
        if not str(node.get("title", "!")).startswith("!"):
            del node["title"]
        if node.get("additionalProperties") is True:  # as if it were not given
            del node["additionalProperties"]
        default = node.get("default")
        if "anyOf" in node and isinstance(default, dict):
            del node["default"]
        items = node.get("items")
        unit = node.get("unit") or (isinstance(items, dict) and items.get("unit"))
        if unit and isinstance(default, (float, list)):
            node["default"] = mapped(default, functools.partial(plainest, unit=unit))
    texts = attribute_docstrings(section)
    for name, field in section.model_fields.items():
        if name in texts:
            schema["properties"][field.alias or name]["description"] = texts[name]


@functools.cache
def attribute_docstrings(owner: type) -> dict[str, str]:
    """Docstrings of the attributes of a class and of its bases, by the attribute's name: the texts
    below annotated attributes in the source. Empty for classes of a notebook or script.

    The source is parsed only when this is called. pydantic's use_attribute_docstrings would parse
    it at every import of the package, which takes 0.15 s.
    """
    if owner.__module__.startswith(("builtins", "pydantic", "typing", "__main__")):
        return {}
    texts: dict[str, str] = {}
    for base in reversed(owner.__bases__):
        texts |= attribute_docstrings(base)
    bodies = [node.body for node in _classes_of(owner.__module__) if node.name == owner.__name__]
    for attribute, text in itertools.pairwise(bodies[0] if bodies else []):
        if isinstance(attribute, ast.AnnAssign) and isinstance(text, ast.Expr):
            words = inspect.cleandoc(ast.literal_eval(text.value))
            texts[ast.unparse(attribute.target)] = words
    return texts


@functools.cache
def _classes_of(module: str) -> list[ast.ClassDef]:
    """Syntax trees of a module's classes. inspect would parse the module for each class."""
    tree = ast.parse(inspect.getsource(sys.modules[module]))
    return [node for node in tree.body if isinstance(node, ast.ClassDef)]


_CORRECT_NAMES = {
    "gt": "exclusiveMinimum",
    "ge": "minimum",
    "lt": "exclusiveMaximum",
    "le": "maximum",
    "oneOf": "anyOf",
}
"""JSON Schema's names by the names that pydantic writes. With anyOf, a mapping may fit several
types."""


class Section(BaseModel):
    """Base class of a section of settings. Numbers are SI; values cannot be changed in place."""

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        strict=True,
        allow_inf_nan=False,
        json_schema_extra=_complete_schema,
    )

    keys_of_files: ClassVar[dict[str, str]] = {}
    """Keys that a file may have besides the fields, such as `base`, with their descriptions."""

    tag: ClassVar[str] = ""
    """Tag in files, without "!"; by default the name of the class."""

    def __init__(self, **values: Any) -> None:
        values = tree_value(values, type(self).__name__)
        try:
            super().__init__(**values)
        except ValidationError as error:
            raise input_error(error, type(self), values, type(self).__name__) from None

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
        """Removes the section's own YAML tag from a mapping; pydantic refuses another tag later.
        None, from an empty section in a file, becomes {}: all settings have their defaults."""
        if not isinstance(tree, dict) or tree.get(TAG) != cls.tag:
            return {} if tree is None else tree
        return {name: value for name, value in tree.items() if name != TAG}

    def __eq__(self, other: object) -> bool:
        # The order counts: it numbers the bodies and oscillators of a structure.
        return type(other) is type(self) and [*other.values().items()] == [*self.values().items()]

    def __hash__(self) -> int:
        return hash(_hashable(self.values()))

    def values(self) -> dict[str, Any]:
        """Values of all settings in the section, by dotted keys."""
        return flattened(self.model_dump())

    @functools.cached_property
    def lengths(self) -> tuple[float, ...]:
        """All lengths (m) in the section. They are cached: a copy with disturbed numbers keeps the
        original lengths, which decide the units that it is shown in."""
        numbers = (part for part in parts_in(self.model_dump()) if isinstance(part, Quantity))
        return tuple(float(number) for number in numbers if number.unit == "m")

    @classmethod
    def from_tree(cls, tree: Any, source: object, *, key: str = "") -> Self:
        """Makes the section from the parsed content of a file. `key` is the dotted key of the
        section there. Raises InputError that names `source` and key."""
        tree = tree_value(tree, source)
        try:
            return cls.model_validate(tree, context=IN_FILE)
        except ValidationError as error:
            raise input_error(error, cls, tree, source, key) from None


IN_FILE = "in a file"
"""Validation context for the content of files: quantities need units. Without it, numbers are
SI."""


class Kinds:
    """Annotation of a union of sections, such as Annotated[Force | Winch, Kinds(ActuatorKind)]. In
    a file, a tag such as `!Winch` chooses the type of a mapping; a mapping without a tag is of the
    first type of the union.

    With `plain`, the first type is written without its tag, as it was before it had others.

    With a `base` class, installed plug-ins can add types that derive from it, by entry points of a
    `group`; `more` names further types by their places, "module:class".
    A section with such a union is built when it is first used (defer_build), because plug-ins
    import this package.
    """

    bases: ClassVar[dict[str, tuple[type, ...]]] = {}
    """Base classes of the kinds that plug-ins can add to, by group."""

    def __init__(
        self,
        base: type[Section] | None = None,
        group: str = KINDS,
        *,
        more: Sequence[str] = (),
        plain: bool = False,
    ) -> None:
        self.base, self.group, self.more, self.plain = base, group, more, plain
        self.bases[group] = *self.bases.get(group, ()), *([base] if base else ())

    def __get_pydantic_core_schema__(
        self, source: Any, handler: pydantic.GetCoreSchemaHandler
    ) -> CoreSchema:
        kinds = (*typing.get_args(source), *map(on_demand.loaded, self.more))
        if self.base:
            kinds += (*self._added({kind.tag for kind in kinds}, self.base),)

        def tag_of(value: Any) -> str | None:
            if isinstance(value, dict | None):
                return str((value or {}).get(TAG, kinds[0].tag))
            return value.tag if isinstance(value, Section) else None

        tagged = [Annotated[kind, Tag(kind.tag), Field(title=f"!{kind.tag}")] for kind in kinds]
        union: Any = Union[tuple(tagged)]  # noqa: UP007
        untagged = kinds[0].tag if self.plain else None
        write = pydantic.WrapSerializer(
            lambda kind, dump: ({} if kind.tag == untagged else {TAG: kind.tag}) | dump(kind)
        )
        return handler.generate_schema(Annotated[union, Discriminator(tag_of), write])

    def _added(self, tags: set[str], base: Any) -> Iterator[type]:
        """Kinds of plug-ins that derive from `base`. Raises InputError for a class that no union
        takes, or whose tag is not the name of its entry point, or is one of `tags`."""
        for name, entry in entries(self.group).items():
            kind: Any = loaded(entry)
            if not {*getattr(kind, "__mro__", ())} & {*self.bases[self.group]}:
                expected = " or ".join(one.__name__ for one in self.bases[self.group])
                raise refusal(entry, f"found {kind!r:.60}, expected a class of {expected}")
            if base in kind.__mro__ and (kind.tag in tags or kind.tag != name):
                raise refusal(entry, f"found !{kind.tag}, expected !{name}, which no kind here has")
            if base in kind.__mro__:
                try:
                    kind.model_rebuild()
                except (NameError, pydantic.PydanticUserError) as error:
                    raise refusal(entry, f"cannot be built: {error}") from error
                yield kind


def _hashable(value: Any) -> Any:
    """Converts lists and mappings to tuples, nested ones included."""
    if isinstance(value, dict):
        value = list(value.items())
    return tuple(map(_hashable, value)) if isinstance(value, (list, tuple)) else value


@dataclass(frozen=True)
class Varied:
    """Annotation of a setting whose true value is uncertain: the default disturbances multiply it
    by a random factor. Numbers with the same `name` get the same factor; without a name each has
    its own."""

    name: str = ""


def varied(section: Section, key: str = "") -> Iterator[tuple[str, str]]:
    """Dotted keys of the numbers in a section that are annotated with Varied, each with its
    Varied.name. `key` is put before all keys."""
    for name, field in type(section).model_fields.items():
        value, inner = getattr(section, name), joined(key, name)
        yield from ((inner, mark.name) for mark in field.metadata if isinstance(mark, Varied))
        parts = value.items() if isinstance(value, dict) else [("", value)]
        for part, item in parts:
            if isinstance(item, Section):
                yield from varied(item, joined(inner, part))


def mapped(value: Any, change: Callable[[Any], Any]) -> Any:
    """Copy of a nested value, where change(x) replaces each x that is neither a list nor a
    mapping."""
    if isinstance(value, Mapping):
        return {name: mapped(item, change) for name, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [mapped(item, change) for item in value]
    return change(value)


def tree_value(value: Any, source: object = "") -> Any:
    """Converts a value from Python, such as a section, a tuple, an array or a path, to the lists,
    mappings, numbers and texts that YAML has. Raises InputError, naming `source`, for a text with
    control characters: it would reach a terminal, or an XML file, which cannot have them."""

    def convert(part: Any) -> Any:
        if isinstance(part, Section):
            return {TAG: part.tag} | part.model_dump()
        if isinstance(part, os.PathLike):
            return os.fspath(part)
        return part.tolist() if hasattr(part, "tolist") else part

    tree = mapped(value, convert)
    for part in parts_in(tree):
        for text in part if isinstance(part, dict) else [part]:
            if isinstance(text, str) and _UNSEEN.search(text):
                raise InputError(source, "", f"found a control character in '{text}'")
    return tree


_UNSEEN = re.compile(r"[^\t\n\r -~\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def parts_of(key: str) -> list[str | int]:
    """Splits a dotted key into names and list indices: "loads.n3[2]" gives "loads", "n3" and 2."""
    parts: list[str | int] = []
    for part in key.split("."):
        name, _, indices = part.partition("[") if _ITEMS.search(part) else (part, "", "")
        parts += [name, *map(int, re.findall(r"\d+", indices))]
    return parts


_ITEMS = re.compile(r"[^\[](\[\d+\])+$")
"""Pattern of the indices at the end of a name, such as "[2]" in "n3[2]"."""


def value_at(tree: Any, key: str) -> Any:
    """Value at a dotted key in the content of a file; None if there is none."""
    for part in parts_of(key):
        try:
            tree = tree[part]
        except (KeyError, IndexError, TypeError):
            return None
    return tree


def written(value: Any, show: Show = "{!r} {}".format) -> Any:
    """Copy of a section's dumped settings for a file: each quantity becomes a text, such as "0.3
    m". `show` makes the text from number and SI unit; by default it has all digits, in SI."""
    return mapped(
        value, lambda part: show(float(part), part.unit) if isinstance(part, Quantity) else part
    )


def settings_text(kind: Section, *, always: Iterable[str] = ()) -> str:
    """Settings of a section `kind` as text, such as " (slope 5 deg)"; "" if there are none.

    Numbers have the unit that needs the fewest digits. Settings at their defaults are left out,
    except the ones named in `always`.
    """
    given = written(kind.model_dump(exclude_defaults=True), plainest)
    settings = {name: getattr(kind, name) for name in always} | given
    lists = {name: " ".join(value) for name, value in settings.items() if isinstance(value, list)}
    texts = [f"{name} {value}" for name, value in (settings | lists).items()]
    return f" ({', '.join(texts)})" if texts else ""


def parts_in(value: Any) -> Iterator[Any]:
    """Iterates over a value and all values nested in its mappings and lists."""
    yield value
    if isinstance(value, (dict, list)):
        for item in value.values() if isinstance(value, dict) else value:
            yield from parts_in(item)


def flattened(tree: Tree, key: str = "") -> dict[str, Any]:
    """Converts nested mappings to one mapping with dotted keys. `key` is put before all keys."""
    values: dict[str, Any] = {}
    for name, value in tree.items():
        inner = joined(key, name)
        values |= flattened(value, inner) if isinstance(value, dict) else {inner: value}
    return values
