"""Tables in Markdown, and the places in a file where they stand."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from pathlib import Path

from tetra_drake.errors import InputError

_BEGIN = re.compile(r"<!-- table (?P<name>\S+): made by tetra-drake tables -->")
_END = "<!-- end -->"


def markdown_table(
    headings: Sequence[str], rows: Sequence[Sequence[str]], *, text_columns: Sequence[int] = (0,)
) -> str:
    """A table, without a line feed at its end. Columns that are no text are aligned as numbers."""
    rule = ["---" if i in text_columns else "---:" for i in range(len(headings))]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in [headings, rule, *rows])


def fixed(value: float, digits: int = 2) -> str:
    """A number with so many decimals; a dash for what there is not."""
    if not math.isfinite(value):
        return "-"
    text = f"{value:.{digits}f}"
    return text.removeprefix("-") if float(text) == 0.0 else text


def signed(value: float, digits: int = 2) -> str:
    """As fixed(), with the sign of what is more, too."""
    text = fixed(value, digits)
    return f"+{text}" if math.isfinite(value) and float(text) > 0.0 else text


def fill_tables(text: str, make_table: Callable[[str], str], *, source: str | Path) -> str:
    """The text with every table between its marker lines made anew.

        <!-- table NAME: made by tetra-drake tables -->
        ...
        <!-- end -->

    Raises InputError, naming source and line, if there is no such place, if one has no end,
    and if make_table raises KeyError as it knows no table of this name.
    """
    filled: list[str] = []
    place: tuple[int, str] | None = None
    found = False
    for number, line in enumerate(text.split("\n"), start=1):
        begin = _BEGIN.fullmatch(line.strip())
        if place is not None and begin:
            break
        if begin:
            place, found = (number, begin["name"]), True
            filled += [line, "", _make(make_table, place, source), ""]
        elif place is None:
            filled.append(line)
        elif line.strip() == _END:
            filled.append(line)
            place = None
    if place is not None:
        number, name = place
        raise InputError(source, f"line {number}", f"table {name} has no line `{_END}` after it")
    if not found:
        problem = "holds no line `<!-- table NAME: made by tetra-drake tables -->`"
        raise InputError(source, "", problem)
    return "\n".join(filled)


def _make(make_table: Callable[[str], str], place: tuple[int, str], source: str | Path) -> str:
    number, name = place
    try:
        return make_table(name)
    except KeyError as error:
        raise InputError(source, f"line {number}", f"no table is called '{name}'") from error
