"""Robots that settle: equilibrium at the start, and how elastic struts change their lengths. A
robot that starts where its settings place it does not load this module.

A strut with an axial stiffness is a body of its own. It is straight, and its ends move along its
axis. For the error of natural frequencies, see scenario.robot_structure.StrutGroup.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.laws.kinematics import FORCE
from tetra_drake.laws.model import Model
from tetra_drake.robot.equilibrium import (
    Unactuated,
    find_equilibrium,
    force_at_rest,
)
from tetra_drake.robot.ground import lift
from tetra_drake.robot.structure import Structure, node_positions
from tetra_drake.robot.struts import strut_contact_law
from tetra_drake.scenario.blueprint import Blueprint
from tetra_drake.scenario.world import World

MOST_CORRECTIONS = 100
"""Largest number of corrections of the lengths of elastic struts, in the search for equilibrium."""
SAME_LENGTH = 1e-10
"""Change (m) of an elastic strut's length below which no further correction is made."""


def settled(scenario: World, placed: Structure, model: Model) -> tuple[Structure, Model]:
    """Moves a structure into equilibrium on flat ground. Returns the moved structure and its model.

    `placed` and `model` are the structure and its model at the positions of the settings. Elastic
    struts become as long as their forces in equilibrium make them. The forces depend on the
    lengths, so both are corrected alternately.
    """
    up = np.array([0.0, 0.0, lift(scenario, placed)])
    structure = dataclasses.replace(placed, p_WB=placed.p_WB + up)
    elongation, change = np.zeros(len(placed.struts)), np.inf
    for _ in range(MOST_CORRECTIONS + 1):
        equilibrium = find_equilibrium(
            model, structure.initial_state, bodies=placed.bodies, source=scenario.name
        )
        poses = equilibrium.state[: 7 * len(placed.bodies)].reshape(-1, 7)
        structure = dataclasses.replace(
            structure, q_WB=poses[:, :4], p_WB=poses[:, 4:], equilibrium=equilibrium
        )
        if change < SAME_LENGTH or not elastic_struts(placed).size:
            return structure, model

        before = elongation
        forces = axial_forces(structure, Unactuated(model), structure.initial_state)
        elongation = forces / placed.strut_stiffness
        change = np.abs(elongation - before).max()
        structure = dataclasses.replace(structure, p_BN=elongated(placed, elongation))
        model = model._replace(
            p_BN=structure.p_BN,
            struts=structure.strut_table,
            strut_contact=strut_contact_law(scenario, structure),
            bodies=model.bodies._replace(radius=structure.radius),
        )
    problem = "are too soft: their lengths find no equilibrium; give more axial_stiffness"
    raise InputError(scenario.name, "robot.struts", problem)


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
