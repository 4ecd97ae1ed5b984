"""Study of a robot in equilibrium on flat ground without actuation: statics, tensions, node
positions, natural frequencies."""

from __future__ import annotations

import dataclasses
import functools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tetra_drake.laws.cable import TENSION
from tetra_drake.laws.contact import NORMAL
from tetra_drake.laws.kinematics import FORCE
from tetra_drake.laws.rigid_motions import rigid_motions
from tetra_drake.robot.equilibrium import Unactuated, force_at_rest, mass_matrix, stiffness_at_rest
from tetra_drake.robot.robot import Robot, equilibrium_of
from tetra_drake.robot.statics import Statics, find_statics
from tetra_drake.robot.structure import node_positions
from tetra_drake.robot.struts import condensed
from tetra_drake.scenario.load import GivenScenario, given_scenario

if TYPE_CHECKING:
    import pandas

LEAST_FREQUENCY = 0.05
"""Least natural frequency in Hz. A slower mode is a motion that no force resists, such as the spin
of a bar about its axis."""
_LEAST_SQUARE = (2.0 * math.pi * LEAST_FREQUENCY) ** 2


@dataclass(frozen=True)
class EquilibriumStudy:
    """Result of study_equilibrium(); SI units."""

    robot: Robot
    statics: Statics
    """Statics of the robot without weight and loads, away from the ground."""
    nodes: pandas.DataFrame
    """A row per node, by its name: body, x, y, z, load (normal force of the ground), and the force
    of its anchor on the structure, anchor_x, anchor_y, anchor_z."""
    cables: pandas.DataFrame
    """A row per cable, by its name: group, length, free_length, tension."""
    frequencies: np.ndarray
    """Natural frequencies without damping, in Hz, ascending. Nodes on the ground slide freely."""

    @functools.cached_property
    def modes(self) -> np.ndarray:
        """Mode shapes (frequencies, nodes, 3): displacements of the nodes, 1 for the farthest
        one."""
        from scipy import linalg

        structure, unactuated = self.robot.structure, Unactuated(self.robot.model)
        squares, motions = linalg.eigh(*_vibration(self.robot, unactuated))
        motions = motions[:, squares > _LEAST_SQUARE]
        by_body = motions.reshape(len(structure.bodies), 6, -1)
        by_body[:, :3] /= unactuated.radius
        p_WB = self.robot.equilibrium.state[: 7 * len(by_body)].reshape(-1, 7)[:, 4:]
        p_WN = self.nodes[["x", "y", "z"]].to_numpy()
        modes = np.zeros((motions.shape[1], *p_WN.shape))
        for body, motion in enumerate(by_body):
            own = slice(structure.first_node[body], structure.first_node[body + 1])
            modes[:, own] = (rigid_motions(p_WN[own] - p_WB[body]) @ motion).transpose(2, 0, 1)
        return modes / np.linalg.norm(modes, axis=2).max(axis=1)[:, np.newaxis, np.newaxis]


def study_equilibrium(given: Robot | GivenScenario) -> EquilibriumStudy:
    """Studies a robot in equilibrium.

        >>> study = td.study_equilibrium("prism")
        >>> study.frequencies.round(1)[:3]
        array([12.9, 12.9, 17.4])
        >>> tensions, heights = study.cables.tension, study.nodes.z

    Args:
        given: a scenario, its name or file, or a run; or a robot.

    Raises:
        InputError: if the robot has no equilibrium.
    """
    import pandas
    from scipy import linalg

    robot = given if isinstance(given, Robot) else Robot.of(given_scenario(given))
    structure, equilibrium = robot.structure, robot.equilibrium
    unactuated, p_WN = Unactuated(robot.model), node_positions(structure, equilibrium.state)
    force_at_rest(unactuated, equilibrium.state)
    nodes = pandas.DataFrame(p_WN, list(structure.node_names), ["x", "y", "z"])
    nodes.insert(0, "body", structure.body_of_node)
    nodes["load"] = 0.0
    nodes.iloc[structure.contacts, -1] = unactuated.forces.ground_forces[:, NORMAL]
    fixed, anchors, forces = structure.first_node[-1], structure.anchors, np.zeros_like(p_WN)
    forces[fixed:] = -unactuated.forces.nodes[fixed : len(p_WN), FORCE : FORCE + 3]
    forces[anchors.nodes] = anchors.stiffness * (anchors.places - p_WN[anchors.nodes])
    nodes[[f"anchor_{axis}" for axis in "xyz"]] = forces
    cables = {
        "group": structure.cable_groups,
        "length": equilibrium.lengths,
        "free_length": structure.cables["free_length"],
        "tension": unactuated.forces.cable_forces[:, TENSION],
    }
    nowhere, no_load = np.array([], dtype=np.int64), np.zeros_like(structure.node_load)
    lifted = dataclasses.replace(structure, contacts=nowhere, node_load=no_load)
    weightless = robot.scenario.with_numbers({"robot.gravity": 0.0})
    alone = equilibrium_of(weightless, lifted, equilibrium.state)
    squares = linalg.eigvalsh(*_vibration(robot, Unactuated(robot.model)))
    return EquilibriumStudy(
        robot=robot,
        statics=find_statics(
            p_WN=node_positions(lifted, alone.state),
            body_of_node=structure.carriers,
            cable_ends=structure.cable_ends,
            held=structure.held,
        ),
        nodes=nodes,
        cables=pandas.DataFrame(cables, index=list(structure.cable_names)),
        frequencies=np.sqrt(squares[squares > _LEAST_SQUARE]) / (2.0 * math.pi),
    )


def _vibration(robot: Robot, unactuated: Unactuated) -> tuple[np.ndarray, np.ndarray]:
    """K and M of the motion M x'' = -K x about the equilibrium, without damping. For x see
    displaced()."""
    state = robot.equilibrium.state
    force_at_rest(unactuated, state)
    stiffness = condensed(stiffness_at_rest(unactuated), robot.structure, unactuated, state)
    return stiffness, mass_matrix(unactuated)
