"""Statics of a tensegrity: self-stress states, and the mechanisms that cables do not hinder.

See S. Pellegrino, "Structural computations with the singular value decomposition of the equilibrium
matrix", International Journal of Solids and Structures 30 (1993), here for rigid bodies.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tetra_drake.scenario.robot_kinds import Structure

TOLERANCE = 1e-6
"""Greatest singular value that counts as zero, as a share of the greatest, where lengths are
measured in the size of the structure. Coordinates with six digits are exact enough."""


@dataclass(frozen=True)
class Statics:
    """Count of self-stress states and mechanisms where the nodes are."""

    rank: int
    """Rank of the cables' wrenches."""
    self_stresses: np.ndarray
    """(s, cables): tensions that balance without loads, an orthonormal basis."""
    mechanisms: int
    """Infinitesimal motions that change no cable's length, to first order. Motions of the
    structure as a whole do not count, nor the spin of straight bodies about themselves."""

    @property
    def self_stress_states(self) -> int:
        """Dimension of the space of self-stresses."""
        return len(self.self_stresses)


def cable_wrenches(
    *, p_WN: np.ndarray, body_of_node: np.ndarray, cable_ends: np.ndarray, p_WB: np.ndarray
) -> np.ndarray:
    """Wrenches of cables of unit tension on bodies, (6 B, cables).

    p_WN: (nodes, 3), in m. body_of_node: (nodes,), numbers of bodies. cable_ends: (cables, 2),
    numbers of nodes. p_WB: (B, 3), the bodies' origins. The six rows of a body are torque about its
    origin (N m per N), then force, in World.
    """
    p_AC = p_WN[cable_ends[:, 1]] - p_WN[cable_ends[:, 0]]
    along = p_AC / np.linalg.norm(p_AC, axis=1, keepdims=True)
    wrenches = np.zeros((len(p_WB), 6, len(cable_ends)))
    cables = np.arange(len(cable_ends))
    for nodes, force in ((cable_ends[:, 0], along), (cable_ends[:, 1], -along)):
        bodies = body_of_node[nodes]
        wrenches[bodies, :3, cables] += np.cross(p_WN[nodes] - p_WB[bodies], force)
        wrenches[bodies, 3:, cables] += force
    return wrenches.reshape(6 * len(p_WB), len(cable_ends))


def statics_of(structure: Structure) -> Statics:
    """Statics of a structure with its nodes as given."""
    number = {node: place for place, node in enumerate(structure.nodes)}
    ends = [[number[node] for node in cable.nodes] for cable in structure.all_cables]
    return find_statics(
        p_WN=np.array(list(structure.nodes.values())),
        body_of_node=np.array([structure.body_of_node[node] for node in structure.nodes]),
        cable_ends=np.array(ends, dtype=int).reshape(-1, 2),
    )


def find_statics(*, p_WN: np.ndarray, body_of_node: np.ndarray, cable_ends: np.ndarray) -> Statics:
    """Statics of two or more bodies joined by cables; for the arguments see cable_wrenches()."""
    bodies = int(body_of_node.max()) + 1
    size = np.linalg.norm(np.ptp(p_WN, axis=0))
    p_WN = (p_WN - p_WN.mean(axis=0)) / size
    nodes_of_body = [p_WN[body_of_node == body] for body in range(bodies)]
    wrenches = cable_wrenches(
        p_WN=p_WN,
        body_of_node=body_of_node,
        cable_ends=cable_ends,
        p_WB=np.array([nodes.mean(axis=0) for nodes in nodes_of_body]),
    )
    _, singular_values, tensions = np.linalg.svd(wrenches)
    rank = int(np.count_nonzero(singular_values > TOLERANCE * singular_values[0]))
    straight = sum(_is_straight(nodes) for nodes in nodes_of_body)
    return Statics(
        rank=rank,
        self_stresses=tensions[rank:],
        mechanisms=6 * bodies - 6 - straight - rank,
    )


def _is_straight(p_WN: np.ndarray) -> bool:
    """True if the nodes (n, 3) of a body lie on a line."""
    return bool(np.linalg.matrix_rank(p_WN - p_WN[0], tol=TOLERANCE) < 2)
