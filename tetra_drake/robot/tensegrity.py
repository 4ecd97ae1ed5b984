"""A tensegrity from a structure file as a structure, at rest on the ground."""

from __future__ import annotations

import dataclasses

import numpy as np
from pydrake.multibody.tree import SpatialInertia, UnitInertia

from tetra_drake.errors import InputError
from tetra_drake.physics.cable import CABLE
from tetra_drake.robot.actuation import Actuation
from tetra_drake.robot.bodies import node_inertia, strut_inertia
from tetra_drake.robot.laws import rest_of
from tetra_drake.robot.structure import Structure, turn_with_slope
from tetra_drake.scenario import robot_kinds as kinds
from tetra_drake.scenario.schema import Scenario

START_DEPTH = 1e-3
"""Depth in the ground, as a share of the structure's height, from which on a node counts as placed
there by mistake."""


def MakeTensegrity(scenario: Scenario, kind: kinds.Structure) -> Structure:
    """The structure of a structure file, at rest on flat ground without actuation, then displaced
    by `robot.offsets` and turned with an incline.

    A body's frame is that of World where the file places its nodes; its origin is its centre of
    mass. Raises InputError if a contact node is placed in the ground, or if there is no rest.
    """
    placed = _placed(scenario, kind)
    rest = rest_of(scenario, placed)
    poses = rest.state[: 7 * len(placed.bodies)].reshape(-1, 7)
    p_WB = poses[:, 4:] + np.array(kind.offsets or [[0.0, 0.0, 0.0]])
    slope = scenario.terrain.plane_slope or 0.0
    turned_p_WB, turned_q_WB = turn_with_slope(p_WB, poses[:, :4], slope)
    return dataclasses.replace(placed, p_WB=turned_p_WB, q_WB=turned_q_WB, feet=max(1, rest.feet))


def _placed(scenario: Scenario, kind: kinds.Structure) -> Structure:
    """The structure where its file places it, moved along z to stand on the ground."""
    names = [node for body in kind.bodies for node in body]
    number = {node: place for place, node in enumerate(names)}
    p_WN = np.array([kind.nodes[node] for node in names])
    contacts = np.array(sorted(number[node] for node in kind.contact_nodes))
    lowest = contacts[p_WN[contacts, 2].argmin()]
    depth = -p_WN[lowest, 2]
    if depth > START_DEPTH * np.ptp(p_WN[:, 2]):
        problem = f"starts {depth:.3g} m below the ground, expected on it or above"
        raise InputError(scenario.name, f"robot.nodes.{names[lowest]}", problem)
    p_WN[:, 2] += depth
    actuation = Actuation.of(scenario)
    struts = sorted(kind.all_struts, key=lambda strut: kind.body_of_node[strut.nodes[0]])
    inertias = [_inertia_in_world(kind, body, number, p_WN) for body in kind.bodies]
    p_WB = np.array([inertia.get_com() for inertia in inertias])
    first_node = np.append(0, np.cumsum([len(body) for body in kind.bodies]))
    return Structure(
        bodies=kind.body_names,
        node_names=tuple(names),
        first_node=first_node,
        p_BN=p_WN - np.repeat(p_WB, np.diff(first_node), axis=0),
        struts=np.array([[number[node] for node in strut.nodes] for strut in struts]),
        strut_radius=np.array([kind.struts[strut.group].diameter / 2 for strut in struts]),
        node_radius=np.array([kind.sphere_of_node[node].node_diameter / 2 for node in names]),
        mass=np.array([inertia.get_mass() for inertia in inertias]),
        unit_inertia=np.array([_unit_inertia(inertia) for inertia in inertias]),
        p_WB=p_WB,
        q_WB=np.tile([1.0, 0.0, 0.0, 0.0], (len(inertias), 1)),
        cables=_cables(kind, number, actuation),
        cable_names=actuation.layout.cable_names,
        cable_groups=tuple(cable.group for cable in kind.all_cables),
        slack=True,
        actuation=actuation,
        contacts=contacts,
        thesis_nodes=None,
        feet=len(contacts),
        markers=np.array([], dtype=int),
    )


def _inertia_in_world(
    kind: kinds.Structure, body: tuple[str, ...], number: dict[str, int], p_WN: np.ndarray
) -> SpatialInertia:
    """M_BWo_W of a body: struts, spheres and point masses at its nodes p_WN (nodes, 3)."""
    total = SpatialInertia.Zero()
    for strut in kind.all_struts:
        if strut.nodes[0] in body:
            group = kind.struts[strut.group]
            ends = (p_WN[number[node]] for node in strut.nodes)
            total += strut_inertia(*ends, radius=group.diameter / 2, density=group.density)
    for node in body:
        sphere, p_WNi = kind.sphere_of_node[node], p_WN[number[node]]
        if sphere.node_diameter > 0.0:
            total += node_inertia(p_WNi, radius=sphere.node_diameter / 2, density=sphere.density)
        if node in kind.masses:
            total += SpatialInertia(kind.masses[node], p_WNi, UnitInertia.PointMass(p_WNi))
    return total


def _unit_inertia(M_BWo_W: SpatialInertia) -> np.ndarray:
    """(6,): as in Structure, about the centre of mass."""
    central = M_BWo_W.Shift(M_BWo_W.get_com()).get_unit_inertia()
    return np.concatenate([central.get_moments(), central.get_products()])


def _cables(kind: kinds.Structure, number: dict[str, int], actuation: Actuation) -> np.ndarray:
    """(cables,) of dtype CABLE, pair by pair of bodies."""
    rows = []
    for place, cable in enumerate(kind.all_cables):
        group = kind.cables[cable.group]
        first, second = sorted(cable.nodes, key=kind.body_of_node.__getitem__)
        law = group.stiffness, group.damping, kind.free_lengths[place]
        rows.append((number[first], number[second], actuation.drivers[place], *law))
    return np.array(rows, dtype=CABLE)
