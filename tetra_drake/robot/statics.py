"""Statics of a tensegrity: self-stress states, and mechanisms that the cables allow.

The method is from S. Pellegrino, "Structural computations with the singular value decomposition of
the equilibrium matrix", International Journal of Solids and Structures 30 (1993). Here the joined
parts are rigid bodies.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

TOLERANCE = 1e-6
"""Singular values below this share of the greatest count as zero. Lengths are in units of the
structure's size. Coordinates need at least six digits."""


class Statics(NamedTuple):
    """Self-stress states and mechanisms of a structure."""

    self_stresses: np.ndarray
    """Orthonormal basis (s, cables) of the tensions that are in balance without loads."""
    mechanisms: int
    """Number of infinitesimal motions that change no cable's length to first order. Motions of the
    whole structure do not count, nor does the spin of a straight body about its axis."""


def find_statics(*, p_WN: np.ndarray, body_of_node: np.ndarray, cable_ends: np.ndarray) -> Statics:
    """Statics of rigid bodies joined by cables. For the arguments see cable_wrenches()."""
    bodies = int(body_of_node.max()) + 1
    p_WN = (p_WN - p_WN.mean(axis=0)) / np.linalg.norm(np.ptp(p_WN, axis=0))
    wrenches = cable_wrenches(p_WN=p_WN, body_of_node=body_of_node, cable_ends=cable_ends)
    _, singular_values, tensions = np.linalg.svd(wrenches)
    greatest = singular_values.max(initial=0.0)
    rank = int(np.count_nonzero(singular_values > TOLERANCE * greatest))
    straight = sum(_is_straight(p_WN[body_of_node == body]) for body in range(bodies))
    # A structure on one line has 5 motions as a whole: its spin is the spin of its bodies.
    of_whole = 5 if _is_straight(p_WN) else 6
    mechanisms = 6 * bodies - of_whole - straight - rank
    return Statics(self_stresses=tensions[rank:], mechanisms=mechanisms)


def cable_wrenches(
    *, p_WN: np.ndarray, body_of_node: np.ndarray, cable_ends: np.ndarray
) -> np.ndarray:
    """Wrenches (6 B, cables) of cables with unit tension on B bodies.

    The six rows of a body are the torque about the world's origin (N m per N), then the force, both
    in the world frame.

    Args:
        p_WN: positions of the nodes (nodes, 3) in m.
        body_of_node: index of the body of each node (nodes,).
        cable_ends: indices of the two nodes of each cable (cables, 2).
    """
    cables, (node_a, node_b) = np.arange(len(cable_ends)), cable_ends.T
    force = p_WN[node_b] - p_WN[node_a]
    force /= np.linalg.norm(force, axis=1, keepdims=True)
    wrench = np.hstack([np.cross(p_WN[node_a], force), force])
    bodies = body_of_node.max() + 1
    wrenches = np.zeros((bodies, 6, len(cables)))
    wrenches[body_of_node[node_a], :, cables] = wrench
    wrenches[body_of_node[node_b], :, cables] = -wrench
    return wrenches.reshape(6 * bodies, len(cables))


def _is_straight(p_WN: np.ndarray) -> bool:
    """True if the nodes (n, 3) of a body lie on a line."""
    return bool(np.linalg.matrix_rank(p_WN - p_WN[0], tol=TOLERANCE) < 2)
