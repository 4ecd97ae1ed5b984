"""The renderer of all pages: a template of the folder templates/ and numbers become a page.

A template has the prose, and tables in Markdown whose rows are loops. Numbers are written by
filters: `x | fixed(1)`, `share | percent`, `[median, low, high] | over(2)`.
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import jinja2
import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.formatting import fixed, listed, rounded

TEMPLATES = Path(__file__).parent / "templates"

_UNBROKEN = str.maketrans({" ": "\u00a0", "–": "–\u2060"})
"""Spaces and dashes that do not end a line in a browser: no-break space, and word joiner."""
_RULE = re.compile(r"\|( :?-+:? \|)+")
"""The line below the headings of a table."""


def percent(share: float, digits: int = 0) -> str:
    """A share as text in percent."""
    text = fixed(100.0 * share, digits)
    return text if text == "-" else f"{text} %"


def median(records: Iterable[Mapping[str, float]], key: str) -> float:
    """Median of a number over records; NaN without records."""
    return float(np.median([record[key] for record in records] or [math.nan]))


def over(values: Sequence[float], digits: int = 2) -> str:
    """A number and its range, (number, low, high), as text."""
    middle, low, high = (fixed(value, digits) for value in values)
    return f"{middle} ({low} to {high})"


def significant(value: float, digits: int = 3) -> str:
    """A number with this many significant digits, without zeros at its end."""
    return f"{value:.{digits}g}"


@functools.cache
def _environment() -> jinja2.Environment:
    """Settings of all templates, with the filters."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        undefined=jinja2.StrictUndefined,
        autoescape=jinja2.select_autoescape(["html.jinja"]),
        keep_trailing_newline=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    functions = (fixed, rounded, listed, percent, median, over, significant)
    environment.filters.update({each.__name__: each for each in functions})
    return environment


def rendered(name: str, /, **numbers: object) -> str:
    """The page from the template of a name and numbers. Raises InputError if it has a number that
    is not given."""
    try:
        text = _environment().get_template(f"{name}.jinja").render(numbers)
    except jinja2.TemplateError as error:
        raise InputError(TEMPLATES / f"{name}.jinja", "", f"cannot be filled: {error}") from error
    return text if ".html" in name else with_unbroken_numbers(text)


def with_unbroken_numbers(text: str) -> str:
    """A page in Markdown whose numbers in tables, the cells aligned to the right, stay on one line
    in a browser."""
    lines, numbers = text.split("\n"), list[bool]()
    for place, line in enumerate(lines):
        if _RULE.fullmatch(line):
            numbers = [cell.strip().endswith(":") for cell in line.split("|")]
        elif not line.startswith("|"):
            numbers = []
        elif any(numbers):
            cells = zip(line.split("|"), numbers, strict=True)
            lines[place] = "|".join(
                f" {cell.strip(' ').translate(_UNBROKEN)} "
                if is_number and "<" not in cell
                else cell
                for cell, is_number in cells
            )
    return "\n".join(lines)
