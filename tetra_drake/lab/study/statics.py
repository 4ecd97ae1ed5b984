"""Statics of a tensegrity: self-stress states, and mechanisms that the cables allow.

The method is from S. Pellegrino, "Structural computations with the singular value decomposition of
the equilibrium matrix", International Journal of Solids and Structures 30 (1993). Here the joined
parts are rigid bodies. Anchors allow only motions that move no node along an axis that is held.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import null_space
from scipy.sparse import csr_array

from tetra_drake.laws.kinematics import rigid_motions
from tetra_drake.robot.equilibrium import soft_space
from tetra_drake.scenario.blueprint import Blueprint, Segments

TOLERANCE = 1e-6
"""Singular values below this share of the greatest, or of a bound for it, count as zero. Lengths
are in units of the structure's size. Coordinates need at least six digits."""


class Statics(NamedTuple):
    """Self-stress states of a structure (tensions in balance without loads) and its mechanisms
    (motions that change no cable's length to first order)."""

    self_stresses: np.ndarray
    """Orthonormal basis (s, cables) of the tensions that are in balance without loads, other than
    the forces of anchors."""
    mechanisms: int
    """Number of infinitesimal motions that change no cable's length to first order. Motions of a
    whole structure without anchors do not count, nor does the spin of a straight body about its
    axis."""


def find_statics(structure: Blueprint, p_WN: np.ndarray) -> Statics:
    """Self-stress states and mechanisms of a structure, rigid bodies joined by cables and ball
    joints, with its nodes at p_WN (nodes, 3) in m."""
    body_of_node, held, joints = structure.carriers, structure.held, structure.joints
    p_WN = (p_WN - p_WN.mean(axis=0)) / np.linalg.norm(np.ptp(p_WN, axis=0))
    wrenches = cable_wrenches(p_WN=p_WN, body_of_node=body_of_node, segments=structure.segments)
    bodies, nodes = body_of_node.max() + 1, np.arange(len(p_WN))
    motions = np.zeros((nodes.size, 3, bodies + 1, 6))  # of nodes, by body and its motions
    motions[nodes, :, body_of_node] = rigid_motions(p_WN)
    motions = motions[:, :, :bodies].reshape(nodes.size, 3, 6 * bodies)
    # The spring of a joint acts along a line through the middle of its nodes.
    middle = rigid_motions(p_WN[joints].mean(axis=1))
    apart, each = np.zeros((len(joints), 3, bodies, 6)), np.arange(len(joints))
    apart[each, :, body_of_node[joints[:, 0]]] = middle
    apart[each, :, body_of_node[joints[:, 1]]] = -middle
    constraints = np.concatenate([motions[held], apart.reshape(-1, 6 * bodies)])
    allowed = null_space(constraints, TOLERANCE)
    felt = csr_array(allowed.T @ wrenches if len(constraints) else wrenches)
    products = (felt.T @ felt).toarray()  # its eigenvalues are the squares of singular values
    least = TOLERANCE**2 * np.abs(products).sum(axis=0).max(initial=0.0)
    self_stresses = soft_space(products, least)
    rank = wrenches.shape[1] - self_stresses.shape[1]

    idle = []  # spins of straight bodies about their axes; of points about all axes
    for body in range(bodies):
        p = p_WN[body_of_node == body]
        _, sizes, axes = np.linalg.svd(p - p[0])
        if sizes[1:].max(initial=0.0) > TOLERANCE:
            continue
        for axis in axes[:1] if len(p) > 1 else axes:
            spin = np.zeros((bodies, 6))
            spin[body] = np.concatenate([axis, np.cross(p[0], axis)])
            idle.append(spin.ravel())
    if not held.any():
        idle += [*np.tile(np.eye(6), bodies)]  # a structure on one line spins as its bodies do
    spins = csr_array(np.reshape(idle, (-1, 6 * bodies)))
    products = (spins @ spins.T).toarray()
    uncounted = np.linalg.matrix_rank(products, tol=TOLERANCE**2, hermitian=True) if idle else 0
    return Statics(self_stresses.T, mechanisms=int(allowed.shape[1] - rank - uncounted))


def cable_wrenches(*, p_WN: np.ndarray, body_of_node: np.ndarray, segments: Segments) -> np.ndarray:
    """Wrenches (6*B, cables) of cables with unit tension on B bodies.

    The six rows of a body are the torque about the world's origin (N m per N), then the force, both
    in the world frame.

    Args:
        p_WN: positions of the nodes (nodes, 3) in m.
        body_of_node: index of the body of each node (nodes,); -1 for a fixed node.
        segments: straight pieces of the cables. A cable that runs over rings has several.
    """
    cables, (node_a, node_b) = segments.cable, segments.ends.T
    force = p_WN[node_b] - p_WN[node_a]
    force /= np.linalg.norm(force, axis=1, keepdims=True)
    wrench = np.hstack([np.cross(p_WN[node_a], force), force])
    bodies = body_of_node.max() + 1
    count = cables.max(initial=-1) + 1
    wrenches = np.zeros((bodies + 1, count, 6))  # the last wrenches are on the world
    np.add.at(wrenches, (body_of_node[node_a], cables), wrench)
    np.add.at(wrenches, (body_of_node[node_b], cables), -wrench)
    return wrenches[:bodies].transpose(0, 2, 1).reshape(6 * bodies, count)
