"""Forces of the surroundings on nodes: anchors, which hold nodes, and constant loads."""

from __future__ import annotations

from typing import NamedTuple

from tetra_drake.kernels.compiling import inlined
from tetra_drake.kernels.lanes import Table
from tetra_drake.laws.kinematics import FORCE, P_WN, V_WN
from tetra_drake.laws.vectors import Vector3, add_vector, difference, vector_at


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


class NodeLoads(NamedTuple):
    """Constant forces on nodes."""

    nodes: Table
    """Indices of the loaded nodes (loads,)."""
    forces: Table
    """Forces (loads, 3) in N, in the world frame."""


@inlined
def anchor_force(anchors: AnchorSprings, nodes: Table, i: int) -> Vector3:
    """Force (N) of anchor i on its node, in the world frame. `nodes` is the table of
    `kinematics`."""
    node = anchors.nodes[i]
    p_x, p_y, p_z = difference(vector_at(nodes, node, P_WN), vector_at(anchors.places, i, 0))
    v_x, v_y, v_z = vector_at(nodes, node, V_WN)
    k_x, k_y, k_z = vector_at(anchors.stiffness, i, 0)
    c_x, c_y, c_z = vector_at(anchors.damping, i, 0)
    return -k_x * p_x - c_x * v_x, -k_y * p_y - c_y * v_y, -k_z * p_z - c_z * v_z


@inlined
def add_anchor_forces(anchors: AnchorSprings, nodes: Table) -> None:
    """Adds the forces of all anchors to the forces on the nodes."""
    for i in range(anchors.nodes.size):
        add_vector(anchor_force(anchors, nodes, i), anchors.nodes[i], FORCE, nodes)


@inlined
def add_loads(loads: NodeLoads, nodes: Table) -> None:
    """Adds all loads to the forces on the nodes."""
    for i in range(loads.nodes.size):
        add_vector(vector_at(loads.forces, i, 0), loads.nodes[i], FORCE, nodes)
