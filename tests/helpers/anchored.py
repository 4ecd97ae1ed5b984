"""Structures that hang, stand on supports, carry loads or float, without ground."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any

import yaml

from helpers.converged import shortly
from helpers.structures import SIDES_ALONE
from tetra_drake.laws.capsules import NoStrutContact
from tetra_drake.laws.terrain import Nothing
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.robot_structure import StructureFile
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.scenario.structure_files import read_structure

TREES: dict[str, dict[str, Any]] = yaml.safe_load(
    Path(__file__).with_name("trees.yaml").read_text("utf-8")
)
"""Structures by name; the file says what they are."""
HUNG, SWINGING = TREES["hung"], TREES["swinging"]
BAR, LINE = HUNG["struts"]["bar"], HUNG["cables"]["line"]

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


def slung_prism(path: str) -> Scenario:
    """The shipped prism with a cable over fixed rings, from node to node of a path."""
    prism, fixed = read_once("prism").model_dump(), TREES["slung"]["nodes"]
    sling = TREES["slung"]["cables"]["sling"] | {"pairs": [path.split()]}
    parts = {"nodes": prism["nodes"] | fixed, "cables": prism["cables"] | {"sling": sling}}
    return scenario_of(prism | parts | {"anchors": dict.fromkeys(fixed, "xyz")})
