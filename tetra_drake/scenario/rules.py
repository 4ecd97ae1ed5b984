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
    """The tree of a base with what a file gives, which may decide on spacing and reference.

    Masses do not count for the balance: twice the density moves T1 by less than 0.003 in.
    """

    def decisive(tree: Tree) -> list[Any]:
        names = ("strut_length", "outer_stiffness", "inner_stiffness", "free_length")
        values = tree.get("robot", {}) | tree.get("cables", {})
        return [values.get(name) for name in names]

    tree: Tree = merge(base, given) | {k: given[k] for k in WHOLE if k in given}
    if "spacing" not in given.get("robot", {}) and decisive(tree) != decisive(base):
        tree["robot"] = tree.get("robot", {}) | {"spacing": BALANCED}
    if not same_experiment(tree, base):
        tree["reference"] = given.get("reference")
    return tree


def same_experiment(tree: Tree, base: Tree) -> bool:
    """Whether two trees agree in all that the numbers of a reference depend on."""

    def relevant(tree: Tree) -> list[Any]:
        others = ("name", "reference", "simulation", "compiled", "mujoco", "evolution", "optimizer")
        simulation = tree.get("simulation", {})
        rest = {name: value for name, value in tree.items() if name not in others}
        return [rest, simulation.get("duration"), simulation.get("steady_from")]

    return relevant(tree) == relevant(base)


def key_groups(spreads: Mapping[str, Any]) -> Iterator[tuple[str, list[str]]]:
    """Each key of `disturbances.spreads` with the scenario keys that it joins by commas."""
    for joined in spreads:
        yield joined, [key.strip() for key in joined.split(",")]
