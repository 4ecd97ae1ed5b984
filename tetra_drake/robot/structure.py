"""The robot's structure as data: nodes, struts, cables, contacts."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tetra_drake.physics.cable import CABLE
from tetra_drake.physics.kinematics import NODE_COLUMNS, P_WN, V_WN, move_nodes
from tetra_drake.robot.actuation import Actuation
from tetra_drake.scenario.cable_names import CABLES
from tetra_drake.scenario.schema import Scenario

NODES = ("bottom_left", "bottom_right", "top", "tip")
"""The nodes of a tetrahedron; the first three form the base triangle."""

BOTTOM_LEFT, BOTTOM_RIGHT, TOP, TIP = range(4)
BASE = (BOTTOM_LEFT, BOTTOM_RIGHT, TOP)
STRUTS = tuple((i, j) for i in range(4) for j in range(i + 1, 4))


@dataclass(frozen=True)
class Structure:
    """n tetrahedra in a row, T1 (rear) to Tn (lead), tied together by cables.

    A node's index is 4 * body + its place in NODES. Lengths in m.
    """

    bodies: tuple[str, ...]
    """The names of the bodies, "T1" to "Tn"."""
    p_BN: np.ndarray
    """(4, 3): the nodes in the frame of a body, whose origin is the centre of mass."""
    p_WB: np.ndarray
    """(n, 3): the bodies at t = 0."""
    q_WB: np.ndarray
    """(4,): the quaternion, w first, that all have then."""
    cables: np.ndarray
    """(6 (n - 1),) of dtype CABLE."""
    cable_names: tuple[str, ...]
    """Such as "T1-T2 outer bottom_left"."""
    actuation: Actuation
    contacts: np.ndarray
    """(2 n + 1,) or (4 n,): the indices of the nodes that the ground can touch."""
    strut_radius: float
    node_radius: float
    density: float

    @property
    def signals(self) -> int:
        """Actuation signals: one per oscillator."""
        return len(self.actuation.names)

    @property
    def node_names(self) -> tuple[str, ...]:
        """Such as "T1 tip", by node index."""
        return tuple(f"{body} {node}" for body in self.bodies for node in NODES)

    @property
    def initial_state(self) -> np.ndarray:
        """(13 n,): [q; v] at t = 0, at rest."""
        q = [np.concatenate((self.q_WB, p_WBi)) for p_WBi in self.p_WB]
        return np.concatenate([*q, np.zeros(6 * len(self.bodies))])


def MakeStructure(scenario: Scenario) -> Structure:
    """The robot of thesis section 2.1 with `robot.tetrahedra` tetrahedra.

    Base triangles stand vertical with two nodes at height 0, those of T1 at x = 0; the
    tips point forward (+x) into the next tetrahedron. Junction i joins T(i+1) and T(i+2)
    by 3 outer cables (base node to base node) and 3 inner ones (tip to base nodes); see
    CABLES and Actuation. On an incline without start, the robot is turned with
    the slope, about World's y axis.
    """
    robot, cables = scenario.robot, scenario.cables
    n = robot.tetrahedra
    edge = robot.strut_length
    circumradius = edge / math.sqrt(3.0)
    height = edge * math.sqrt(2.0 / 3.0)
    x, z = -height / 4, -circumradius / 2
    base = [[x, edge / 2, z], [x, -edge / 2, z], [x, 0.0, circumradius]]
    p_BN = np.array([*base, [3 * height / 4, 0.0, 0.0]])
    bodies = tuple(f"T{i + 1}" for i in range(n))
    p_WB = np.array([[height / 4 + i * robot.spacing, 0.0, circumradius / 2] for i in range(n)])
    if robot.offsets:
        p_WB += np.array(robot.offsets)
    slope = scenario.terrain.plane_slope or 0.0
    # Written out, as a product of matrices is rounded differently on different processors.
    s, c = math.sin(slope), math.cos(slope)
    forward, left, up = p_WB.T
    p_WB = np.stack([c * forward - s * up, left, s * forward + c * up], axis=1)
    actuation, names = Actuation.of(scenario), []
    rows: list[tuple[float, ...]] = []
    for i in range(n - 1):
        for cable in CABLES:
            role, node = cable.split()
            outer, place = role == "outer", NODES.index(node)
            a, b = 4 * i + (place if outer else TIP), 4 * (i + 1) + place
            stiffness = cables.outer_stiffness if outer else cables.inner_stiffness
            driver = actuation.drivers[len(rows)]
            rows.append((a, b, driver, stiffness, cables.damping, cables.free_length))
            names.append(f"{bodies[i]}-{bodies[i + 1]} {cable}")
    bottom = [4 * i + node for i in range(n) for node in (BOTTOM_LEFT, BOTTOM_RIGHT)]
    contacts = [*bottom, 4 * (n - 1) + TIP] if robot.contacts == "thesis" else range(4 * n)
    return Structure(
        bodies=bodies,
        p_BN=p_BN,
        p_WB=p_WB,
        q_WB=np.array([math.cos(slope / 2), 0.0, -math.sin(slope / 2), 0.0]),
        cables=np.array(rows, dtype=CABLE),
        cable_names=tuple(names),
        actuation=actuation,
        contacts=np.array(contacts),
        strut_radius=robot.strut_diameter / 2,
        node_radius=robot.node_diameter / 2,
        density=robot.density,
    )


def node_positions(structure: Structure, state: np.ndarray) -> np.ndarray:
    """p_WN (nodes, 3) in m from the state (13 n,) of the bodies."""
    return moved_nodes(structure, state)[:, P_WN : P_WN + 3]


def node_velocities(structure: Structure, state: np.ndarray) -> np.ndarray:
    """v_WN (nodes, 3) in m/s from the state (13 n,) of the bodies."""
    return moved_nodes(structure, state)[:, V_WN : V_WN + 3]


def moved_nodes(structure: Structure, state: np.ndarray) -> np.ndarray:
    """The `nodes` of physics.kinematics, without forces, for a state (13 n,) of the bodies."""
    nodes = np.empty((len(NODES) * len(structure.bodies), NODE_COLUMNS))
    move_nodes(state, structure.p_BN, nodes)
    return nodes
