"""Constants of a robot, as arrays that compiled functions (kernels) read."""

from __future__ import annotations

from typing import Any, NamedTuple, Self

import numpy as np

from tetra_drake.kernels.lanes import Table
from tetra_drake.laws.actuator import Actuator, Force
from tetra_drake.laws.cable import NO_CABLES, Cables
from tetra_drake.laws.capsules import StrutContactLaw
from tetra_drake.laws.contact import Ground
from tetra_drake.laws.inertia import INERTIA_COLUMNS
from tetra_drake.laws.struts import Struts
from tetra_drake.laws.vectors import NO_INDICES, NO_NUMBERS, NO_VECTORS

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

    first: Table = NO_INDICES
    """Index of the first body of each pair (pairs,)."""
    second: Table = NO_INDICES
    """Index of the second body of each pair (pairs,)."""
    first_cable: Table = np.zeros(1, np.int64)
    """Index of the first cable of each pair (pairs + 1,); the last number is the number of
    straight cables."""
    held: Table = NO_INDICES
    """Index of the body at the end of each cable from a fixed node (fixed cables,)."""


class AnchorSprings(NamedTuple):
    """Springs and dampers that hold nodes of bodies along axes of the world; SI units."""

    nodes: Table = NO_INDICES
    """Indices of the held nodes (anchors,)."""
    carriers: Table = NO_INDICES
    """Index of the body of each held node (anchors,)."""
    places: Table = NO_VECTORS
    """Positions (anchors, 3) at which the springs have no force."""
    stiffness: Table = NO_VECTORS
    """Stiffness (anchors, 3) along x, y and z; 0 along a free axis."""
    damping: Table = NO_VECTORS
    """Damping (anchors, 3) along x, y and z; 0 along a free axis."""


class Joints(NamedTuple):
    """Ball joints: pairs of nodes of two bodies that a spring and a damper hold together; SI
    units."""

    node_a: Table = NO_INDICES
    """Index of the node of the first body (joints,), which has the lower index."""
    node_b: Table = NO_INDICES
    """Index of the node of the second body (joints,)."""
    body_a: Table = NO_INDICES
    """Index of the first body (joints,)."""
    body_b: Table = NO_INDICES
    """Index of the second body (joints,)."""
    stiffness: Table = NO_NUMBERS
    """Stiffness (joints,), the same along all axes."""
    damping: Table = NO_NUMBERS
    """Damping (joints,), the same along all axes."""
    friction: Table = NO_NUMBERS
    """Torque limit (joints,) of the friction; 0 without."""


class NodeLoads(NamedTuple):
    """Constant forces (N) on nodes, in the world frame."""

    nodes: Table = NO_INDICES
    """Indices of the loaded nodes (loads,)."""
    forces: Table = NO_VECTORS
    """Forces (loads, 3) in N, in the world frame."""


class Model(NamedTuple):
    """Constants of a robot: its structure and its physical laws; SI units. By default no force acts
    on its bodies."""

    p_BN: Table
    """Positions of the nodes (nodes, 3) in the frames of their bodies, in the order of the bodies;
    then positions of fixed nodes in the world."""
    first_node: Table
    """Index of each body's first node (bodies + 1,); the last number is the index of the first
    fixed node."""
    bodies: Bodies
    cables: Cables = NO_CABLES
    actuator: Actuator = Force().actuator()
    couplings: Couplings = Couplings()
    ground: Ground = Ground()
    anchors: AnchorSprings = AnchorSprings()
    joints: Joints = Joints()
    loads: NodeLoads = NodeLoads()
    struts: Struts = Struts()
    strut_contact: StrutContactLaw = StrutContactLaw()
    isotropic: bool = True
    """True if each body has the same moment of inertia about all axes."""
    slack: bool = True
    """True if cables go slack instead of pushing."""

    @classmethod
    def of_nodes(cls, p_BN: Table, first_node: Table, **laws: Any) -> Self:
        """Model that gives forces on nodes; the masses of its bodies are 0.

        `p_BN` (nodes, 3) are positions of the nodes (m) in the frames of their bodies, `first_node`
        (bodies + 1,) the index of each body's first node, then the number of nodes on bodies.
        `laws` are other fields of a Model.
        """
        none = np.zeros(first_node.size - 1)
        bodies = Bodies(none, np.zeros((none.size, INERTIA_COLUMNS)), none, none)
        return cls(p_BN, first_node, bodies, **laws)
