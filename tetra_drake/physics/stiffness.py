"""Stiffness matrix of a robot at rest: second derivatives of its potential energy.

They are exact, except that struts are taken to touch at fixed places. Finite differences of forces
lose half of the digits, which hides the softest motions of a robot that is a billion times as stiff
in other directions.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tetra_drake.physics import cable, capsules, contact, kinematics
from tetra_drake.physics.forces import Forces
from tetra_drake.physics.model import Model
from tetra_drake.physics.rigid_motions import rigid_motions

WORLD = -1
"""Index of the world among the bodies."""


class Springs(NamedTuple):
    """Springs between two points of different bodies, or of a body and the world."""

    body_a: np.ndarray
    """Indices of the first bodies (springs,)."""
    body_b: np.ndarray
    p_a: np.ndarray
    """Vectors (springs, 3) in m from the origins of the first bodies to the first points."""
    p_b: np.ndarray
    stiffness: np.ndarray
    """Derivatives (springs, 3, 3) in N/m of the force on the first point, by the displacement of
    the second."""


def stiffness_matrix(robot: Model, forces: Forces) -> np.ndarray:
    """Stiffness matrix (6 bodies, 6 bodies) of a robot on flat ground: N m, N and N/m.

    The displacement of a body is a rotation vector in rad, then a translation in m, in the world
    frame. `forces` are the forces of a state without motion.
    """
    bodies = robot.bodies.mass.size
    carriers = np.full(len(robot.p_BN), WORLD)
    carriers[: robot.first_node[-1]] = np.repeat(np.arange(bodies), np.diff(robot.first_node))
    blocks = np.zeros((bodies + 1, bodies + 1, 6, 6))  # the last blocks are the world's
    for springs in (
        _cables(robot, forces, carriers),
        _supports(robot, forces, carriers),
        _touching_struts(robot, forces, carriers),
    ):
        _add_springs(springs, blocks)
    _add_turning(forces.nodes, carriers, blocks)
    return blocks[:bodies, :bodies].transpose(0, 2, 1, 3).reshape(6 * bodies, 6 * bodies)


def _cables(robot: Model, forces: Forces, carriers: np.ndarray) -> Springs:
    """The cables as springs. A slack cable has no stiffness."""
    cables, parts, nodes = robot.cables, forces.cable_forces, forces.nodes
    p_BN_W = nodes[:, kinematics.P_BN_W : kinematics.P_BN_W + 3]
    direction = parts[:, cable.DIRECTION : cable.DIRECTION + 3]
    along = np.einsum("ci,cj->cij", direction, direction)
    tension = parts[:, cable.TENSION]
    lengthwise = np.where((tension > 0.0) | (not robot.slack), cables.law.stiffness, 0.0)
    sideways = tension / parts[:, cable.LENGTH]
    return Springs(
        carriers[cables.node_a],
        carriers[cables.node_b],
        p_BN_W[cables.node_a],
        p_BN_W[cables.node_b],
        (lengthwise - sideways)[:, None, None] * along + sideways[:, None, None] * np.eye(3),
    )


def _supports(robot: Model, forces: Forces, carriers: np.ndarray) -> Springs:
    """Contacts with the ground, and anchors, as springs to the world."""
    ground, anchors = robot.ground, robot.anchors
    law = contact.NormalForce(*ground.normal)
    presses = forces.ground_forces[:, contact.NORMAL] > 0.0
    vertical = np.array([0.0, 0.0, law.stiffness])
    axes = np.concatenate([presses[:, None] * vertical, anchors.stiffness])
    nodes = np.concatenate([ground.contacts, anchors.nodes])
    p_BN_W = forces.nodes[nodes, kinematics.P_BN_W : kinematics.P_BN_W + 3]
    world = np.full(len(nodes), WORLD)
    return Springs(carriers[nodes], world, p_BN_W, p_BN_W, axes[:, None] * np.eye(3))


def _touching_struts(robot: Model, forces: Forces, carriers: np.ndarray) -> Springs:
    """Contacts of struts as springs along the lines between their nearest points."""
    near, struts, nodes = forces.near_struts, robot.struts, forces.nodes
    stiffness = contact.NormalForce(*robot.strut_contact.normal).stiffness
    bodies, points, springs = [], [], []
    for i, j in near.pairs[: near.count[0]].tolist():
        touch = capsules.find_touch(struts, nodes, i, j)
        if touch.depth <= 0.0:
            continue
        bodies.append((carriers[struts.node_a[i]], carriers[struts.node_a[j]]))
        ends = (
            (struts.node_a[i], struts.node_b[i], touch.s),
            (struts.node_a[j], struts.node_b[j], touch.t),
        )
        points.append([capsules.place_on(nodes, a, b, kinematics.P_BN_W, x) for a, b, x in ends])
        springs.append(stiffness * np.outer(touch.direction, touch.direction))
    body_a, body_b = np.array(bodies, dtype=int).reshape(-1, 2).T
    p_a, p_b = np.array(points, dtype=float).reshape(-1, 2, 3).transpose(1, 0, 2)
    return Springs(body_a, body_b, p_a, p_b, np.array(springs, dtype=float).reshape(-1, 3, 3))


def _add_springs(springs: Springs, blocks: np.ndarray) -> None:
    """Adds the stiffness of springs to the blocks (bodies + 1, bodies + 1, 6, 6)."""
    ends = (
        (springs.body_a, rigid_motions(springs.p_a)),
        (springs.body_b, -rigid_motions(springs.p_b)),
    )
    for body, motion in ends:
        for other, other_motion in ends:
            added = np.einsum("sia,sij,sjb->sab", motion, springs.stiffness, other_motion)
            np.add.at(blocks, (body, other), added)


def _add_turning(nodes: np.ndarray, carriers: np.ndarray, blocks: np.ndarray) -> None:
    """Adds the stiffness that the forces on the nodes have as the bodies turn."""
    p = nodes[:, kinematics.P_BN_W : kinematics.P_BN_W + 3]
    force = nodes[:, kinematics.FORCE : kinematics.FORCE + 3]
    products = np.einsum("ni,nj->nij", p, force)
    trace = np.einsum("nii,jk->njk", products, np.eye(3))
    turning = trace - 0.5 * (products + products.transpose(0, 2, 1))
    np.add.at(blocks[:, :, :3, :3], (carriers, carriers), turning)
