"""The constants of a robot's laws, as the kernels of every engine take them."""

from __future__ import annotations

from typing import NamedTuple

from tetra_drake.physics.contact import Ground
from tetra_drake.simd.lanes import Table

JUNCTION_CABLES = 6
"""The cables between two neighbouring bodies."""


class Body(NamedTuple):
    """Constants of all bodies; SI units. Each a table of one."""

    mass: Table
    moment: Table
    """Moment of inertia about any axis through the centre of mass."""
    radius: Table
    """Distance of the nodes from the centre of mass."""
    gravity: Table


class Model(NamedTuple):
    """A structure and the constants of its laws; SI units."""

    p_BN: Table
    """(nodes per body, 3)."""
    cables: Table
    """(cables,) of dtype CABLE or Cables; JUNCTION_CABLES from each body to the next, in order."""
    ground: Ground
    body: Body
    slack: bool
