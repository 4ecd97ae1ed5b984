"""Form-finding: tensions and free lengths of cables that hold a structure in a wanted shape."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas

from tetra_drake.errors import InputError, check_type
from tetra_drake.robot.statics import TOLERANCE, find_statics, null_space
from tetra_drake.robot.structure import Structure
from tetra_drake.scenario.load import GivenScenario, given_scenario
from tetra_drake.scenario.robot_structure import StructureFile
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.settings.refusals import hint
from tetra_drake.settings.units import given_quantity

_SOURCE = "form_find"


@dataclass(frozen=True)
class Form:
    """Prestressed structure that form_find() has found; SI units."""

    scenario: Scenario
    """The scenario with the tensions of the cables."""
    cables: pandas.DataFrame
    """A row per cable, by its name: group, length, tension, force_density (tension per length,
    N/m), free_length."""


def form_find(scenario: GivenScenario, prestress: Mapping[str, str | float]) -> Form:
    """Finds the prestress that holds a structure in the shape of its file, and its free lengths.

        >>> form = td.form_find("prism", {"side": "9 N"})
        >>> densities = form.cables.groupby("group").force_density.mean()
        >>> round(densities["side"] / densities["bottom"], 3)
        1.732
        >>> study = td.study_equilibrium(form.scenario)

    The tensions are a state of self-stress, in balance without weight and loads. All cables of a
    group get the same tension. Stiffnesses stay; weight then moves the nodes a little. For a wanted height or shape at rest, with weight, fit free lengths to it: see td.fit and
    td.Rest.

    Args:
        scenario: a scenario with a structure, its name or file, or a run. The nodes' coordinates
            are the wanted shape.
        prestress: tension by group of cables, as text or in N. One group is enough if there is one
            such state of self-stress.

    Raises:
        InputError: if there is no such state, if the prestress does not choose one, or if a cable
            would have to push.
    """
    scenario = given_scenario(scenario)
    check_type(_SOURCE, "prestress", prestress, Mapping)
    robot = scenario.robot
    if not isinstance(robot, StructureFile):
        raise InputError(_SOURCE, "scenario", "found a row of tetrahedra, expected a structure")
    groups = [*robot.cables]
    for group in prestress:
        if group not in groups:
            problem = f"found unknown cables '{group}'; {hint(group, groups)}"
            raise InputError(_SOURCE, "prestress", problem)
    wanted = [
        given_quantity(given, "N", _SOURCE, f"prestress.{group}")
        if isinstance(given, str)
        else float(given)
        for group, given in prestress.items()
    ]
    structure = Structure.of(robot.blueprint())
    tensions = _group_tensions(structure, groups, [*map(groups.index, prestress)], wanted)
    changes = {
        f"robot.cables.{group}.{key}": value
        for group, tension in zip(groups, tensions, strict=True)
        for key, value in (("tension", f"{tension!r} N"), ("free_length", None))
    }
    changed = scenario.with_changes(changes)
    of_cables = dict(zip(groups, tensions, strict=True))
    cables = pandas.DataFrame({"group": structure.cable_groups}, index=[*structure.cable_names])
    cables["length"] = structure.initial_lengths
    cables["tension"] = cables["group"].map(of_cables)
    cables["force_density"] = cables["tension"] / cables["length"]
    cables["free_length"] = Structure.of(changed.robot.blueprint()).cables["free_length"]
    return Form(changed, cables)


def _group_tensions(
    structure: Structure, groups: list[str], given: list[int], wanted: list[float]
) -> list[float]:
    """Tension (N) of each group of cables in self-stress, if the groups with the indices `given`
    have the `wanted` tensions. Raises InputError if there is not exactly one such state."""
    states = find_statics(
        p_WN=structure.p_WN,
        body_of_node=structure.carriers,
        segments=structure.segments,
        held=structure.held,
        joints=structure.joints,
    ).self_stresses
    is_member = np.array([[name == group for group in groups] for name in structure.cable_groups])
    # Vectors [c, g]: states.T c are the tensions of the cables, equal to g of their groups.
    found = null_space(np.hstack([states.T, -is_member.astype(float)]), TOLERANCE)[len(states) :]
    count = found.shape[1]
    if not count:
        problem = "has no state of self-stress with equal tensions in each group of cables"
        raise InputError(_SOURCE, "scenario", problem)
    shares, _, rank, _ = np.linalg.lstsq(found[given], np.array(wanted), rcond=TOLERANCE)
    if rank < count:
        problem = f"found {rank} independent tensions, expected {count}, for {count} states of"
        raise InputError(_SOURCE, "prestress", f"{problem} self-stress")
    tensions, most = found @ shares, max(map(abs, wanted))
    if np.abs(tensions[given] - wanted).max() > TOLERANCE * most:
        raise InputError(_SOURCE, "prestress", "found tensions that are not in balance")
    if tensions.min() < -TOLERANCE * most:
        pushing = f"{groups[tensions.argmin()]} would push with {-tensions.min():.4g} N"
        raise InputError(_SOURCE, "prestress", f"the cables {pushing}, expected that all pull")
    return [max(float(tension), 0.0) for tension in tensions]
