"""Statics of a tensegrity: self-stress states, and the mechanisms that cables do not hinder.

See S. Pellegrino, "Structural computations with the singular value decomposition of the equilibrium
matrix", International Journal of Solids and Structures 30 (1993), here for rigid bodies.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

TOLERANCE = 1e-6
"""Greatest singular value that counts as zero, as a share of the greatest, where lengths are
measured in the size of the structure. Coordinates with six digits are exact enough."""


class Statics(NamedTuple):
    """Self-stress states and mechanisms where the nodes are."""

    self_stresses: np.ndarray
    """(s, cables): tensions that balance without loads, an orthonormal basis."""
    mechanisms: int
    """Number of infinitesimal motions that change no cable's length, to first order. Motions of
    the structure as a whole do not count, nor the spin of straight bodies about themselves."""


def find_statics(*, p_WN: np.ndarray, body_of_node: np.ndarray, cable_ends: np.ndarray) -> Statics:
    """Statics of bodies joined by cables; for the arguments see cable_wrenches()."""
    bodies = int(body_of_node.max()) + 1
    p_WN = (p_WN - p_WN.mean(axis=0)) / np.linalg.norm(np.ptp(p_WN, axis=0))
    wrenches = cable_wrenches(p_WN=p_WN, body_of_node=body_of_node, cable_ends=cable_ends)
    _, singular_values, tensions = np.linalg.svd(wrenches)
    greatest = singular_values.max(initial=0.0)
    rank = int(np.count_nonzero(singular_values > TOLERANCE * greatest))
    straight = sum(_is_straight(p_WN[body_of_node == body]) for body in range(bodies))
    # The spin of a structure on one line is the spin of its bodies.
    of_whole = 5 if _is_straight(p_WN) else 6
    mechanisms = 6 * bodies - of_whole - straight - rank
    return Statics(self_stresses=tensions[rank:], mechanisms=mechanisms)


def cable_wrenches(
    *, p_WN: np.ndarray, body_of_node: np.ndarray, cable_ends: np.ndarray
) -> np.ndarray:
    """Wrenches of cables of unit tension on B bodies, (6 B, cables).

    p_WN: (nodes, 3), in m. body_of_node: (nodes,), numbers of bodies. cable_ends: (cables, 2),
    numbers of nodes. The six rows of a body are torque about World's origin (N m per N), then
    force, in World.
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
