"""Numbers, durations, lists, tables and pages as text."""

from __future__ import annotations

import html
import itertools
import math
import shutil
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import resources

Say = Callable[[str], None]
"""Function that shows a text to the user, such as print()."""

_ROUNDING = 1e-12
"""Size up to which a number in a table is a rounding error."""


def silent(text: str) -> None:
    """Does nothing. It is the default where a function takes a Say, a function that shows a
    text."""


def fixed(value: float, digits: int = 2) -> str:
    """A number as text with this many decimals, never "-0.00". It is "-" if the number is not
    finite."""
    if not math.isfinite(value):
        return "-"
    return f"{value:z.{digits}f}"


def signed(value: float, digits: int = 2) -> str:
    """A number like fixed(), with a plus sign if it is positive."""
    text = fixed(value, digits)
    return f"+{text}" if math.isfinite(value) and float(text) > 0.0 else text


def rounded(value: float, digits: int = 3) -> str:
    """A number as text with this many significant digits, without exponent. It is "-" if the number
    is not finite, and "0" if it is so small that it is a rounding error."""
    if abs(value) < _ROUNDING or not math.isfinite(value):
        return fixed(value, 0)
    magnitude = int(f"{value:.{digits - 1}e}".partition("e")[2])
    return fixed(value, max(0, digits - 1 - magnitude))


def duration(seconds: float) -> str:
    """A time in s as text h:mm:ss; "-" if it is not finite."""
    if not math.isfinite(seconds):
        return "-"
    minutes, second = divmod(round(seconds), 60)
    hour, minute = divmod(minutes, 60)
    return f"{hour}:{minute:02d}:{second:02d}"


def listed(items: Sequence[object]) -> str:
    """A list of items as text, such as "a, b and c"; "none" if it is empty."""
    *head, last = [str(item) for item in items] or ["none"]
    return f"{', '.join(head)} and {last}" if head else last


def sentence(remark: str) -> str:
    """A remark as a sentence: with a capital letter and a full stop."""
    return f"{remark[:1].upper()}{remark[1:]}."


def ranged(value: float, low: float, high: float) -> str:
    """A number and its range in brackets, such as "3 (2 to 4)". An unknown range (`low` is NaN), or
    one without width, is left out."""
    if math.isnan(low) or low == high:
        return rounded(value)
    return f"{rounded(value)} ({rounded(low)} to {rounded(high)})"


def uncertain(shown: str, value: float, low: float, high: float) -> str:
    """A number with as many decimals as its range from `low` to `high` allows, and the range in
    brackets, such as "5.2 (3.1 to 6.0)". A range that is narrower than two units of the last
    decimal of `shown`, the number as text, or unknown (NaN), changes nothing."""
    decimals, width = len(shown.partition(".")[2]), high - low
    if not width >= 2.0 * 10.0**-decimals:
        return shown
    decimals = max(0, min(decimals, 1 - math.floor(math.log10(width))))
    value_text, low_text, high_text = (fixed(x, decimals) for x in (value, low, high))
    return f"{value_text} ({low_text} to {high_text})"


def percents(share: float, low: float, high: float) -> str:
    """A share in percent and its range in brackets, such as "50 % (40 to 60)". Arguments are shares
    from 0 to 1. A range without width is left out."""
    text = f"{100.0 * share:.0f} %"
    return text if low == high else f"{text} ({100.0 * low:.0f} to {100.0 * high:.0f})"


def heading_html(text: str) -> str:
    """Lines of plain text as HTML, to stand above a table. The first line is in bold."""
    first, *others = html.escape(text).splitlines()
    return "<br>".join([f"<b>{first}</b>", *others])


_WIDTH = 100  # letters in a line of a table where there is no terminal
_NARROW = 12  # letters; texts are not folded into narrower columns


@dataclass(frozen=True)
class TextTable:
    """A table of texts with a heading for each column. Methods give it as plain text, HTML or
    Markdown."""

    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    text_columns: Sequence[int] = (0,)
    """Indices of the columns that are aligned to the left; other columns have numbers."""

    def text(self) -> str:
        """The table as aligned lines. If it is wider than the terminal, headings of numbers are
        folded first, then texts; wide columns before narrow ones. Numbers are never folded."""
        columns = list(zip(self.headings, *self.rows, strict=True))
        texts = [column in self.text_columns for column in range(len(columns))]
        widths = [max(map(len, cells)) for cells in columns]
        least = [
            _NARROW if is_text else max([_NARROW, *map(len, cells[1:])])
            for cells, is_text in zip(columns, texts, strict=True)
        ]
        terminal = shutil.get_terminal_size((_WIDTH, 24)).columns
        while sum(widths) + 2 * (len(widths) - 1) > terminal:
            foldable = [column for column, width in enumerate(widths) if width > least[column]]
            if not foldable:
                break
            headed = [column for column in foldable if not texts[column]]
            widths[max(headed or foldable, key=widths.__getitem__)] -= 1

        aligns, lines = [str.ljust if is_text else str.rjust for is_text in texts], []
        for row in [self.headings, *self.rows]:
            folded = [
                textwrap.wrap(cell, width, subsequent_indent="  ") if len(cell) > width else [cell]
                for cell, width in zip(row, widths, strict=True)
            ]
            for parts in itertools.zip_longest(*folded, fillvalue=""):
                aligned = zip(aligns, parts, widths, strict=True)
                lines.append("  ".join(align(part, width) for align, part, width in aligned))
        return "\n".join(line.rstrip() for line in lines)

    def html(self) -> str:
        """The table as HTML, as notebooks show it."""
        return render("table.html.jinja", table=self)

    def markdown(self) -> str:
        """The table in Markdown, without a line feed at the end. Numbers stay on one line in a
        browser."""
        return render("table.md.jinja", table=self)


def render(template: str, **values: object) -> str:
    """A page from a Jinja template of the package, such as "report/report.html.jinja".

    Values are escaped. Templates may use rounded() and duration() as filters.
    """
    from jinja2 import Environment, StrictUndefined

    source = (resources.files("tetra_drake") / template).read_text(encoding="utf-8")
    environment = Environment(autoescape=True, undefined=StrictUndefined)
    environment.filters.update(rounded=rounded, duration=duration)
    environment.policies["json.dumps_kwargs"] = {"separators": (",", ":")}  # compact, not sorted
    return environment.from_string(source).render(values)
