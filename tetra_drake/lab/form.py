"""Form-finding: tensions and free lengths of cables that hold a structure in a wanted shape."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.linalg import null_space

from tetra_drake.errors import InputError, check_type
from tetra_drake.lab.study.statics import TOLERANCE, find_statics
from tetra_drake.laws.cable import elastic_tension
from tetra_drake.robot.structure import Structure
from tetra_drake.scenario.load import GivenScenario, given_scenario
from tetra_drake.scenario.robot_structure import StructureFile
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.settings.refusals import hint
from tetra_drake.settings.units import given_quantity

_SOURCE = "form_find"


def form_find(scenario: GivenScenario, prestress: Mapping[str, str]) -> Scenario:
    """Finds the prestress that holds a structure in the shape of its file, and its free lengths.

        >>> scenario = td.form_find("prism", {"side": "9 N"})
        >>> round(scenario.robot.cables["bottom"].tension, 3)
        5.352
        >>> cables = td.study_equilibrium(scenario).cables
        >>> free_lengths, force_densities = cables.free_length, cables.force_density

    The tensions are a state of self-stress, in balance without weight and loads. All cables of a
    group get the same tension. Stiffnesses stay; weight then moves the nodes a little. For a height
    or shape that is wanted with weight, fit the free lengths to it: see td.fit and td.Rest.

    Args:
        scenario: a scenario with a structure, its name or file, or a run. The nodes' coordinates
            are the wanted shape; give them with seven digits.
        prestress: tension, such as "9 N", by group of cables. One group is enough if there is one
            such state of self-stress.

    Returns:
        The scenario with the tension of each group, in place of its free length.

    Raises:
        InputError: if there is no such state, if the prestress does not choose one, or if a cable
            would have to push.
    """
    scenario = given_scenario(scenario)
    check_type(_SOURCE, "prestress", prestress, Mapping)
    robot = scenario.robot
    if not isinstance(robot, StructureFile):
        raise InputError(_SOURCE, "scenario", "found a row of tetrahedra, expected a structure")
    groups, wanted = [*robot.cables], {}
    for group, given in prestress.items():
        if group not in groups:
            problem = f"found unknown cables '{group}'; {hint(group, groups)}"
            raise InputError(_SOURCE, "prestress", problem)
        wanted[group] = given_quantity(str(given), "N", _SOURCE, f"prestress.{group}")
    structure = Structure.of(robot.blueprint())
    changes: dict[str, str | None] = {}
    tensions = dict(zip(groups, _tensions(structure, groups, wanted), strict=True))
    _check_range(structure, tensions)
    for group, tension in tensions.items():
        changes[f"robot.cables.{group}.tension"] = f"{tension!r} N"
        changes[f"robot.cables.{group}.free_length"] = None
    return scenario.with_changes(changes)


def _check_range(structure: Structure, tensions: Mapping[str, float]) -> None:
    """Refuses tensions (N) of groups that would leave a cable no free length."""
    found = np.array([tensions[group] for group in structure.cable_groups])
    laws = [law._replace(free_length=0.0) for law in structure.cable_laws]
    most = np.array([*map(elastic_tension, structure.initial_lengths.tolist(), laws)])
    worst = (found / most).argmax()
    if found[worst] > most[worst]:
        name, limit = structure.cable_names[worst], f"{most[worst]:.4g} N"
        problem = f"gives '{name}' {found[worst]:.4g} N, but its free length is 0 at {limit}"
        share = 99.9 * most[worst] / found[worst]
        raise InputError(_SOURCE, "prestress", f"{problem}; expected {share:.4g} % of it at most")


def _tensions(structure: Structure, groups: list[str], wanted: Mapping[str, float]) -> list[float]:
    """Tension (N) of each group of cables in self-stress, if some groups have the `wanted`
    tensions. Raises InputError if there is not exactly one such state."""
    states = find_statics(structure, structure.p_WN).self_stresses
    is_member = np.array([[name == group for group in groups] for name in structure.cable_groups])
    # Vectors [c, g]: states.T c are the tensions of the cables, equal to g of their groups.
    found = null_space(np.hstack([states.T, -is_member.astype(float)]), TOLERANCE)[len(states) :]
    given, numbers = [groups.index(group) for group in wanted], np.array([*wanted.values()])
    count = found.shape[1]
    if not count:
        problem = "has no state of self-stress with equal tensions in each group of cables"
        problem += ", to 1e-6; rounded coordinates may hide one"
        raise InputError(_SOURCE, "scenario", problem)
    shares, _, rank, _ = np.linalg.lstsq(found[given], numbers, rcond=TOLERANCE)
    if rank < count:
        problem = f"found {rank} independent tensions, expected {count}, one for each self-stress"
        raise InputError(_SOURCE, "prestress", problem)
    tensions = found @ shares
    least, small = tensions.argmin(), TOLERANCE * np.abs(numbers).max()
    if np.abs(tensions[given] - numbers).max() > small:
        raise InputError(_SOURCE, "prestress", "found tensions that are not in balance")
    if tensions[least] < -small:
        pushing = f"the cables {groups[least]} would push with {-tensions[least]:.4g} N"
        raise InputError(_SOURCE, "prestress", f"{pushing}, expected that all pull")
    return [float(tension) for tension in tensions.clip(0.0)]
