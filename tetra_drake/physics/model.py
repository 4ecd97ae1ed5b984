"""The constants of a robot's laws, as the kernels of every engine take them."""

from __future__ import annotations

from typing import NamedTuple

from tetra_drake.physics.actuator import Actuator
from tetra_drake.physics.cable import Cables
from tetra_drake.physics.clearance import Struts
from tetra_drake.physics.contact import Ground
from tetra_drake.simd.lanes import Table


class Bodies(NamedTuple):
    """Constants of the bodies; SI units."""

    mass: Table
    """(bodies,)."""
    inertia: Table
    """(bodies, 6): about the centre of mass in the body's frame; see physics.inertia."""
    radius: Table
    """(bodies,): the greatest distance of a node from the centre of mass."""
    weight: Table
    """(bodies,)."""


class Couplings(NamedTuple):
    """The pairs of bodies that cables join. The cables of a pair follow each other, and run from
    its first body, which has the lower index, to its second one."""

    first: Table
    """(pairs,)."""
    second: Table
    """(pairs,)."""
    first_cable: Table
    """(pairs + 1,): the index of each pair's first cable, and the number of cables."""


class Model(NamedTuple):
    """A structure and the constants of its laws; SI units."""

    p_BN: Table
    """(nodes, 3): nodes in the frames of their bodies, body by body."""
    first_node: Table
    """(bodies + 1,): the index of each body's first node, and the number of nodes."""
    cables: Cables
    actuator: Actuator
    couplings: Couplings
    ground: Ground
    bodies: Bodies
    struts: Struts
    isotropic: bool
    """True if each body has the same moment of inertia about all axes."""
    slack: bool
    """True if a cable cannot push."""
