"""Changes of scenarios, in files and from Python."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tetra_drake.errors import InputError
from tetra_drake.scenario.refusals import TAG
from tetra_drake.scenario.section import Section, Tree, joined, python_value
from tetra_drake.scenario.yaml_text import parse_yaml

REPLACED = ("objective", "require", "robot.actuated")
"""Mappings of a scenario that a file gives as a whole."""


class Part(Tree):
    """A mapping made of dotted keys, which never gives the whole."""


def merged(base: Any, changes: Any, key: str = "") -> Any:
    """The tree of a scenario, or what it has at `key`, with changes. These are the rules:

    - A mapping changes the keys that it names; the others stay.
    - A kind of another name replaces the base's with all its keys; one of the same name, or without
      a name, changes keys of it.
    - `objective`, `require` and `robot.actuated` replace the base's as a whole. Only dotted keys,
      from Python, change a part of them, as "objective.speed" does.
    - All else replaces what the base has: numbers, texts, lists, and sections from Python.
    """
    if not isinstance(changes, dict):
        return changes
    is_whole = key in REPLACED and not isinstance(changes, Part)
    if not isinstance(base, dict) or is_whole or changes.get(TAG, base.get(TAG)) != base.get(TAG):
        base = {}
    tree = dict(base)
    for name, value in changes.items():
        tree[name] = merged(base.get(name), value, joined(key, str(name)))
    return tree


def tree_of_changes(changes: Mapping[str, Any], source: object) -> Tree:
    """Changes from Python by dotted keys as the tree that a file would hold, in which sections may
    stand for mappings."""
    tree: Tree = Part()
    for key in sorted(changes, key=lambda key: key.count(".")):  # "robot" before "robot.gravity"
        *sections, name = key.split(".")
        place: Any = tree
        for section in sections:
            if isinstance(place, dict):
                place = place.setdefault(section, Part())
        if not isinstance(place, dict) or name in place:
            raise InputError(source, key, "is given twice")
        place[name] = _given(changes[key], source, key)
    return tree


def _given(value: Any, source: object, key: str) -> Any:
    """A value from Python as a file would hold it; a section is checked once more, as copies of
    sections are not."""
    value = python_value(value)
    if isinstance(value, Section):
        return type(value).from_tree(value.model_dump(), source, key=key)
    if isinstance(value, str) and value.startswith("!"):
        return parse_yaml(value, value)
    if isinstance(value, list):
        return [_given(item, source, f"{key}[{i}]") for i, item in enumerate(value)]
    if isinstance(value, Mapping):
        return {name: _given(item, source, f"{key}.{name}") for name, item in value.items()}
    return value
