"""A robot at rest on flat ground without actuation: statics, tensions, heights, frequencies."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.physics.cable import TENSION
from tetra_drake.physics.contact import NORMAL
from tetra_drake.physics.inertia import XX, XY, XZ, YY, YZ, ZZ
from tetra_drake.robot.equilibrium import (
    NoRest,
    Resting,
    find_rest,
    force_at_rest,
    stiffness_at_rest,
)
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.statics import Statics, find_statics
from tetra_drake.robot.structure import node_positions

if TYPE_CHECKING:
    import pandas

LEAST_FREQUENCY = 0.05
"""Hz; slower modes are motions that nothing resists, such as the spin of a bar about its axis."""


@dataclass(frozen=True)
class RestStudy:
    """A robot at rest; SI units."""

    robot: Robot
    statics: Statics
    """Statics where the robot is in balance without weight, away from the ground."""
    nodes: pandas.DataFrame
    """A row per node, by its name: body, x, y, z, load (that the ground bears)."""
    cables: pandas.DataFrame
    """A row per cable, by its name: group, length, free_length, tension."""
    frequencies: np.ndarray
    """Natural frequencies without damping, in Hz, ascending. Nodes on the ground slide freely."""


def study_rest(robot: Robot) -> RestStudy:
    """Studies a robot at rest; raises InputError if it finds none."""
    import pandas

    structure, rest = robot.structure, robot.rest
    p_WN = node_positions(structure, rest.state)
    resting = Resting.of(robot.model)
    force_at_rest(resting, rest.state)
    loads = np.zeros(len(structure.node_names))
    loads[structure.contacts] = resting.forces.pushes[:, NORMAL]
    ends = np.column_stack([structure.cables["node_a"], structure.cables["node_b"]])
    bodies = np.array(structure.bodies)[structure.carriers]
    nodes = {"body": bodies, "x": p_WN[:, 0], "y": p_WN[:, 1], "z": p_WN[:, 2], "load": loads}
    cables = {
        "group": structure.cable_groups,
        "length": rest.lengths,
        "free_length": structure.cables["free_length"],
        "tension": resting.forces.pulls[:, TENSION],
    }
    return RestStudy(
        robot=robot,
        statics=find_statics(
            p_WN=_weightless_nodes(robot), body_of_node=structure.carriers, cable_ends=ends
        ),
        nodes=pandas.DataFrame(nodes, index=list(structure.node_names)),
        cables=pandas.DataFrame(cables, index=list(structure.cable_names)),
        frequencies=_frequencies(resting, rest.state),
    )


def _weightless_nodes(robot: Robot) -> np.ndarray:
    """p_WN (nodes, 3) where the robot is in balance without weight, away from the ground."""
    model, state = robot.model, robot.rest.state.copy()
    bodies = len(model.bodies.mass)
    state[6 : 7 * bodies : 7] += 10.0 * model.bodies.radius.max()
    weightless = model.bodies._replace(weight=np.zeros(bodies))
    try:
        rest = find_rest(model._replace(bodies=weightless), state)
    except NoRest as error:
        body = robot.structure.bodies[error.body]
        problem = f"finds no balance without weight; {error.force:.3g} N are left on '{body}'"
        raise InputError(robot.scenario.name, "robot", problem) from error
    return node_positions(robot.structure, rest.state)


def _frequencies(resting: Resting, state: np.ndarray) -> np.ndarray:
    """Natural frequencies (Hz) above LEAST_FREQUENCY."""
    stiffness = stiffness_at_rest(resting, state)
    # Of M x'' = -K x with M = L Lᵀ: the eigenvalues of L^-1 K L^-T.
    factor = np.linalg.cholesky(_mass_matrix(resting))
    scaled = np.linalg.solve(factor, np.linalg.solve(factor, 0.5 * (stiffness + stiffness.T)).T)
    squares = np.linalg.eigvalsh(scaled)
    least = (2.0 * math.pi * LEAST_FREQUENCY) ** 2
    return np.sqrt(squares[squares > least]) / (2.0 * math.pi)


def _mass_matrix(resting: Resting) -> np.ndarray:
    """(6 n, 6 n) at the state that was last computed, for rotations times the greatest radius."""
    bodies, forces = resting.model.bodies, resting.forces
    matrix = np.zeros((6 * len(bodies.mass), 6 * len(bodies.mass)))
    for body, mass in enumerate(bodies.mass):
        inertia = bodies.inertia[body] if resting.model.isotropic else forces.inertia[body]
        xx, yy, zz = inertia[XX], inertia[YY], inertia[ZZ]
        xy, xz, yz = inertia[XY], inertia[XZ], inertia[YZ]
        turning, moving = slice(6 * body, 6 * body + 3), slice(6 * body + 3, 6 * body + 6)
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        matrix[turning, turning] = tensor / bodies.radius.max() ** 2
        matrix[moving, moving] = mass * np.eye(3)
    return matrix
