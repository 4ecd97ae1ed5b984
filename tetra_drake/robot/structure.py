"""The structure of a robot: its blueprint with inertia, and where its bodies are at t = 0."""

from __future__ import annotations

import dataclasses
import functools
import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody, SpatialInertia, UnitInertia

from tetra_drake.physics.cable import CABLE, PASSIVE, CableLaw
from tetra_drake.physics.clearance import Struts
from tetra_drake.physics.kinematics import NODE_COLUMNS, P_WN, move_nodes
from tetra_drake.physics.model import Couplings
from tetra_drake.robot.bodies import body_inertias
from tetra_drake.robot.equilibrium import Equilibrium
from tetra_drake.scenario.blueprint import Blueprint


@dataclass(frozen=True)
class Structure(Blueprint):
    """Rigid bodies, each of struts that meet in nodes, tied together by cables; SI units."""

    p_BN: np.ndarray
    """(nodes, 3): the nodes in the frames of their bodies, whose origins are centres of mass."""
    mass: np.ndarray
    """(bodies,)."""
    unit_inertia: np.ndarray
    """(bodies, 6): moments and products xx, yy, zz, xy, xz, yz of each body about its origin, in
    its frame, over its mass (m²)."""
    p_WB: np.ndarray
    """(bodies, 3): the bodies at t = 0."""
    q_WB: np.ndarray
    """(bodies, 4): their quaternions then, w first."""
    equilibrium: Equilibrium | None = None
    """The equilibrium where it starts, but for offsets and slope; None if it starts as placed."""

    @classmethod
    def of(cls, blueprint: Blueprint) -> Self:
        """The structure where its blueprint places it; its bodies' frames have World's axes."""
        mass, p_FB, unit_inertia = body_inertias(blueprint)
        given = {one.name: getattr(blueprint, one.name) for one in dataclasses.fields(Blueprint)}
        return cls(
            **given,
            p_BN=blueprint.p_FN - p_FB[blueprint.carriers],
            mass=mass,
            unit_inertia=unit_inertia,
            p_WB=blueprint.p_WF + p_FB,
            q_WB=np.tile([1.0, 0.0, 0.0, 0.0], (len(mass), 1)),
        )

    @functools.cached_property
    def drivers(self) -> np.ndarray:
        """(cables,): the oscillator that drives each cable, PASSIVE if none does."""
        drivers = np.full(len(self.cable_names), PASSIVE)
        for oscillator, cables in enumerate(self.groups):
            drivers[list(cables)] = oscillator
        return drivers

    @functools.cached_property
    def cables(self) -> np.ndarray:
        """(cables,) of dtype CABLE."""
        cables = np.zeros(len(self.cable_names), dtype=CABLE)
        cables["node_a"], cables["node_b"] = self.cable_ends.T
        cables["signal"] = self.drivers
        for name in CableLaw._fields:
            cables[name] = [law[name] for law in self.cable_laws]
        return cables

    @property
    def strut_table(self) -> Struts:
        """The struts as kernels take them."""
        node_a, node_b = self.struts.T
        first = np.searchsorted(self.carriers[node_a], np.arange(len(self.bodies) + 1))
        along = self.p_BN[node_b] - self.p_BN[node_a]
        return Struts(node_a.copy(), node_b.copy(), first, length=np.linalg.norm(along, axis=1))

    @property
    def couplings(self) -> Couplings:
        """The pairs of bodies in the order of the cables; ValueError if these are in no order."""
        pairs = self.carriers[self.cable_ends]
        begins = np.flatnonzero(np.any(np.diff(pairs, axis=0, prepend=-1), axis=1))
        first, second = pairs[begins].T
        if (first >= second).any() or len(np.unique(pairs, axis=0)) < len(begins):
            raise ValueError("the cables are not in the order of the bodies that they join")
        return Couplings(first.copy(), second.copy(), np.append(begins, len(pairs)))

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
    if structure.markers.size:
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


def AddBodies(plant: MultibodyPlant, structure: Structure) -> list[RigidBody]:
    """Adds the free bodies of a structure to a plant that is not finalized yet."""
    return [
        plant.AddRigidBody(name, SpatialInertia(mass, np.zeros(3), UnitInertia(*unit)))
        for name, mass, unit in zip(
            structure.bodies, structure.mass, structure.unit_inertia, strict=True
        )
    ]
