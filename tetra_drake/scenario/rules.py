"""What a file inherits from its base, and which keys of disturbances belong together."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from tetra_drake.scenario.fields import Tree, merge

BALANCED = "balanced"
"""Written as robot.spacing: the spacing at which the cables of a junction balance."""

WHOLE = ("objective", "require")
"""The sections that a file gives as a whole."""


def on_base(base: Tree, given: Tree) -> Tree:
    """The tree of a base with what a file gives, which may decide on the spacing.

    Masses do not count for the balance: twice the density moves T1 by less than 0.003 in.
    """

    def decisive(tree: Tree) -> list[Any]:
        names = ("strut_length", "outer_stiffness", "inner_stiffness", "free_length")
        values = tree.get("robot", {}) | tree.get("cables", {})
        return [values.get(name) for name in names]

    tree: Tree = merge(base, given) | {k: given[k] for k in WHOLE if k in given}
    if "spacing" not in given.get("robot", {}) and decisive(tree) != decisive(base):
        tree["robot"] = tree.get("robot", {}) | {"spacing": BALANCED}
    return tree


def key_groups(spreads: Mapping[str, Any]) -> Iterator[tuple[str, list[str]]]:
    """Each key of `disturbances.spreads` with the scenario keys that it joins by commas."""
    for joined in spreads:
        yield joined, [key.strip() for key in joined.split(",")]
