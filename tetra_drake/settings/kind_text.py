"""Texts of the settings of a kind, such as a kind of terrain."""

from __future__ import annotations

from collections.abc import Iterable

from tetra_drake.settings.section import Section, written
from tetra_drake.settings.units import plainest


def settings_text(kind: Section, *, always: Iterable[str] = ()) -> str:
    """Settings in brackets after a blank, such as " (slope 5 deg)"; empty if there are none.

    Numbers have the unit that needs the fewest digits. Defaults are left out, except the settings
    named in `always`.
    """
    given = written(kind.model_dump(exclude_defaults=True), plainest)
    settings = {name: getattr(kind, name) for name in always} | given
    lists = {name: " ".join(value) for name, value in settings.items() if isinstance(value, list)}
    texts = [f"{name} {value}" for name, value in (settings | lists).items()]
    return f" ({', '.join(texts)})" if texts else ""
