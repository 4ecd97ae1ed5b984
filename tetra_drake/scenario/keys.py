"""KEYS.md, the page of all keys; `python -m tetra_drake.scenario.keys` writes it."""

from __future__ import annotations

import ast
import inspect
import itertools
import json
import textwrap
import typing
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import NoneType
from typing import Any, Literal

from pydantic.fields import FieldInfo

from tetra_drake.formatting import Table
from tetra_drake.scenario.metrics import METRICS, Metrics
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.settings.quantities import Unit, UnitsByName, unit_of
from tetra_drake.settings.section import Kinds, Section, joined, keys_of
from tetra_drake.settings.units import plainest

PAGE = Path(__file__).parent / "KEYS.md"

_INTRODUCTION = """\
# Keys of a scenario

`python -m tetra_drake.scenario.keys` writes this page. See [Scenarios](README.md) for examples.

- A quantity may have any unit that converts to the one given here.
- A key without a default is in your file or in its `base`.
- Of the kinds of a section, the first needs no tag. NAME stands for a name of your choice."""

_LIMITS = {
    "gt": "> {}",
    "ge": "≥ {}",
    "lt": "< {}",
    "le": "≤ {}",
    "min_length": "≥ {} items",
    "max_length": "≤ {} items",
}
"""Texts of limits by the attributes of pydantic's marks."""

_WORDS = {float: "number", int: "integer", str: "text", bool: "true or false"}

Row = tuple[str, str, str, str]
"""Key, value, default and meaning."""


def keys_page() -> str:
    """All keys with unit, limits, default and meaning, in Markdown."""
    parts = [_INTRODUCTION]
    for key, field in keys_of(Scenario).items():
        is_kind = any(isinstance(mark, Kinds) for mark in field.metadata)
        for section in _sections(field):
            parts.append(f"## `{key}`" + (f": `!{section.tag}`" if is_kind else ""))
            parts.append(_line(section.__doc__))
            rows = list(_rows(key, section))
            parts += [_table_of_keys(rows)] if rows else []
    others = [row for row in _rows("", Scenario) if "." not in row[0]]
    parts += ["## Other keys", _table_of_keys(others)]
    parts += ["## Metrics", _line(Metrics.__doc__), _table_of_metrics()]
    return "\n\n".join(parts) + "\n"


def _table_of_keys(rows: Sequence[Row]) -> str:
    cells = [(f"`{key}`", *rest) for key, *rest in rows]
    return Table(["key", "value", "default", "what it is"], cells, range(4)).markdown()


def _table_of_metrics() -> str:
    rows, texts = [], _docstrings(Metrics)
    for name, metric in METRICS.items():
        limit = "at most" if metric.is_cost else "at least"
        rows.append((f"`{name}`", metric.unit or "1", limit, metric.needs or "any", texts[name]))
    headings = ["metric", "unit", "`require`", "robots", "what it is"]
    return Table(headings, rows, range(5)).markdown()


def _rows(key: str, section: type[Section]) -> Iterator[Row]:
    """All keys of a section and of its inner sections."""
    texts = _docstrings(section)
    for name, field in keys_of(section).items():
        inner = joined(key, name)
        by_metric = any(isinstance(mark, UnitsByName) for mark in field.metadata)
        if typing.get_origin(field.annotation) is dict and not by_metric:
            inner = f"{inner}.NAME"
        sections = _sections(field)
        for part in sections:
            yield from _rows(inner, part)
        if not sections:
            value = _value(field.annotation, field.metadata)
            yield inner, value, _default(field), texts.get(name, "")


def _sections(field: FieldInfo) -> list[type[Section]]:
    """Sections that are possible values of a field, or of an item of its mapping."""
    kinds = (field.annotation, *typing.get_args(field.annotation))
    return [kind for kind in kinds if isinstance(kind, type) and issubclass(kind, Section)]


def _value(kind: Any, marks: Sequence[Any] = ()) -> str:
    """Possible values of a type, with unit and limits."""
    if hasattr(kind, "__metadata__"):
        of_fields = (getattr(mark, "metadata", [mark]) for mark in kind.__metadata__)
        return _value(kind.__origin__, [*itertools.chain(*of_fields), *marks])
    if any(isinstance(mark, UnitsByName) for mark in marks):
        return "by metric"
    unit = next((mark.name for mark in marks if isinstance(mark, Unit)), "")
    origin, members = typing.get_origin(kind), typing.get_args(kind)
    if origin is Literal:
        words = " or ".join(f"`{member}`" for member in members)
    elif origin is list:
        item = _value(members[0])
        words = f"list of ({item})" if "," in item else f"list of {item}"
    elif origin is dict:
        return _value(members[1])
    elif members:
        words = " or ".join(_value(member) for member in members if member is not NoneType)
    else:
        words = unit or _WORDS.get(kind, "file name")
    return ", ".join([words, *_limits(marks, unit)])


def _limits(marks: Sequence[Any], unit: str) -> Iterator[str]:
    """The limits of a number, or of the length of a list."""
    limits = {
        name: getattr(mark, name)
        for mark, name in itertools.product(marks, _LIMITS)
        if getattr(mark, name, None) is not None
    }
    if "max_length" in limits and limits["max_length"] == limits.get("min_length"):
        yield f"{limits.pop('max_length')} items"
        del limits["min_length"]
    for name, limit in limits.items():
        yield _LIMITS[name].format(plainest(limit, unit) if unit else f"{limit:g}")


def _default(field: FieldInfo) -> str:
    """The default as text of a file; empty if there is none."""
    if field.is_required():
        return ""
    value, unit = field.default, unit_of(field)
    if isinstance(value, float) and unit:
        return plainest(value, unit)
    text = json.dumps(value).strip('"')
    return "none" if text in ("null", "[]", "{}") else f"`{text}`"


def _docstrings(owner: type) -> dict[str, str]:
    """The docstrings of the attributes of a class and its bases, by name."""
    texts = {}
    for base in reversed(owner.__mro__):
        if not base.__module__.startswith("tetra_drake"):
            continue
        tree = ast.parse(textwrap.dedent(inspect.getsource(base)))
        statements = typing.cast(ast.ClassDef, tree.body[0]).body
        for attribute, text in itertools.pairwise(statements):
            if isinstance(attribute, ast.AnnAssign) and isinstance(text, ast.Expr):
                texts[ast.unparse(attribute.target)] = _line(ast.literal_eval(text.value))
    return texts


def _line(text: str | None) -> str:
    return " ".join((text or "").split()).replace("|", "\\|")


if __name__ == "__main__":
    PAGE.write_text(keys_page(), encoding="utf-8")
