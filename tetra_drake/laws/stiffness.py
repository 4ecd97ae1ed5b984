"""Stiffness matrix of a robot at rest: second derivatives of its potential energy.

They are exact. Finite differences of forces lose half of the digits, which hides the softest
motions of a robot that is a billion times as stiff in other directions.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from scipy.sparse import bsr_array, csr_array

from tetra_drake.laws import cable, capsules, contact, kinematics
from tetra_drake.laws.forces import Forces
from tetra_drake.laws.model import WORLD, Model, carriers_of
from tetra_drake.laws.struts import Axes, axes_of, vector_between


class Springs(NamedTuple):
    """Springs between points of two bodies, or of a body and the world. Each spring has k
    displacements, such as the 3 components of the relative motion of a cable's ends. A displacement
    is the sum of two parts, one from the motion of each body."""

    body_a: np.ndarray
    """Indices of the first bodies (springs,)."""
    body_b: np.ndarray
    motion_a: np.ndarray
    """Displacements (springs, k, 6) of the springs for unit motions of the first bodies; see
    kinematics.rigid_motions()."""
    motion_b: np.ndarray
    stiffness: np.ndarray
    """Second derivatives (springs, k, k) of the energy with respect to the displacements."""


def stiffness_matrix(robot: Model, forces: Forces) -> bsr_array:
    """Stiffness matrix (6*bodies, 6*bodies) of a robot on flat ground. It is sparse: a 6 x 6 block
    for each body, and two for each pair of bodies that are joined.

    The displacement of a body is a rotation vector in rad, then a translation in m, in the world
    frame. The units are N m between rotations, N/m between translations, N otherwise. `forces` are
    the forces of a state without motion, with all tables computed.
    """
    bodies = robot.bodies.mass.size
    carriers = carriers_of(robot.first_node, nodes=len(robot.p_BN))
    kinds = [_cables, _supports]
    if robot.cables.routes.nodes.size:
        kinds += [_pieces, _paths]
    if robot.joints.node_a.size:
        kinds += [_joints]
    if forces.near_struts.count[0]:
        kinds += [_touching_struts]
    rows, columns, blocks = [], [], []
    for kind in kinds:
        springs = kind(robot, forces, carriers)
        motion = np.concatenate([springs.motion_a, springs.motion_b], axis=2)
        # Not by BLAS, whose last digits depend on the processor.
        pulled = np.einsum("kni,knm->kim", motion, springs.stiffness)
        added = np.einsum("kim,kmj->kij", pulled, motion)
        ends = np.stack([springs.body_a, springs.body_b], axis=1)
        for i, j in np.ndindex(2, 2):
            rows.append(ends[:, i])
            columns.append(ends[:, j])
            blocks.append(added[:, 6 * i : 6 * i + 6, 6 * j : 6 * j + 6])

    # The forces on the nodes also have a stiffness as the bodies turn. The line of a normal force
    # goes through the centre of a round foot, so that it counts as a force on the node.
    ground, nodes = robot.ground, forces.nodes
    p = nodes[: len(carriers), kinematics.P_BN_W : kinematics.P_BN_W + 3]
    on_rows = nodes[:, kinematics.FORCE : kinematics.FORCE + 3]
    force, is_round = on_rows[: len(carriers)].copy(), ground.contacts != ground.centres
    force[ground.centres[is_round]] += on_rows[ground.contacts[is_round]]
    products = np.einsum("ni,nj->nij", p, force)
    trace = np.einsum("nii,jk->njk", products, np.eye(3))
    turning = np.zeros((len(carriers), 6, 6))
    turning[:, :3, :3] = trace - 0.5 * (products + products.transpose(0, 2, 1))
    row, column = np.concatenate([*rows, carriers]), np.concatenate([*columns, carriers])
    moving = (row != WORLD) & (column != WORLD)
    place, of_block = np.unique((row * bodies + column)[moving], return_inverse=True)
    of_place = csr_array((np.ones(of_block.size), (of_block, np.arange(of_block.size))))
    summed = np.concatenate([*blocks, turning])[moving].reshape(-1, 36)
    data = (of_place @ summed).reshape(-1, 6, 6)
    first = np.searchsorted(place, bodies * np.arange(bodies + 1))
    return bsr_array((data, place % bodies, first), shape=(6 * bodies, 6 * bodies))


def _cables(robot: Model, forces: Forces, carriers: np.ndarray) -> Springs:
    """The straight cables as springs, along them by their stiffness and sideways by their tension.
    A slack cable has no stiffness. `carriers` (nodes,) is the index of each node's body, WORLD for
    fixed nodes."""
    is_straight = np.diff(robot.cables.routes.first) == 0
    node_a, node_b = robot.cables.node_a[is_straight], robot.cables.node_b[is_straight]
    parts, lengthwise = forces.cable_forces[is_straight], _lengthwise(robot, forces)[is_straight]
    direction = parts[:, cable.DIRECTION : cable.DIRECTION + 3]
    along = np.einsum("ci,cj->cij", direction, direction)
    length = np.maximum(parts[:, cable.LENGTH], cable.MEETING)
    sideways = parts[:, cable.TENSION] / length
    turning = np.where(length > cable.MEETING, sideways, 0.0)
    return Springs(
        carriers[node_a],
        carriers[node_b],
        _motions(forces, node_a),
        -_motions(forces, node_b),
        (lengthwise - turning)[:, None, None] * along + sideways[:, None, None] * np.eye(3),
    )


def _lengthwise(robot: Model, forces: Forces) -> np.ndarray:
    """Stiffness (cables,) of the cables along their length; 0 for slack ones."""
    law, parts = robot.cables.law, forces.cable_forces
    stiffness = cable.elastic_stiffness(parts[:, cable.LENGTH] - law.free_length, law)
    return np.where((parts[:, cable.TENSION] > 0.0) | (not robot.slack), stiffness, 0.0)


def _motions(forces: Forces, nodes: np.ndarray) -> np.ndarray:
    """Displacements (nodes, 3, 6) of nodes for unit motions of their bodies."""
    p_BN_W = forces.nodes[:, kinematics.P_BN_W : kinematics.P_BN_W + 3]
    return kinematics.rigid_motions(p_BN_W[nodes])


def _pieces(robot: Model, forces: Forces, carriers: np.ndarray) -> Springs:
    """The straight pieces of routed cables as springs that resist displacements across them, by
    their tension. `carriers` (nodes,) is the index of each node's body."""
    routes = robot.cables.routes
    path_of = np.repeat(np.arange(len(routes.first) - 1), np.diff(routes.first))
    begins = np.flatnonzero(np.diff(path_of, append=-1) == 0)
    node_a, node_b = routes.nodes[begins], routes.nodes[begins + 1]
    p_WN = forces.nodes[:, kinematics.P_WN : kinematics.P_WN + 3]
    p_AB = p_WN[node_b] - p_WN[node_a]
    length = np.maximum(np.linalg.norm(p_AB, axis=1), cable.MEETING)
    direction = np.where(length > cable.MEETING, p_AB.T / length, 0.0).T
    across = np.eye(3) - np.einsum("pi,pj->pij", direction, direction)
    sideways = forces.cable_forces[path_of[begins], cable.TENSION] / length
    motion_a, motion_b = _motions(forces, node_a), -_motions(forces, node_b)
    stiffness = sideways[:, None, None] * across
    return Springs(carriers[node_a], carriers[node_b], motion_a, motion_b, stiffness)


def _paths(robot: Model, forces: Forces, carriers: np.ndarray) -> Springs:
    """The stiffness of routed cables along their paths, as springs between all pairs of nodes on a
    path, also of a node and itself. The displacements (2,) are the parts of both nodes in the
    change of the cable's length. `carriers` (nodes,) is the index of each node's body."""
    routes, lengthwise = robot.cables.routes, _lengthwise(robot, forces)
    pairs, stiffness = [], []
    for path in np.flatnonzero(np.diff(routes.first)):
        rows = range(routes.first[path], routes.first[path + 1])
        for a, b in itertools.combinations_with_replacement(rows, 2):
            pairs.append((a, b))
            stiffness.append(lengthwise[path] * np.array([[a == b, a != b], [a != b, 0.0]]))
    of_pairs = np.array(pairs, dtype=int).reshape(-1, 2)
    parts = np.einsum("ki,kij->kj", forces.route_slopes, _motions(forces, routes.nodes))
    motion_a, motion_b = np.zeros((2, len(of_pairs), 2, 6))
    motion_a[:, 0], motion_b[:, 1] = parts[of_pairs].transpose(1, 0, 2)
    body_a, body_b = carriers[routes.nodes[of_pairs]].T
    return Springs(body_a, body_b, motion_a, motion_b, np.reshape(stiffness, (-1, 2, 2)))


def _joints(robot: Model, forces: Forces, carriers: np.ndarray) -> Springs:
    """The joints as springs. `carriers` (nodes,) is the index of each node's body."""
    joints = robot.joints
    return Springs(
        carriers[joints.node_a],
        carriers[joints.node_b],
        _motions(forces, joints.node_a),
        -_motions(forces, joints.node_b),
        joints.stiffness[:, None, None] * np.eye(3),
    )


def _supports(robot: Model, forces: Forces, carriers: np.ndarray) -> Springs:
    """Contacts with the ground, and anchors, as springs to the world. Contacts have no stiffness
    along the ground. `carriers` (nodes,) is the index of each node's body."""
    ground, anchors = robot.ground, robot.anchors
    law = contact.NormalForce(*ground.normal)
    presses = forces.ground_forces[:, contact.NORMAL] > 0.0
    vertical = np.array([0.0, 0.0, law.stiffness])
    axes = np.concatenate([presses[:, None] * vertical, anchors.stiffness])
    nodes = np.concatenate([ground.centres, anchors.nodes])
    p_BN_W = forces.nodes[nodes, kinematics.P_BN_W : kinematics.P_BN_W + 3]
    world, motion = np.full(len(nodes), WORLD), kinematics.rigid_motions(p_BN_W)
    return Springs(carriers[nodes], world, motion, -motion, axes[:, None] * np.eye(3))


def _touching_struts(robot: Model, forces: Forces, carriers: np.ndarray) -> Springs:
    """Contacts of struts as springs. A displacement (12,) has the motions (3,) of both ends of the
    first strut, then of both ends of the second. `carriers` (nodes,) is the index of each node's
    body."""
    near, struts, nodes = forces.near_struts, robot.struts, forces.nodes
    law = contact.NormalForce(*robot.strut_contact.normal)
    ends, stiffness = [], []
    for i, j in near.pairs[: near.count[0]].tolist():
        touch = capsules.find_touch(struts, nodes, i, j)
        if touch.depth > 0.0:
            axes, reach = axes_of(struts, nodes, i, j), struts.radius[i] + struts.radius[j]
            stiffness.append(_stiffness_of_touch(touch, axes, reach, law.stiffness))
            ends.append([struts.node_a[i], struts.node_b[i], struts.node_a[j], struts.node_b[j]])
    of_touch = np.array(ends, dtype=int).reshape(-1, 4)
    p_BN_W = nodes[of_touch, kinematics.P_BN_W : kinematics.P_BN_W + 3]
    motions = kinematics.rigid_motions(p_BN_W.reshape(-1, 3)).reshape(-1, 4, 3, 6)
    motion_a, motion_b = motions.copy(), motions.copy()
    motion_a[:, 2:], motion_b[:, :2] = 0.0, 0.0
    return Springs(
        carriers[of_touch[:, 0]],
        carriers[of_touch[:, 2]],
        motion_a.reshape(-1, 12, 6),
        motion_b.reshape(-1, 12, 6),
        np.array(stiffness, dtype=float).reshape(-1, 12, 12),
    )


def _stiffness_of_touch(
    touch: capsules.Touch, axes: Axes, reach: float, stiffness: float
) -> np.ndarray:
    """Second derivatives (12, 12), in N/m, of the energy of a contact of struts, with respect to
    the displacements of their ends: start and end of the first strut, then of the second.

    `touch` is the contact, `axes` the geometry of the struts, `reach` (m) the sum of their radii,
    `stiffness` (N/m) the stiffness of the contact. D is the distance of the struts. D² / 2 is the
    minimum of a function of the positions s and t along the axes; see laws.capsules. The second
    derivatives of the minimum are the second derivatives at fixed s and t, less what s and t gain
    as they move. A position at the end of a strut does not move.
    """
    s, t, gradient = touch.s, touch.t, np.concatenate(touch.gradient)
    weight, by_product, second_by_product = capsules.barrel(axes, reach)
    u, v, between = np.array(axes.u), np.array(axes.v), np.array(vector_between(axes, s, t))
    to_u, to_v = (np.kron(ends, np.eye(3)) for ends in ([-1, 1, 0, 0], [0, 0, -1, 1]))
    to_between = np.kron([1.0 - s, s, t - 1.0, -t], np.eye(3))
    product = v @ to_u + u @ to_v  # the change of uv
    bend = second_by_product * np.outer(product, product)
    bend += by_product * (to_u.T @ to_v + to_v.T @ to_u)
    second = to_between.T @ to_between + 0.5 * ((s - 0.5) ** 2 + (t - 0.5) ** 2) * bend
    by_s = u @ to_between + between @ to_u + by_product * (s - 0.5) * product
    by_t = -v @ to_between - between @ to_v + by_product * (t - 0.5) * product
    by_place, uv = np.array([by_s, by_t]), axes.uv
    curvature = np.array([[axes.uu + weight, -uv], [-uv, axes.vv + weight]])
    moves = [0.0 < place < 1.0 for place in (s, t)]
    if any(moves):
        by_place, curvature = by_place[moves], curvature[moves][:, moves]
        second -= by_place.T @ np.linalg.solve(curvature, by_place)
    # The energy is k d² / 2 with the depth d = reach - D.
    steep = np.outer(gradient, gradient)
    distance = max(reach - touch.depth, capsules.LEAST_SQUARE**0.5)  # as in find_touch()
    return stiffness * (steep - touch.depth / distance * (second - steep))
