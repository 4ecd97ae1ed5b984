"""The laws of a structure as the kernels of every engine take them, and its rest."""

from __future__ import annotations

import numpy as np

from tetra_drake.physics.cable import Cables
from tetra_drake.physics.clearance import Struts
from tetra_drake.physics.model import Bodies, Couplings, Model
from tetra_drake.robot.equilibrium import Rest, find_rest
from tetra_drake.robot.ground import make_ground
from tetra_drake.robot.structure import Structure
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.terrain_kinds import Flat


def make_model(scenario: Scenario, structure: Structure) -> Model:
    """The structure and its laws as the kernels take them."""
    distances = np.linalg.norm(structure.p_BN, axis=1)
    return Model(
        p_BN=structure.p_BN,
        first_node=structure.first_node,
        cables=Cables.of(structure.cables),
        actuator=scenario.actuation.law(),
        couplings=_couplings(structure),
        ground=make_ground(scenario, structure),
        bodies=Bodies(
            mass=structure.mass,
            inertia=structure.mass[:, np.newaxis] * structure.unit_inertia,
            radius=np.maximum.reduceat(distances, structure.first_node[:-1]),
            weight=structure.mass * scenario.robot.gravity,
        ),
        struts=_struts(structure),
        isotropic=structure.isotropic,
        slack=scenario.robot.slack,
    )


def rest_of(scenario: Scenario, structure: Structure, start: np.ndarray | None = None) -> Rest:
    """Rest of a structure on flat ground without actuation, let go at `start` (13 bodies,), or else
    where it starts; raises InputError if there is none."""
    model = make_model(scenario.with_sections(terrain=Flat()), structure)
    start = structure.initial_state if start is None else start
    return find_rest(model, start, bodies=structure.bodies, source=scenario.name)


def _struts(structure: Structure) -> Struts:
    node_a, node_b = structure.struts.T
    bodies = structure.carriers[node_a]
    first = np.searchsorted(bodies, np.arange(len(structure.bodies) + 1))
    along = structure.p_BN[node_b] - structure.p_BN[node_a]
    return Struts(node_a.copy(), node_b.copy(), first, length=np.linalg.norm(along, axis=1))


def _couplings(structure: Structure) -> Couplings:
    """The pairs of bodies in the order of the cables; ValueError if they are in no such order."""
    carriers, cables = structure.carriers, structure.cables
    pairs = np.column_stack([carriers[cables["node_a"]], carriers[cables["node_b"]]])
    begins = np.flatnonzero(np.any(np.diff(pairs, axis=0, prepend=-1), axis=1))
    distinct = pairs[begins]
    if (distinct[:, 0] >= distinct[:, 1]).any() or len(np.unique(distinct, axis=0)) < len(begins):
        raise ValueError("the cables are not in the order of the pairs of bodies that they join")
    return Couplings(
        first=distinct[:, 0].copy(),
        second=distinct[:, 1].copy(),
        first_cable=np.append(begins, len(cables)),
    )
