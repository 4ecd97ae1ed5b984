"""Stiffness matrix of a robot at rest: second derivatives of its potential energy.

They are exact. Finite differences of forces lose half of the digits, which hides the softest
motions of a robot that is a billion times as stiff in other directions.
"""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np
from scipy.sparse import bsr_array, csr_array

from tetra_drake.laws import cable, capsules, contact, kinematics
from tetra_drake.laws.forces import Forces
from tetra_drake.laws.model import WORLD, Model, carriers_of
from tetra_drake.laws.struts import Axes, axes_of, vector_between


class Springs(NamedTuple):
    """Springs whose energy depends on the positions of k nodes each."""

    nodes: np.ndarray
    """Indices of the nodes (springs, k)."""
    stiffness: np.ndarray
    """Second derivatives (springs, 3*k, 3*k) of the energy by the positions, in N/m."""

    @classmethod
    def between(cls, nodes: np.ndarray, stiffness: np.ndarray) -> Self:
        """Springs between pairs of nodes (springs, 2), from their stiffness (springs, 3, 3) against
        displacements of one node relative to the other."""
        pair = np.array([[1.0, -1.0], [-1.0, 1.0]])
        return cls(nodes, np.einsum("ab,sij->saibj", pair, stiffness).reshape(-1, 6, 6))


def stiffness_matrix(robot: Model, forces: Forces) -> bsr_array:
    """Stiffness matrix (6*bodies, 6*bodies) of a robot on flat ground. It is sparse: a 6 x 6 block
    for each body, and two for each pair of bodies that are joined.

    The displacement of a body is a rotation vector in rad, then a translation in m, in the world
    frame. The units are N m between rotations, N/m between translations, N otherwise. `forces` are
    the forces of a state without motion, with all tables computed.
    """
    bodies, ground = robot.bodies.mass.size, robot.ground
    carriers = carriers_of(robot.first_node, nodes=len(robot.p_BN))
    p = forces.nodes[: len(carriers), kinematics.P_BN_W : kinematics.P_BN_W + 3]
    motions = kinematics.rigid_motions(p)
    rows, columns, blocks = [carriers], [carriers], []
    for nodes, stiffness in _springs(robot, forces):
        count, ends = nodes.shape
        of_ends, motion = stiffness.reshape(count, ends, 3, ends, 3), motions[nodes]
        # Not by BLAS, whose last digits depend on the processor.
        added = np.einsum("saibj,sbjn->saibn", of_ends, motion)
        blocks.append(np.einsum("saim,saibn->sabmn", motion, added).reshape(-1, 6, 6))
        rows.append(np.repeat(carriers[nodes], ends))
        columns.append(np.tile(carriers[nodes], ends).ravel())

    # The forces on the nodes also have a stiffness as the bodies turn. The line of a normal force
    # goes through the centre of a round foot, so that it counts as a force on the node.
    on_rows = forces.nodes[:, kinematics.FORCE : kinematics.FORCE + 3]
    force, is_round = on_rows[: len(carriers)].copy(), ground.contacts != ground.centres
    force[ground.centres[is_round]] += on_rows[ground.contacts[is_round]]
    products = np.einsum("ni,nj->nij", p, force)
    trace = np.einsum("nii,jk->njk", products, np.eye(3))
    turning = np.zeros((len(carriers), 6, 6))
    turning[:, :3, :3] = trace - 0.5 * (products + products.transpose(0, 2, 1))
    row, column = np.concatenate(rows), np.concatenate(columns)
    moving = (row != WORLD) & (column != WORLD)
    place, of_block = np.unique((row * bodies + column)[moving], return_inverse=True)
    of_place = csr_array((np.ones(of_block.size), (of_block, np.arange(of_block.size))))
    summed = np.concatenate([turning, *blocks])[moving].reshape(-1, 36)
    data = (of_place @ summed).reshape(-1, 6, 6)
    first = np.searchsorted(place, bodies * np.arange(bodies + 1))
    return bsr_array((data, place % bodies, first), shape=(6 * bodies, 6 * bodies))


def _springs(robot: Model, forces: Forces) -> list[Springs]:
    """All springs of a robot: cables, joints, anchors, contacts with the ground and of struts."""
    joints, anchors = robot.joints, robot.anchors
    presses = forces.ground_forces[:, contact.NORMAL] > 0.0
    upward = contact.NormalForce(*robot.ground.normal).stiffness * np.diag([0.0, 0.0, 1.0])
    return [
        *_cables(robot, forces),
        Springs.between(
            np.stack([joints.node_a, joints.node_b], axis=1),
            joints.stiffness[:, None, None] * np.eye(3),
        ),
        Springs(anchors.nodes[:, None], anchors.stiffness[:, None] * np.eye(3)),
        # Contacts have no stiffness along the ground.
        Springs(robot.ground.centres[:, None], presses[:, None, None] * upward),
        _touching_struts(robot, forces),
    ]


def _cables(robot: Model, forces: Forces) -> list[Springs]:
    """The straight pieces of all cables as springs, across them by their tension. Along it, a
    straight cable is a spring of two nodes, a routed cable one of all nodes on its path. A slack
    cable has no stiffness."""
    law, routes, parts = robot.cables.law, robot.cables.routes, forces.cable_forces
    stiffness = cable.elastic_stiffness(parts[:, cable.LENGTH] - law.free_length, law)
    is_taut = (parts[:, cable.TENSION] > 0.0) | (not robot.slack)
    lengthwise, counts = np.where(is_taut, stiffness, 0.0), np.diff(routes.first)
    of_cable = np.repeat(np.arange(counts.size), counts.clip(2) - 1)
    nodes = robot.cables.pieces
    p_WN = forces.nodes[:, kinematics.P_WN : kinematics.P_WN + 3]
    p_AB = p_WN[nodes[:, 1]] - p_WN[nodes[:, 0]]
    distance = np.linalg.norm(p_AB, axis=1)
    length = distance.clip(cable.MEETING)
    unit = p_AB / length[:, None]  # not a power, whose last digits depend on the processor
    along = np.einsum("pi,pj->pij", unit, unit)
    sideways = parts[of_cable, cable.TENSION] / length
    turning = np.where(distance > cable.MEETING, sideways, 0.0)
    on_line = np.where(counts > 0, 0.0, lengthwise)[of_cable] - turning
    of_pieces = on_line[:, None, None] * along + sideways[:, None, None] * np.eye(3)
    springs = [Springs.between(nodes, of_pieces)]
    for routed in np.flatnonzero(counts):
        path = slice(*routes.first[routed : routed + 2])
        slopes = forces.route_slopes[path].ravel()
        whole = lengthwise[routed] * np.outer(slopes, slopes)
        springs.append(Springs(routes.nodes[path][None], whole[None]))
    return springs


def _touching_struts(robot: Model, forces: Forces) -> Springs:
    """Contacts of struts as springs between start and end of the first strut and of the second."""
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
    return Springs(of_touch, np.array(stiffness, dtype=float).reshape(-1, 12, 12))


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
