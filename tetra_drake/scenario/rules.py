"""Rules between the values of a scenario: balanced spacing, reference, relations; all on trees."""

from __future__ import annotations

import math
from typing import Any

from tetra_drake.errors import InputError
from tetra_drake.scenario.fields import Tree

BALANCED = "balanced"
"""Written as robot.spacing: the spacing at which the cables of a junction balance."""

BALANCE_KEYS = (
    *(("robot", "strut_length"), ("cables", "free_length")),
    *(("cables", "outer_stiffness"), ("cables", "inner_stiffness")),
)
"""What decides the balance. Masses hardly do: twice the density moves T1 by 0.002 in."""

NOT_IN_REFERENCE = ("name", "reference", "simulation", "compiled", "evolution")
"""Sections on which the numbers of a reference do not depend, duration and steady_from aside."""


def balanced_spacing(
    *, strut_length: float, free_length: float, outer_stiffness: float, inner_stiffness: float
) -> float:
    """Spacing (m) of base triangles at which outer and inner cables balance along x.

    Three outer cables of length s pull two tetrahedra together. Three inner ones, from a tip at
    height h to base nodes at s along and R across, push them apart while s < h. Raises ValueError.
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
    """A complete tree, with a number for a balanced spacing."""
    if tree["robot"]["spacing"] != BALANCED:
        return tree
    try:
        spacing = balanced_spacing(**{name: tree[part][name] for part, name in BALANCE_KEYS})
    except ValueError as error:
        raise InputError(source, "robot.spacing", str(error)) from error
    return tree | {"robot": tree["robot"] | {"spacing": spacing}}


def rebalanced(tree: Tree, *, base: Tree, given: Tree) -> Tree:
    """The tree of a file on its base; balanced if the file decides the balance but no spacing."""
    decisive = [(tree.get(a, {}).get(b), base.get(a, {}).get(b)) for a, b in BALANCE_KEYS]
    if "spacing" in given.get("robot", {}) or all(ours == theirs for ours, theirs in decisive):
        return tree
    return tree | {"robot": tree.get("robot", {}) | {"spacing": BALANCED}}


def with_valid_reference(tree: Tree, *, base: Tree, given: Tree) -> Tree:
    """The changed tree, without its base's reference if that is for another experiment."""

    def experiment(tree: Tree) -> list[Any]:
        simulation = tree.get("simulation", {})
        rest = {name: value for name, value in tree.items() if name not in NOT_IN_REFERENCE}
        return [rest, simulation.get("duration"), simulation.get("steady_from")]

    same = experiment(tree) == experiment(base)
    return tree if same else tree | {"reference": given.get("reference")}


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
    offsets, n = len(robot.get("offsets", [])), robot["tetrahedra"]
    if offsets not in (0, n):
        problem = f"found {offsets} items, expected none or {n}, one for each tetrahedron"
        raise InputError(source, "robot.offsets", problem)
