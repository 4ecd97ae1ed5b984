"""Struts of a robot: which ones overlap, and how elastic ones change their lengths and vibrate.

A strut with an axial stiffness is a body of its own. It is straight, and its ends move along its
axis. For the error of natural frequencies, see scenario.robot_structure.StrutGroup.
"""

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
from tetra_drake.laws.kinematics import FORCE
from tetra_drake.robot.equilibrium import Unactuated, force_at_rest
from tetra_drake.robot.ground import START_DEPTH
from tetra_drake.robot.structure import Structure, moved_nodes, node_positions
from tetra_drake.scenario.blueprint import Blueprint
from tetra_drake.scenario.world import World

SKIN = 0.05
"""Gap at which two struts count as near, as a share of the shortest strut. With a larger one, more
pairs are near; with a smaller one, near pairs are searched more often."""
PASSAGE = 0.5
"""Distance that a step may carry a strut into another, as a share of the least radius. Struts pass
through each other at four times this distance."""
MEETING = 1e-12
"""Largest distance (m) between the axes of two struts that meet; it allows for rounding errors."""
ELONGATION = 1e-6
"""Elongation of a strut for finite differences, as a share of its length."""


def strut_contact_law(scenario: World, structure: Structure) -> StrutContactLaw:
    """Constants of the contact between struts for the kernels: its law, and the distances that
    decide which pairs of struts are checked. Its field `acts` is False without struts: then the
    kernels check none."""
    lightest, radii = structure.mass.min(), structure.strut_radius
    if not radii.size:
        search = StrutSearch(0.0, drift=0.0, passage=0.0, lightest=lightest)
        return scenario.strut_contact.law(search)._replace(acts=False)
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
    find_near_struts(struts, contact, structure.radius, state, nodes, near)
    found = {}
    for i, j in near.pairs[: near.count[0]].tolist():
        depth = find_touch(struts, nodes, i, j).depth
        if depth > allowed:
            names = structure.strut_name(i), structure.strut_name(j)
            found[names] = depth, struts.radius[i] + struts.radius[j] - depth
    return found


def elastic_struts(blueprint: Blueprint) -> np.ndarray:
    """Indices of the struts with an axial stiffness."""
    return np.flatnonzero(np.isfinite(blueprint.strut_stiffness))


def axial_forces(structure: Structure, unactuated: Unactuated, state: np.ndarray) -> np.ndarray:
    """Axial forces (struts,) in N on the struts at rest in a state [q; v] (13*bodies,); negative in
    compression. `unactuated` is the same robot with its arrays of forces, which are overwritten.

    The forces on the two ends are weighted by the distances of the ends from the body's centre of
    mass, divided by the strut's length. For the centre of mass stays where it is as a strut becomes
    longer, so an end moves in proportion to its distance from it.
    """
    force_at_rest(unactuated, state)
    forces = unactuated.forces.nodes[:, FORCE : FORCE + 3]
    p_WN, p_BN = node_positions(structure, state), structure.p_BN
    node_a, node_b = structure.struts.T
    lengths = structure.strut_table.length
    axes = (p_WN[node_b] - p_WN[node_a]) / lengths[:, np.newaxis]
    axes_B = (p_BN[node_b] - p_BN[node_a]) / lengths[:, np.newaxis]
    axial = np.zeros(len(lengths))
    for ends in (node_a, node_b):
        distance = (p_BN[ends] * axes_B).sum(axis=1)
        axial += (forces[ends] * axes).sum(axis=1) * distance / lengths
    return axial


def elongated(structure: Structure, elongation: np.ndarray) -> np.ndarray:
    """Positions p_BN (nodes, 3) in m, in the frames of their bodies, of the nodes of a structure
    whose elastic struts are made longer by `elongation` (struts,) in m. Entries of rigid struts are
    ignored. The bodies keep their centres of mass."""
    p_BN = structure.p_BN.copy()
    for strut in elastic_struts(structure):
        share = elongation[strut] / structure.strut_table.length[strut]
        p_BN[structure.struts[strut]] *= 1.0 + share
    return p_BN


def condensed(
    stiffness: np.ndarray, structure: Structure, unactuated: Unactuated, state: np.ndarray
) -> np.ndarray:
    """Stiffness matrix (6*n, 6*n) in N/m with the compliance of the elastic struts (static
    condensation). `unactuated` is the same robot with its arrays of forces.

    `stiffness` is the matrix of the n bodies as if rigid, from stiffness_at_rest(), in the
    equilibrium `state` (13*n,). The elongations of the struts have no inertia: they follow the
    displacements of the bodies at once.
    """
    elastic = elastic_struts(structure)
    if not elastic.size:
        return stiffness
    coupling, own = np.empty((len(stiffness), elastic.size)), np.empty((elastic.size, elastic.size))
    lengths = structure.strut_table.length
    for column, strut in enumerate(elastic):
        ends = []
        for sign in (-1.0, 1.0):
            elongation = np.zeros(len(lengths))
            elongation[strut] = sign * ELONGATION * lengths[strut]
            p_BN = elongated(structure, elongation)
            longer = Unactuated(unactuated.model._replace(p_BN=p_BN))
            axial = axial_forces(structure, longer, state)[elastic]
            ends.append((force_at_rest(longer, state), axial))
        step = 2.0 * ELONGATION * lengths[strut]
        coupling[:, column] = (ends[0][0] - ends[1][0]) / step
        own[:, column] = (ends[0][1] - ends[1][1]) / step
    own += np.diag(structure.strut_stiffness[elastic])
    return np.asarray(stiffness - coupling @ np.linalg.solve(own, coupling.T))
