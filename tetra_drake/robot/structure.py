"""The robot's structure as data: nodes, struts, cables, contacts."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np

from tetra_drake.physics.kinematics import NODE_COLUMNS, P_WN, move_nodes
from tetra_drake.robot.actuation import Actuation
from tetra_drake.robot.equilibrium import Rest


@dataclass(frozen=True)
class Structure:
    """Rigid bodies, each of struts that meet in nodes, tied together by cables.

    Nodes run body by body. SI units.
    """

    bodies: tuple[str, ...]
    """The names of the bodies, such as "T1"."""
    node_names: tuple[str, ...]
    """Such as "T1 tip"."""
    first_node: np.ndarray
    """(bodies + 1,): the index of each body's first node, and the number of nodes."""
    p_BN: np.ndarray
    """(nodes, 3): the nodes in the frames of their bodies, whose origins are centres of mass."""
    struts: np.ndarray
    """(struts, 2): the indices of the nodes that each joins, body by body."""
    strut_radius: np.ndarray
    """(struts,)."""
    node_radius: np.ndarray
    """(nodes,)."""
    mass: np.ndarray
    """(bodies,)."""
    unit_inertia: np.ndarray
    """(bodies, 6): moments and products xx, yy, zz, xy, xz, yz of each body about its origin, in
    its frame, over its mass (m²)."""
    p_WB: np.ndarray
    """(bodies, 3): the bodies at t = 0."""
    q_WB: np.ndarray
    """(bodies, 4): their quaternions then, w first."""
    cables: np.ndarray
    """(cables,) of dtype CABLE: pair by pair of bodies, from the lower index to the higher one."""
    cable_groups: tuple[str, ...]
    """The group of each cable, such as "outer"."""
    actuation: Actuation
    contacts: np.ndarray
    """(contacts,): the indices of the nodes that the ground can touch, ascending."""
    markers: np.ndarray
    """(markers,): the indices of the nodes that are followed, body by body: the bottom left and
    bottom right ones of a row of tetrahedra. None for other structures, whose centre is followed.
    """
    rest: Rest | None = None
    """The rest at which it starts, but for offsets and slope; None for a row of tetrahedra, which
    starts as placed."""

    @property
    def cable_names(self) -> tuple[str, ...]:
        """Such as "T1-T2 outer bottom_left"."""
        return self.actuation.layout.cable_names

    @property
    def signals(self) -> int:
        """Actuation signals: one per oscillator."""
        return len(self.actuation.names)

    @property
    def is_row(self) -> bool:
        """True for a row of tetrahedra."""
        return len(self.markers) > 0

    @property
    def followed(self) -> str:
        """The name of what is followed."""
        return "bottom nodes" if self.is_row else "centre"

    @property
    def carriers(self) -> np.ndarray:
        """(nodes,): the index of each node's body."""
        return np.repeat(np.arange(len(self.bodies)), np.diff(self.first_node))

    @functools.cached_property
    def node_shares(self) -> np.ndarray:
        """(nodes,): the shares with which the nodes make up the centre of mass, wherever the bodies
        are."""
        shares = []
        for p_BN, mass in zip(np.split(self.p_BN, self.first_node[1:-1]), self.mass, strict=True):
            # Each body's origin is its centre of mass, in the hull of its nodes.
            conditions = np.vstack([p_BN.T, np.full(len(p_BN), np.abs(p_BN).max())])
            origin = [0.0, 0.0, 0.0, conditions[3, 0]]
            shares.append(mass * np.linalg.lstsq(conditions, origin)[0])
        return np.concatenate(shares) / self.mass.sum()

    @property
    def isotropic(self) -> bool:
        """True if each body has the same moment of inertia about all axes, but for rounding."""
        moments, products = self.unit_inertia[:, :3], self.unit_inertia[:, 3:]
        allowed = 1e-12 * moments.max()
        return bool(np.ptp(moments, axis=1).max() <= allowed and abs(products).max() <= allowed)

    @property
    def initial_state(self) -> np.ndarray:
        """(13 bodies,): [q; v] at t = 0, at rest."""
        poses = np.hstack([self.q_WB, self.p_WB]).ravel()
        return np.concatenate([poses, np.zeros(6 * len(self.bodies))])


def turn_with_slope(
    p_WB: np.ndarray, q_WB: np.ndarray, slope: float
) -> tuple[np.ndarray, np.ndarray]:
    """Positions (bodies, 3) and quaternions (bodies, 4), w first, of bodies that are turned about
    World's y axis with ground that rises by `slope` (rad) along x."""
    # Written out, as a product of matrices is rounded differently on different processors.
    s, c = math.sin(slope), math.cos(slope)
    forward, left, up = p_WB.T
    turned_p_WB = np.stack([c * forward - s * up, left, s * forward + c * up], axis=1)
    s, c = math.sin(slope / 2), math.cos(slope / 2)
    w, x, y, z = q_WB.T
    turned_q_WB = np.stack([c * w + s * y, c * x - s * z, c * y - s * w, c * z + s * x], axis=1)
    return turned_p_WB, turned_q_WB


def followed_nodes(p_WN: np.ndarray, structure: Structure) -> np.ndarray:
    """Positions (..., markers, 3) of the markers among nodes p_WN (..., nodes, 3), or (..., 1, 3)
    of the centre of mass."""
    if structure.is_row:
        return p_WN[..., structure.markers, :]
    return (structure.node_shares @ p_WN)[..., np.newaxis, :]


def node_positions(structure: Structure, state: np.ndarray) -> np.ndarray:
    """p_WN (nodes, 3) in m from the state (13 n,) of the bodies."""
    return moved_nodes(structure, state)[:, P_WN : P_WN + 3]


def moved_nodes(structure: Structure, state: np.ndarray) -> np.ndarray:
    """The `nodes` of physics.kinematics, without forces, for a state (13 n,) of the bodies."""
    nodes = np.empty((len(structure.node_names), NODE_COLUMNS))
    move_nodes(state, structure.p_BN, structure.first_node, nodes)
    return nodes
