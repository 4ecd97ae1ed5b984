"""Struts with an axial stiffness: their lengths in equilibrium, and their part in vibrations.

Such a strut is a body of its own. It is straight, and its ends move along its axis.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from tetra_drake.physics.kinematics import FORCE
from tetra_drake.robot.equilibrium import Unactuated, force_at_rest
from tetra_drake.robot.structure import Structure, node_positions
from tetra_drake.scenario.blueprint import Blueprint

ELONGATION = 1e-6
"""Elongation of a strut for finite differences, as a share of its length."""


def elastic_struts(blueprint: Blueprint) -> np.ndarray:
    """Indices of the struts with an axial stiffness."""
    return np.flatnonzero(np.isfinite(blueprint.strut_stiffness))


def axial_forces(structure: Structure, unactuated: Unactuated, state: np.ndarray) -> np.ndarray:
    """Axial forces (struts,) in N on the struts at rest in a state; negative in compression."""
    force_at_rest(unactuated, state)
    forces = unactuated.forces.nodes[:, FORCE : FORCE + 3]
    node_a, node_b = structure.struts.T
    axes = _axes(structure, state)
    axial: np.ndarray = 0.5 * ((forces[node_b] - forces[node_a]) * axes).sum(axis=1)
    return axial


def with_elongations(blueprint: Blueprint, elongation: np.ndarray) -> Blueprint:
    """A blueprint whose struts are longer by `elongation` (struts,) in m, at both ends alike."""
    p_FN = _lengthened(blueprint.p_FN, blueprint.struts, elongation)
    return dataclasses.replace(blueprint, p_FN=p_FN)


def _lengthened(points: np.ndarray, struts: np.ndarray, elongation: np.ndarray) -> np.ndarray:
    """Positions (nodes, 3) of nodes whose struts are longer by `elongation` (struts,) than at the
    given points."""
    node_a, node_b = struts.T
    along = points[node_b] - points[node_a]
    shift = (0.5 * elongation / np.linalg.norm(along, axis=1))[:, np.newaxis] * along
    moved = points.copy()
    np.add.at(moved, node_a, -shift)
    np.add.at(moved, node_b, shift)
    return moved


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
            p_BN = _lengthened(structure.p_BN, structure.struts, elongation)
            longer = Unactuated.of(unactuated.model._replace(p_BN=p_BN))
            axial = axial_forces(structure, longer, state)[elastic]
            ends.append((force_at_rest(longer, state), axial))
        step = 2.0 * ELONGATION * lengths[strut]
        coupling[:, column] = (ends[0][0] - ends[1][0]) / step
        own[:, column] = (ends[0][1] - ends[1][1]) / step
    own += np.diag(structure.strut_stiffness[elastic])
    reduced: np.ndarray = stiffness - coupling @ np.linalg.solve(own, coupling.T)
    return reduced


def _axes(structure: Structure, state: np.ndarray) -> np.ndarray:
    """Unit vectors (struts, 3) along the struts in a state, in the world frame."""
    p_WN = node_positions(structure, state)
    node_a, node_b = structure.struts.T
    along = p_WN[node_b] - p_WN[node_a]
    axes: np.ndarray = along / np.linalg.norm(along, axis=1, keepdims=True)
    return axes
