"""Rules between values of a scenario: balanced spacing, reference, relations. They act on trees."""

from __future__ import annotations

import math
from typing import Any

from tetra_drake.errors import InputError
from tetra_drake.scenario.fields import Tree

BALANCED = "balanced"
"""The word for the spacing at which the cables of a junction balance."""

BALANCE_KEYS = (
    ("robot", "strut_length"),
    ("cables", "outer_stiffness"),
    ("cables", "inner_stiffness"),
    ("cables", "free_length"),
)
"""What the balanced spacing follows from."""


def balanced_spacing(
    *, strut_length: float, outer_stiffness: float, inner_stiffness: float, free_length: float
) -> float:
    """Spacing (m) of base triangles at which outer and inner cables balance along x.

    Three outer cables of length s pull two tetrahedra together. Three inner ones, from a tip at
    the height h of a tetrahedron to base nodes at s along and R across, push them apart while
    s < h. Raises ValueError if there is no such spacing.
    """
    height, radius = strut_length * math.sqrt(2.0 / 3.0), strut_length / math.sqrt(3.0)

    def pull(s: float) -> float:
        length = math.hypot(radius, height - s)
        inner = inner_stiffness * (length - free_length) * (height - s) / length
        return outer_stiffness * (s - free_length) - inner

    near, far = 0.0, height + free_length
    if pull(near) >= 0.0:
        raise ValueError("the cables balance at no spacing; give one")
    while near < (middle := 0.5 * (near + far)) < far:
        near, far = (near, middle) if pull(middle) > 0.0 else (middle, far)
    return far


def with_balance(tree: Tree, source: str) -> Tree:
    """A complete tree, with the balanced spacing as a number if it is asked for."""
    if tree["robot"]["spacing"] != BALANCED:
        return tree
    try:
        spacing = balanced_spacing(**{name: tree[part][name] for part, name in BALANCE_KEYS})
    except ValueError as error:
        raise InputError(source, "robot.spacing", str(error)) from error
    return {**tree, "robot": {**tree["robot"], "spacing": spacing}}


def rebalanced(tree: Tree, *, base: Tree, given: Tree) -> Tree:
    """The tree of a file on its base: balanced again if the file changes what decides the balance
    and gives no spacing."""

    def decides(tree: Tree) -> list[Any]:
        return [tree.get(part, {}).get(name) for part, name in BALANCE_KEYS]

    if "spacing" in given.get("robot", {}) or decides(tree) == decides(base):
        return tree
    return {**tree, "robot": {**tree.get("robot", {}), "spacing": BALANCED}}


def with_valid_reference(tree: Tree, *, base: Tree, given: Tree) -> Tree:
    """The changed tree without its base's reference, if that is for another robot or experiment."""
    if _experiment(tree) == _experiment(base):
        return tree
    return {**tree, "reference": given.get("reference")}


def _experiment(tree: Tree) -> Tree:
    """The part of a tree that the numbers of a reference depend on."""
    without = ("name", "reference", "evolution", "compiled", "simulation")
    simulation = tree.get("simulation", {})
    return {
        **{name: value for name, value in tree.items() if name not in without},
        "simulation": [simulation.get(name) for name in ("duration", "steady_from")],
    }


def check_relations(tree: Tree, source: str) -> None:
    """Checks values of a complete tree against each other; raises InputError."""
    bounds, simulation, robot = tree["gait_bounds"], tree["simulation"], tree["robot"]
    for name in ("weight", "tau_a"):
        low, high = bounds[f"{name}_min"], bounds[f"{name}_max"]
        if low > high:
            problem = f"found {low}, expected at most {name}_max, {high}"
            raise InputError(source, f"gait_bounds.{name}_min", problem)
    start, duration = simulation["steady_from"], simulation["duration"]
    if start >= duration:
        problem = f"found {start} s, expected less than the duration, {duration} s"
        raise InputError(source, "simulation.steady_from", problem)
    offsets, tetrahedra = robot.get("offsets", []), robot["tetrahedra"]
    if len(offsets) not in (0, tetrahedra):
        problem = f"found {len(offsets)}, expected none or one for each of {tetrahedra} tetrahedra"
        raise InputError(source, "robot.offsets", problem)
