"""The constants of a scenario's structure and laws, as the kernels of every engine take them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tetra_drake.physics.contact import Ground
from tetra_drake.robot.bodies import tetrahedron_inertia
from tetra_drake.robot.ground import make_ground
from tetra_drake.robot.structure import Structure
from tetra_drake.scenario.schema import Scenario
from tetra_drake.simd.lanes import Table

JUNCTION_CABLES = 6
"""The cables between two neighbouring bodies."""


class Body(NamedTuple):
    """What all bodies have in common; SI units. Each a table of one."""

    mass: Table
    moment: Table
    """Of inertia, about any axis through the centre of mass."""
    radius: Table
    """Distance of the nodes from the centre of mass."""
    gravity: Table


class Model(NamedTuple):
    """A structure and the constants of its laws; SI units."""

    p_BN: Table
    """(nodes per body, 3)."""
    cables: Table
    """(cables,) of dtype CABLE or Cables; JUNCTION_CABLES from each body to the next, in order."""
    ground: Ground
    body: Body
    slack: bool


def make_model(scenario: Scenario, structure: Structure) -> Model:
    """The structure and its laws as the kernels take them; cables and ground are records."""
    nodes, cables = len(structure.p_BN), structure.cables
    junction = np.arange(len(cables)) // JUNCTION_CABLES
    ends = cables["node_a"] // nodes, cables["node_b"] // nodes
    if not ((ends[0] == junction).all() and (ends[1] == junction + 1).all()):
        raise ValueError("a cable does not join a body to the next one")
    inertia = tetrahedron_inertia(structure)
    mass = inertia.get_mass()
    moments = mass * inertia.get_unit_inertia().get_moments()
    if np.ptp(moments) > 1e-12 * moments[0]:
        raise ValueError("the bodies' inertia is not isotropic")
    radius = np.linalg.norm(structure.p_BN, axis=1).max()
    body = mass, moments[0], radius, scenario.robot.gravity
    return Model(
        p_BN=structure.p_BN,
        cables=cables,
        ground=make_ground(scenario, structure),
        body=Body(*(np.array([number]) for number in body)),
        slack=scenario.cables.slack,
    )
