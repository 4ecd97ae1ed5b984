"""Struts of a robot: constants of their contact, and which ones overlap."""

from __future__ import annotations

import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.laws.capsules import (
    NearStruts,
    StrutContactLaw,
    StrutSearch,
    find_near_struts,
    find_touch,
)
from tetra_drake.laws.contact import NormalForce
from tetra_drake.robot.ground import START_DEPTH
from tetra_drake.robot.structure import Structure, moved_nodes
from tetra_drake.scenario.world import World

SKIN = 0.05
"""Gap at which two struts count as near, as a share of the shortest strut. With a larger one, more
pairs are near; with a smaller one, near pairs are searched more often."""
PASSAGE = 0.5
"""Distance that a step may carry a strut into another, as a share of the least radius. Struts pass
through each other at four times this distance."""
MEETING = 1e-12
"""Largest distance (m) between the axes of two struts that meet; it allows for rounding errors."""


def strut_contact_law(scenario: World, structure: Structure) -> StrutContactLaw:
    """Constants of the contact between struts for the kernels: its law, and the distances that
    decide which pairs of struts are checked. Its field `acts` is False without struts: then the
    kernels check none."""
    lightest, radii = structure.mass.min(), structure.strut_radius
    if not radii.size:
        return StrutContactLaw()
    skin = SKIN * structure.strut_table.length.min()
    near, passage = 2.0 * radii.max() + skin, PASSAGE * radii.min()
    search = StrutSearch(near, drift=0.25 * skin, passage=passage, lightest=lightest)
    return scenario.strut_contact.law(search)


def check_apart(scenario: World, structure: Structure, *, may_overlap: bool = False) -> None:
    """Raises InputError if struts of different bodies overlap in the initial pose of a structure,
    unless the robot's weight would press them as deep into each other.

    With `may_overlap`, overlaps are allowed, except where the axes of two struts meet: then no
    direction leads them apart. Nothing is checked if the scenario lets struts pass through each
    other."""
    if not strut_contact_law(scenario, structure).acts:
        return
    found = overlaps(scenario, structure, structure.initial_state)
    for (first, second), (depth, distance) in found.items():
        struts = f"struts '{first}' and '{second}'"
        if distance <= MEETING:
            problem = f"the axes of {struts} meet at the start; move their nodes"
            raise InputError(scenario.name, "strut_contact", problem)
        if not may_overlap:
            advice = "move their nodes, make them thinner, or set strut_contact to !Nothing"
            problem = f"{struts} overlap by {1e3 * depth:.3g} mm at the start; {advice}"
            raise InputError(scenario.name, "strut_contact", problem)


def overlaps(
    scenario: World, structure: Structure, state: np.ndarray
) -> dict[tuple[str, str], tuple[float, float]]:
    """Overlaps of struts of different bodies in a state [q; v] (13*bodies,).

    Key: the names of the two struts. Value: depth of the overlap and distance of the axes, in m.
    Depths by which the robot's weight presses touching struts into each other are left out.
    """
    struts, contact = structure.strut_table, strut_contact_law(scenario, structure)
    allowed = START_DEPTH * structure.scale
    if contact.acts:
        weight = float(structure.mass.sum()) * scenario.robot.gravity
        allowed += weight / NormalForce(*contact.normal).stiffness
    near, nodes = NearStruts.of(struts), moved_nodes(structure, state)
    limit = StrutSearch(*contact.search).near
    find_near_struts(struts, limit, structure.radius, state, nodes, near)
    found = {}
    for i, j in near.pairs[: near.count[0]].tolist():
        depth = find_touch(struts, nodes, i, j).depth
        if depth > allowed:
            names = structure.strut_name(i), structure.strut_name(j)
            found[names] = depth, struts.radius[i] + struts.radius[j] - depth
    return found
