"""Constants of a robot, as arrays that compiled functions (kernels) read."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np

from tetra_drake.kernels.lanes import Table
from tetra_drake.laws.actuator import Actuator, Force
from tetra_drake.laws.cable import Cables, cable_type
from tetra_drake.laws.capsules import StrutContactLaw
from tetra_drake.laws.contact import Ground
from tetra_drake.laws.struts import Struts

WORLD = -1
"""Body index that stands for the world. Fixed nodes have it, because they belong to no body."""


def carriers_of(first_node: Table, *, nodes: int) -> Table:
    """Index of the body that each of a number of nodes belongs to (nodes,); WORLD for a fixed node.

    `first_node` is the index of each body's first node (bodies + 1,); the last number is the index
    of the first fixed node.
    """
    of_bodies = np.repeat(np.arange(len(first_node) - 1), np.diff(first_node))
    return np.pad(of_bodies, (0, nodes - len(of_bodies)), constant_values=WORLD)


class Bodies(NamedTuple):
    """Masses, inertias and sizes of a robot's rigid bodies; SI units."""

    mass: Table
    """Masses (bodies,)."""
    inertia: Table
    """Inertia (bodies, 6) about the centre of mass in the body's frame; see laws.inertia."""
    radius: Table
    """Largest distance of a node of the body from its centre of mass (bodies,)."""
    weight: Table
    """Weights (bodies,)."""


class Couplings(NamedTuple):
    """Pairs of bodies that straight cables join. The cables of a pair are consecutive. They run
    from the first body, with the lower index, to the second body. Straight cables from fixed nodes
    of the world come before all pairs, routed cables after them."""

    first: Table
    """Index of the first body of each pair (pairs,)."""
    second: Table
    """Index of the second body of each pair (pairs,)."""
    first_cable: Table
    """Index of the first cable of each pair (pairs + 1,); the last number is the number of
    straight cables."""
    held: Table
    """Index of the body at the end of each cable from a fixed node (fixed cables,)."""


class AnchorSprings(NamedTuple):
    """Springs and dampers that hold nodes of bodies along axes of the world; SI units."""

    nodes: Table
    """Indices of the held nodes (anchors,)."""
    carriers: Table
    """Index of the body of each held node (anchors,)."""
    places: Table
    """Positions (anchors, 3) at which the springs have no force."""
    stiffness: Table
    """Stiffness (anchors, 3) along x, y and z; 0 along a free axis."""
    damping: Table
    """Damping (anchors, 3) along x, y and z; 0 along a free axis."""


class Joints(NamedTuple):
    """Ball joints: pairs of nodes of two bodies that a spring and a damper hold together; SI
    units."""

    node_a: Table
    """Index of the node of the first body (joints,), which has the lower index."""
    node_b: Table
    """Index of the node of the second body (joints,)."""
    body_a: Table
    """Index of the first body (joints,)."""
    body_b: Table
    """Index of the second body (joints,)."""
    stiffness: Table
    """Stiffness (joints,), the same along all axes."""
    damping: Table
    """Damping (joints,), the same along all axes."""
    friction: Table
    """Torque limit (joints,) of the friction; 0 without."""


class NodeLoads(NamedTuple):
    """Constant forces (N) on nodes, in the world frame."""

    nodes: Table
    """Indices of the loaded nodes (loads,)."""
    forces: Table
    """Forces (loads, 3) in N, in the world frame."""


class Model(NamedTuple):
    """Constants of a robot: its structure and its physical laws; SI units."""

    p_BN: Table
    """Positions of the nodes (nodes, 3) in the frames of their bodies, in the order of the bodies;
    then positions of fixed nodes in the world."""
    first_node: Table
    """Index of each body's first node (bodies + 1,); the last number is the index of the first
    fixed node."""
    cables: Cables
    actuator: Actuator
    couplings: Couplings
    ground: Ground
    anchors: AnchorSprings
    joints: Joints
    loads: NodeLoads
    bodies: Bodies
    struts: Struts
    strut_contact: StrutContactLaw
    isotropic: bool
    """True if each body has the same moment of inertia about all axes."""
    slack: bool
    """True if cables go slack instead of pushing."""

    @classmethod
    def of_nodes(
        cls,
        p_BN: Table,
        first_node: Table,
        *,
        cables: Cables | None = None,
        actuator: Actuator | None = None,
        ground: Ground | None = None,
        slack: bool = True,
    ) -> Self:
        """Model with cables only, or with ground contact only.

        It gives forces on nodes; the masses of its bodies are 0. `p_BN` (nodes, 3) are positions of
        the nodes (m) in the frames of their bodies, `first_node` (bodies + 1,) the index of each
        body's first node, then the number of nodes on bodies. With `slack`, cables go slack instead
        of pushing.
        """
        bodies, none = first_node.size - 1, np.zeros(0)
        no_index, no_vectors = np.zeros(0, dtype=np.int64), np.zeros((0, 3))
        first = np.zeros(bodies + 1, dtype=np.int64)
        return cls(
            p_BN=p_BN,
            first_node=first_node,
            cables=cables or Cables.of(np.zeros(0, cable_type(0))),
            actuator=actuator or Force().actuator(),
            couplings=Couplings(no_index, no_index, first[:1], no_index),
            ground=ground or Ground.nowhere(),
            anchors=AnchorSprings(no_index, no_index, no_vectors, no_vectors, no_vectors),
            joints=Joints(*[no_index] * 4, *[none] * 3),
            loads=NodeLoads(no_index, no_vectors),
            bodies=Bodies(np.zeros(bodies), np.zeros((bodies, 6)), *np.zeros((2, bodies))),
            struts=Struts(no_index, no_index, no_index, no_index, first, none, none),
            strut_contact=StrutContactLaw(acts=False, normal=np.zeros(2), search=np.zeros(4)),
            isotropic=True,
            slack=slack,
        )
