"""Changes of scenarios, in files and from Python."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tetra_drake.errors import InputError
from tetra_drake.scenario.yaml_text import parse_yaml
from tetra_drake.settings.refusals import TAG
from tetra_drake.settings.section import Tree, joined, mapped, parts_of, tree_value

REPLACED = ("objective", "require", "evolve", "robot.actuated")
"""Keys of mappings that a file replaces as a whole, instead of merging them."""

REMOVABLE = ("disturbances", "policy", "robot.start")
"""Sections that an empty key removes, as in `disturbances:`."""


class Part(Tree):
    """Mapping made from dotted keys, such as "objective.speed", not written as a mapping by the
    user. merged() changes only the keys or list indices that it has, also in `objective` and in
    lists, which an ordinary mapping or list replaces as a whole."""


def merged(base: Any, changes: Any, key: str = "", *, section: Any = None) -> Any:
    """Returns the settings `base` of a scenario with changes; `base` itself stays as it is.

    Both are nested mappings, or the values in them at the dotted `key` ("" for the whole scenario).
    `section` is the base as a checked section; without it no names are removed. Raises InputError
    for an index that a list does not have. The rules are:

    - A mapping changes the keys that it names; the others stay. An empty key, as in `friction:`,
      changes nothing; `disturbances:` or `policy:` removes the section.
    - In a map, whose names the user chooses, an empty key removes its name: `cables: {net: null}`.
    - A mapping with a tag, such as `!Coulomb`, replaces the mapping of the base and all its keys.
      Without a tag it changes keys.
    - `objective`, `require`, `evolve` and `robot.actuated` are replaced as a whole, unless a name
      is removed. Dotted keys from Python, such as "objective.speed", change single keys of them.
    - Numbers, texts, lists, and sections from Python replace the base's value. Only keys from
      Python, such as "robot.loads.n3[2]", change an item of a list.
    """
    if changes is None and isinstance(base, dict) and key not in REMOVABLE:
        changes = {}
    if not isinstance(changes, dict):
        return changes
    if isinstance(base, list) and isinstance(changes, Part):
        items = list(base)
        for index, value in changes.items():
            inner = joined(key, f"[{index}]" if isinstance(index, int) else index)
            if not isinstance(index, int) or index >= len(items):
                raise InputError("changes", inner, f"found no such item in a list of {len(items)}")
            items[index] = merged(items[index], value, inner)
        return items
    named = section if isinstance(section, dict) and TAG not in changes else {}  # names of a map
    parts = named or ({} if TAG in changes else getattr(section, "__dict__", {}))
    removed = [name for name, value in changes.items() if value is None and name in named]
    is_whole = TAG in changes or (key in REPLACED and not (removed or isinstance(changes, Part)))
    tree = dict(base) if isinstance(base, dict) and not is_whole else {}
    for name, value in changes.items():
        inner = joined(key, str(name))
        tree[name] = merged(tree.get(name), value, inner, section=parts.get(name))
    return {name: value for name, value in tree.items() if name not in removed}


def given_changes(changes: Mapping[str, Any], source: object) -> Mapping[str, Any]:
    """Checks an argument that must be a mapping with dotted keys as texts, and returns it. The
    values are not checked. Raises InputError, naming `source`, for anything else."""
    if isinstance(changes, Mapping) and all(isinstance(key, str) for key in changes):
        return changes
    problem = f"found {changes!r:.60}, expected values by dotted keys, such as {{'cpg.gain': ...}}"
    raise InputError(source, "changes", problem)


def tree_of_changes(changes: Mapping[str, Any], source: object) -> Tree:
    """Converts changes by dotted keys to nested mappings, as in a file. Values may be sections.
    Raises InputError, naming `source`, if the changes are no mapping or a key is given twice."""
    tree: Tree = Part()
    changes = given_changes(changes, source)
    for key in sorted(changes, key=lambda key: len(parts_of(key))):  # "robot" before "robot.name"
        *sections, name = parts_of(key)
        place: Any = tree
        for section in sections:
            if isinstance(place, dict):
                place = place.setdefault(section, Part())
        if not isinstance(place, dict) or name in place:
            raise InputError(source, key, "is given twice")
        place[name] = mapped(  # a text with a tag becomes its kind
            tree_value(changes[key]), lambda x: parse_yaml(x, x) if str(x).startswith("!") else x
        )
    return tree
