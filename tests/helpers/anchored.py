"""Structures that hang, stand on supports, carry loads or float, without ground."""

from __future__ import annotations

import functools
from typing import Any

from helpers.converged import shortly
from helpers.structures import SIDES_ALONE
from tetra_drake.laws.capsules import NoStrutContact
from tetra_drake.laws.terrain import Nothing
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.robot_structure import StructureFile
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.scenario.structure_files import read_structure

BAR: dict[str, Any] = {"pairs": [["a", "b"]], "diameter": 0.008, "density": 1200.0}
BAR |= {"node_diameter": 0.0, "contact_radius": 0.0}
LINE = {"pairs": [["top", "a"]], "stiffness": 200.0, "damping": 0.0, "free_length": 0.4}

HUNG: dict[str, Any] = {
    "nodes": {"top": [0.0, 0.0, 1.0], "a": [0.0, 0.0, 0.58], "b": [0.0, 0.0, 0.38]},
    "struts": {"bar": BAR},
    "cables": {"line": LINE},
    "masses": {"a": 0.2, "b": 0.3},
    "anchors": {"top": "xyz"},
}
"""An upright bar with a mass at each end that hangs by a cable."""

SWINGING: dict[str, Any] = {
    "nodes": {"a": [0.0, 0.0, 0.0], "b": [0.0, 0.0, -0.4]},
    "struts": {"bar": BAR},
    "masses": {"b": 0.05},
    "anchors": {"a": "xyz"},
    "anchor_stiffness": 1e6,
}
"""A bar whose upper node is held."""

SUPPORTS = {"n0": "xyz", "n1": "yz", "n2": "z"}
"""Anchors of the prism: as many as it takes to hold a rigid body."""
LOADS = {"n3": [0.0, 0.0, -0.4], "n4": [0.1, 0.0, -0.3]}


load_once = functools.cache(load_scenario)
read_once = functools.cache(read_structure)


def scenario_of(tree: dict[str, Any], duration: float = 2.0, **changes: object) -> Scenario:
    """A structure without ground and contact of struts, its numbers in SI; `actuation="!Winch"`
    changes a section."""
    robot = StructureFile.model_validate(tree)
    parts = {"robot": robot, "terrain": Nothing(), "strut_contact": NoStrutContact()}
    scenario = load_once("prism").with_sections(name="anchored", **parts)
    return shortly(scenario, duration, **changes)


def supported_prism(**changes: object) -> Scenario:
    """The shipped prism on supports, with loads."""
    parts = {"anchors": SUPPORTS, "loads": LOADS, "actuated": SIDES_ALONE}
    return scenario_of(read_once("prism").model_dump() | parts, **changes)


def floating_prism(**changes: object) -> Scenario:
    """The shipped prism without weight."""
    return scenario_of(read_once("prism").model_dump() | {"gravity": 0.0}, **changes)
