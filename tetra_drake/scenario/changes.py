"""Changes of a scenario from Python, as the tree that a file would hold."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tetra_drake.errors import InputError
from tetra_drake.scenario.sections import TAG, Section, Tree, Whole, python_value, tree_of
from tetra_drake.scenario.yaml_text import parse_yaml


def tree_of_changes(changes: Mapping[str, Any], source: object) -> Tree:
    """Changes by dotted keys, and mappings of keys, as the tree that a file would hold."""
    tree: Tree = {}
    for key in sorted(changes, key=lambda key: key.count(".")):  # "robot" before "robot.gravity"
        *sections, name = key.split(".")
        place: Any = tree
        for section in sections:
            if type(place) is dict:
                place = place.setdefault(section, {})
        if type(place) is not dict or name in place:
            raise InputError(source, key, "is given twice")
        place[name] = _given(changes[key])
    return tree


def _given(value: Any) -> Any:
    """A value from Python as a file would hold it."""
    value = python_value(value)
    if isinstance(value, Section):
        return Whole({TAG: type(value).__name__} | tree_of(value))
    if isinstance(value, str) and value.startswith("!"):
        return parse_yaml(value, value)
    if isinstance(value, list):
        return [_given(item) for item in value]
    if isinstance(value, Mapping):
        return {name: _given(item) for name, item in value.items()}
    return value
