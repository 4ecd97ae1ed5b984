"""Rules between the values of a scenario: balanced spacing, reference, relations."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from tetra_drake.errors import InputError
from tetra_drake.scenario.fields import Tree, merge

if TYPE_CHECKING:
    from tetra_drake.scenario.schema import Scenario

BALANCED = "balanced"
"""Written as robot.spacing: the spacing at which the cables of a junction balance."""


def balance(scenario: Scenario, source: object) -> None:
    """Gives a `balanced` spacing its number: there, the cables of a junction balance along x.

    Three outer cables of length s pull two tetrahedra together. Three inner ones, from a tip at
    height h to base nodes at s along and R across, push them apart while s < h.
    """
    robot, cables = scenario.robot, scenario.cables
    height, radius = robot.strut_length * math.sqrt(2.0 / 3.0), robot.strut_length / math.sqrt(3.0)

    def pull(s: float) -> float:
        length = math.hypot(radius, height - s)
        inner = cables.inner_stiffness * (length - cables.free_length) * (height - s) / length
        return cables.outer_stiffness * (s - cables.free_length) - inner

    if robot.spacing != BALANCED:
        return
    near, far = 0.0, height + cables.free_length
    if pull(near) >= 0.0:
        raise InputError(source, "robot.spacing", "the cables balance at no spacing; give one")
    while near < (middle := 0.5 * (near + far)) < far:
        near, far = (near, middle) if pull(middle) > 0.0 else (middle, far)
    robot.spacing = far


def on_base(base: Tree, given: Tree) -> Tree:
    """The tree of a base with what a file gives, which may decide on spacing and reference.

    Masses do not count for the balance: twice the density moves T1 by less than 0.003 in.
    """

    def decisive(tree: Tree) -> list[Any]:
        names = ("strut_length", "outer_stiffness", "inner_stiffness", "free_length")
        values = tree.get("robot", {}) | tree.get("cables", {})
        return [values.get(name) for name in names]

    tree: Tree = merge(base, given)
    if "spacing" not in given.get("robot", {}) and decisive(tree) != decisive(base):
        tree["robot"] = tree.get("robot", {}) | {"spacing": BALANCED}
    if not same_experiment(tree, base):
        tree["reference"] = given.get("reference")
    return tree


def same_experiment(tree: Tree, base: Tree) -> bool:
    """Whether two trees agree in all that the numbers of a reference depend on."""

    def relevant(tree: Tree) -> list[Any]:
        others = ("name", "reference", "simulation", "compiled", "evolution")
        simulation = tree.get("simulation", {})
        rest = {name: value for name, value in tree.items() if name not in others}
        return [rest, simulation.get("duration"), simulation.get("steady_from")]

    return relevant(tree) == relevant(base)


def check_relations(scenario: Scenario, source: object) -> None:
    """Checks values of a scenario against each other; raises InputError."""
    bounds, simulation, n = scenario.gait_bounds, scenario.simulation, scenario.robot.tetrahedra
    weight, tau_a, offsets = bounds.weight_min, bounds.tau_a_min, len(scenario.robot.offsets)
    start, end = simulation.steady_from, simulation.duration
    for wrong, key, found, expected in (
        (weight > bounds.weight_max, "gait_bounds.weight_min", weight, "at most weight_max"),
        (tau_a > bounds.tau_a_max, "gait_bounds.tau_a_min", f"{tau_a} s", "at most tau_a_max"),
        (start >= end, "simulation.steady_from", f"{start} s", f"less than the duration, {end} s"),
        (offsets not in (0, n), "robot.offsets", f"{offsets} items", f"none or {n}, one each"),
    ):
        if wrong:
            raise InputError(source, key, f"found {found}, expected {expected}")
