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
from tetra_drake.robot.structure import Structure
from tetra_drake.scenario import robot_kinds as kinds
from tetra_drake.scenario.schema import Scenario

START_DEPTH = 1e-3
"""Depth in the ground, as a share of the structure's height, from which on a node counts as placed
there by mistake."""


def MakeTensegrity(scenario: Scenario, kind: kinds.Structure) -> Structure:
    """The structure of a structure file, at rest on flat ground without actuation.

    A body's frame is that of World where the file places its nodes; its origin is its centre of
    mass. Raises InputError if a contact node is placed in the ground, or if there is no rest.
    """
    placed = _placed(scenario, kind)
    rest = rest_of(scenario, placed)
    poses = rest.state[: 7 * len(placed.bodies)].reshape(-1, 7)
    return dataclasses.replace(placed, q_WB=poses[:, :4], p_WB=poses[:, 4:], rest=rest)


def _placed(scenario: Scenario, kind: kinds.Structure) -> Structure:
    """The structure where its file places it, moved along z to stand on the ground."""
    number = {node: place for place, node in enumerate(kind.body_of_node)}
    p_WN = _nodes_on_ground(scenario, kind)
    first_node = np.append(0, np.cumsum([len(body) for body in kind.bodies]))
    struts = sorted(kind.all_struts, key=lambda strut: kind.body_of_node[strut.nodes[0]])
    inertias = _inertias(kind, dict(zip(number, p_WN, strict=True)))
    p_WB = np.array([inertia.get_com() for inertia in inertias])
    actuation = Actuation.of(scenario)
    return Structure(
        bodies=kind.body_names,
        node_names=tuple(number),
        first_node=first_node,
        p_BN=p_WN - np.repeat(p_WB, np.diff(first_node), axis=0),
        struts=np.array([[number[node] for node in strut.nodes] for strut in struts]),
        strut_radius=np.array([kind.struts[strut.group].diameter / 2 for strut in struts]),
        node_radius=np.array([kind.sphere_of_node[node].node_diameter / 2 for node in number]),
        mass=np.array([inertia.get_mass() for inertia in inertias]),
        unit_inertia=np.array([_unit_inertia(inertia) for inertia in inertias]),
        p_WB=p_WB,
        q_WB=np.tile([1.0, 0.0, 0.0, 0.0], (len(inertias), 1)),
        cables=_cables(kind, number, actuation),
        cable_groups=tuple(cable.group for cable in kind.all_cables),
        actuation=actuation,
        contacts=np.array(sorted(number[node] for node in kind.contact_nodes)),
        markers=np.array([], dtype=int),
    )


def _nodes_on_ground(scenario: Scenario, kind: kinds.Structure) -> np.ndarray:
    """p_WN (nodes, 3), body by body, of which the lowest contact node is at height 0."""
    p_WN = np.array([kind.nodes[node] for node in kind.body_of_node])
    lowest = min(kind.contact_nodes, key=lambda node: kind.nodes[node][2])
    depth = -kind.nodes[lowest][2]
    if depth > START_DEPTH * np.ptp(p_WN[:, 2]):
        problem = f"starts {depth:.3g} m below the ground, expected on it or above"
        raise InputError(scenario.name, f"robot.nodes.{lowest}", problem)
    p_WN[:, 2] += depth
    return p_WN


def _inertias(kind: kinds.Structure, p_WN: dict[str, np.ndarray]) -> list[SpatialInertia]:
    """M_BWo_W of each body: struts, and spheres and point masses at its nodes."""
    inertias = [SpatialInertia.Zero() for _ in kind.bodies]
    for strut in kind.all_struts:
        group, (a, b) = kind.struts[strut.group], strut.nodes
        inertias[kind.body_of_node[a]] += strut_inertia(
            p_WN[a], p_WN[b], radius=group.diameter / 2, density=group.density
        )
    for node, body in kind.body_of_node.items():
        sphere, p = kind.sphere_of_node[node], p_WN[node]
        if sphere.node_diameter > 0.0:
            radius = sphere.node_diameter / 2
            inertias[body] += node_inertia(p, radius=radius, density=sphere.density)
        if node in kind.masses:
            inertias[body] += SpatialInertia(kind.masses[node], p, UnitInertia.PointMass(p))
    return inertias


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
