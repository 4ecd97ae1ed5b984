"""The constants of a scenario's structure and laws, as the kernels of every engine take them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.physics.contact import Ground
from tetra_drake.physics.lanes import Table
from tetra_drake.physics.oscillator import Network, inhibition_matrix
from tetra_drake.robot.bodies import tetrahedron_inertia
from tetra_drake.robot.gait import Gait, weight_count
from tetra_drake.robot.ground import make_ground
from tetra_drake.robot.structure import Structure
from tetra_drake.scenario.schema import CpgScenario, Scenario

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


def make_network(cpg: CpgScenario, gait: Gait, *, oscillators: int) -> Network:
    """The network of a gait; raises InputError where that is for another number of oscillators."""
    weights, partner = np.array(gait.weights), cpg.partner_weight
    if weights.size != weight_count(oscillators):
        expected = f"{weight_count(oscillators)} for {oscillators + 1} tetrahedra"
        problem = f"found {weights.size}, expected {expected}"
        raise InputError(f"gait {gait.name}", "weights", problem)
    return Network(
        inhibition=inhibition_matrix(weights, oscillators=oscillators, partner_weight=partner),
        tau_a=gait.tau_a,
        tau_b=gait.tau_b,
        self_inhibition_weight=cpg.self_inhibition_weight,
        external_input=cpg.external_input,
    )


def initial_state(cpg: CpgScenario, oscillators: int) -> np.ndarray:
    """(4n,): u, then v, of all neurons at t = 0 (Table 4)."""
    u = np.full(2 * oscillators, cpg.inner_state)
    v = np.tile([cpg.extensor_self_inhibition, cpg.flexor_self_inhibition], oscillators)
    return np.concatenate([u, v])
