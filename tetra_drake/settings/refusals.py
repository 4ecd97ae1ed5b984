"""Error messages about the values of a tree."""

from __future__ import annotations

import difflib
import itertools
import textwrap
from collections.abc import Iterable, Sequence
from typing import Any, NoReturn

from tetra_drake.errors import InputError

TAG = "_tag"
"""Key of a mapping in a tree that holds the tag of its kind."""

_LONGEST_LIST = 200
"""Characters of a list of names."""

_MOST_NAMES, _LONGEST_NAME = 2000, 100
"""Limits for the comparison with a misspelt name, because it is slow: names, and characters."""


def refuse(key: str, problem: str) -> NoReturn:
    """Ends a validation with a problem. `key` is relative to the validated value."""
    raise InputError("", key, problem)


def described(value: Any) -> str:
    """Description of a tree's value for a message."""
    if isinstance(value, dict):
        return f"!{value[TAG]}" if TAG in value else "a mapping"
    if value is None:
        return "nothing"
    if isinstance(value, list):
        return "a list"
    if isinstance(value, bool):
        return str(value).lower()
    return f"'{value}'" if isinstance(value, str) else str(value)[:40]


def hint(name: Any, names: Iterable[str]) -> str:
    """Advice about a misspelt name: the most similar name, or all names."""
    names = list(itertools.islice(names, _MOST_NAMES))
    close = difflib.get_close_matches(str(name)[:_LONGEST_NAME], names, n=1)
    if close:
        return f"did you mean '{close[0]}'?"
    listed = textwrap.shorten(", ".join(names), _LONGEST_LIST, placeholder=" ...")
    return f"expected one of {listed}" if names else "expected none"


def no_such(what: str, name: str, shipped: Sequence[str]) -> str:
    """Text of the error for a name or path that is neither shipped nor a file."""
    last = name.rpartition("/")[2][:_LONGEST_NAME]
    if close := difflib.get_close_matches(last, shipped, n=1):
        return f"no such {what}; did you mean '{close[0]}'?"
    return f"no such {what} (shipped: {', '.join(shipped)})"
