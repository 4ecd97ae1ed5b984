"""The row of nested tetrahedra of the thesis (section 2.1) as a structure."""

from __future__ import annotations

import numpy as np
from pydrake.multibody.tree import SpatialInertia

from tetra_drake.physics.cable import CABLE
from tetra_drake.robot.actuation import Actuation
from tetra_drake.robot.bodies import node_inertia, strut_inertia
from tetra_drake.robot.structure import Structure
from tetra_drake.scenario.nesting import (
    BOTTOM_LEFT,
    BOTTOM_RIGHT,
    CABLES,
    NODES,
    TIP,
    Tetrahedra,
    cable_nodes,
    tetrahedron_nodes,
)
from tetra_drake.scenario.schema import Scenario

STRUTS = tuple((i, j) for i in range(4) for j in range(i + 1, 4))


def MakeTetrahedra(scenario: Scenario, robot: Tetrahedra) -> Structure:
    """The robot of thesis section 2.1 with `robot.tetrahedra` tetrahedra.

    Base triangles stand vertical with two nodes at height 0, those of T1 at x = 0; the
    tips point forward (+x) into the next tetrahedron. Junction i joins T(i+1) and T(i+2)
    by 3 outer cables (base node to base node) and 3 inner ones (tip to base nodes); see
    CABLES and Actuation.
    """
    n = robot.tetrahedra
    p_BN = tetrahedron_nodes(robot.strut_length)
    bodies = robot.body_names
    x, _, z = p_BN[BOTTOM_LEFT]
    p_WB = np.array([[i * robot.spacing - x, 0.0, -z] for i in range(n)])
    actuation = Actuation.of(scenario)
    bottom = [4 * i + node for i in range(n) for node in (BOTTOM_LEFT, BOTTOM_RIGHT)]
    contacts = [*bottom, 4 * (n - 1) + TIP] if robot.contacts == "thesis" else range(4 * n)
    struts = [(4 * i + a, 4 * i + b) for i in range(n) for a, b in STRUTS]
    mass, unit_inertia = bodies_inertia(p_BN, robot)
    return Structure(
        bodies=bodies,
        node_names=tuple(f"{body} {node}" for body in bodies for node in NODES),
        first_node=4 * np.arange(n + 1),
        p_BN=np.tile(p_BN, (n, 1)),
        struts=np.array(struts),
        strut_radius=np.full(len(struts), robot.strut_diameter / 2),
        node_radius=np.full(4 * n, robot.node_diameter / 2),
        mass=mass,
        unit_inertia=unit_inertia,
        p_WB=p_WB,
        q_WB=np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)),
        cables=_cables(robot, actuation),
        cable_groups=tuple(cable.split()[0] for cable in CABLES) * (n - 1),
        actuation=actuation,
        contacts=np.array(contacts),
        markers=np.array(bottom),
    )


def _cables(robot: Tetrahedra, actuation: Actuation) -> np.ndarray:
    """(cables,) of dtype CABLE, junction by junction."""
    cables = robot.cables
    rows: list[tuple[float, ...]] = []
    for junction in range(robot.tetrahedra - 1):
        for cable in CABLES:
            outer = cable.startswith("outer")
            stiffness = cables.outer_stiffness if outer else cables.inner_stiffness
            law = stiffness, cables.damping, cables.free_length
            rows.append((*cable_nodes(junction, cable), actuation.drivers[len(rows)], *law))
    return np.array(rows, dtype=CABLE)


def bodies_inertia(p_BN: np.ndarray, robot: Tetrahedra) -> tuple[np.ndarray, np.ndarray]:
    """Masses (bodies,), and unit inertias (bodies, 6) as in Structure, of tetrahedra with payload.

    A payload is a point mass at the centre of mass: it adds no inertia about it.
    """
    empty, unit_inertia = tetrahedron_inertia(p_BN, robot)
    mass = np.full(robot.tetrahedra, empty)
    if robot.payload:
        mass += robot.payload
    return mass, (empty / mass)[:, np.newaxis] * unit_inertia


def tetrahedron_inertia(p_BN: np.ndarray, robot: Tetrahedra) -> tuple[float, np.ndarray]:
    """Mass, and unit inertia (6,) as in Structure, of the six struts and four spheres of a
    tetrahedron with nodes p_BN (4, 3)."""
    total = SpatialInertia.Zero()
    for a, b in STRUTS:
        total += strut_inertia(
            p_BN[a], p_BN[b], radius=robot.strut_diameter / 2, density=robot.density
        )
    for p_BNi in p_BN:
        total += node_inertia(p_BNi, radius=robot.node_diameter / 2, density=robot.density)
    # The sum is isotropic about Bo but for rounding, whose last bits would break the robot's
    # left-right symmetry and let explicit schemes amplify that up to their accuracy.
    moments = np.diag(total.get_unit_inertia().CopyToFullMatrix3())
    return total.get_mass(), np.concatenate([moments, np.zeros(3)])
