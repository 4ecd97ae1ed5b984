"""The constants of a scenario's structure and laws, as the kernels of every engine take them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tetra_drake.physics.contact import FRICTION, GROUND, NORMAL
from tetra_drake.physics.oscillator import Network, inhibition_matrix
from tetra_drake.robot.bodies import tetrahedron_inertia
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.structure import Structure
from tetra_drake.scenario.schema import CpgScenario, FrictionScenario, GroundScenario, Scenario

Array = np.ndarray


class Model(NamedTuple):
    """A structure and the constants of its laws; SI units."""

    p_BN: Array
    """(nodes per body, 3)."""
    cables: Array
    """(cables,) of dtype CABLE, each from a body to the next."""
    contacts: Array
    """(contacts,), the indices of the nodes that may touch the ground."""
    ground: Array
    """(1,) of dtype GROUND."""
    slack: bool
    mass: float
    moment: float
    """Mass of a body, and its moment of inertia about any axis through its centre of mass."""
    radius: float
    """Distance of the nodes from the centre of mass."""
    inertia: Array
    """(6 bodies,): the diagonal of the mass matrix."""
    gravity: float


def make_model(scenario: Scenario, structure: Structure) -> Model:
    """The structure and its laws as the kernels take them."""
    nodes = len(structure.p_BN)
    cables = structure.cables
    if not (cables["node_b"] // nodes == cables["node_a"] // nodes + 1).all():
        raise ValueError("a cable does not join a body to the next one")
    inertia = tetrahedron_inertia(structure)
    mass = inertia.get_mass()
    moments = mass * inertia.get_unit_inertia().get_moments()
    if np.ptp(moments) > 1e-12 * moments[0]:
        raise ValueError("the bodies' inertia is not isotropic")
    return Model(
        p_BN=structure.p_BN,
        cables=cables,
        contacts=structure.contacts,
        ground=ground_law(scenario.ground, scenario.friction),
        slack=scenario.cables.slack,
        mass=mass,
        moment=float(moments[0]),
        inertia=np.tile(3 * [moments[0]] + 3 * [mass], len(structure.bodies)),
        radius=float(np.linalg.norm(structure.p_BN, axis=1).max()),
        gravity=scenario.robot.gravity,
    )


def ground_law(ground: GroundScenario, friction: FrictionScenario) -> np.ndarray:
    """The constants of the ground's laws as `physics.contact` takes them: (1,) of dtype GROUND."""
    normal = [getattr(ground, name) for name in NORMAL]
    return np.array([(*normal, *(getattr(friction, name) for name in FRICTION))], dtype=GROUND)


def make_network(cpg: CpgScenario, gait: Gait, *, oscillators: int) -> Network:
    """The network of a gait."""
    weights, partner = np.array(gait.weights), cpg.partner_weight
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
