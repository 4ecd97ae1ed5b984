"""Struts with an axial stiffness: their lengths in equilibrium, and their part in vibrations.

Such a strut is a body of its own. It is straight, and its ends move along its axis. For the error
of natural frequencies, see scenario.robot_structure.StrutGroup.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from tetra_drake.laws.kinematics import FORCE
from tetra_drake.robot.equilibrium import Unactuated, force_at_rest
from tetra_drake.robot.structure import Structure, node_positions
from tetra_drake.scenario.blueprint import Blueprint

ELONGATION = 1e-6
"""Elongation of a strut for finite differences, as a share of its length."""


def elastic_struts(blueprint: Blueprint) -> np.ndarray:
    """Indices of the struts with an axial stiffness."""
    return np.flatnonzero(np.isfinite(blueprint.strut_stiffness))


def axial_forces(structure: Structure, unactuated: Unactuated, state: np.ndarray) -> np.ndarray:
    """Axial forces (struts,) in N on the struts at rest in a state; negative in compression.

    The force on each end counts by the end's distance from the centre of mass, which stays where it
    is as a strut becomes longer.
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


def with_elongations(structure: Structure, elongation: np.ndarray) -> Structure:
    """A structure whose struts are longer by `elongation` (struts,) in m. The bodies keep their
    centres of mass, masses and inertias."""
    p_BN = structure.p_BN.copy()
    for strut in elastic_struts(structure):
        share = elongation[strut] / structure.strut_table.length[strut]
        p_BN[structure.struts[strut]] *= 1.0 + share
    return dataclasses.replace(structure, p_BN=p_BN)


def condensed(
    stiffness: np.ndarray, structure: Structure, unactuated: Unactuated, state: np.ndarray
) -> np.ndarray:
    """A stiffness matrix (6 n, 6 n) of rigid bodies in equilibrium, with the compliance of the
    elastic struts: their elongations follow the displacements of the bodies without inertia."""
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
            p_BN = with_elongations(structure, elongation).p_BN
            longer = Unactuated(unactuated.model._replace(p_BN=p_BN))
            axial = axial_forces(structure, longer, state)[elastic]
            ends.append((force_at_rest(longer, state), axial))
        step = 2.0 * ELONGATION * lengths[strut]
        coupling[:, column] = (ends[0][0] - ends[1][0]) / step
        own[:, column] = (ends[0][1] - ends[1][1]) / step
    own += np.diag(structure.strut_stiffness[elastic])
    return np.asarray(stiffness - coupling @ np.linalg.solve(own, coupling.T))
