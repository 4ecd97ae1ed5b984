"""Cables: springs with damping and a superimposed actuation force (Eq. 6)."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np

from tetra_drake.simd.compiling import inlined
from tetra_drake.simd.lanes import Real, Table

PASSIVE = -1
"""The `signal` of a cable that no signal drives."""


class CableLaw(NamedTuple):
    """Constants of a cable, or of all cables, (cables,) each; SI units."""

    stiffness: Real
    damping: Real
    free_length: Real

    @classmethod
    def of(cls, cables: Table) -> Self:
        """The laws of an array of dtype CABLE."""
        return cls(*(cables[name].copy() for name in cls._fields))


CABLE = np.dtype(
    [
        *((name, np.int64) for name in ("node_a", "node_b", "signal")),
        *((name, float) for name in CableLaw._fields),
    ]
)
"""One cable: the two nodes that it joins, the signal that drives it, and its law in SI."""


class Cables(NamedTuple):
    """The cables as kernels take them: (cables,) of each field of CABLE."""

    node_a: Table
    node_b: Table
    signal: Table
    law: Table
    """A CableLaw of tables."""

    @classmethod
    def of(cls, cables: Table) -> Self:
        """Cables of an array of dtype CABLE."""
        node_a, node_b, signal = (cables[name].copy() for name in ("node_a", "node_b", "signal"))
        return cls(node_a, node_b, signal, CableLaw.of(cables))


@inlined
def law_of(cables: Cables, i: int) -> CableLaw:
    """The law of a cable."""
    law = cables.law
    return CableLaw(law.stiffness[i], law.damping[i], law.free_length[i])


DIRECTION, LENGTH, TENSION, TENSION_PER_RATE, CABLE_FORCE_COLUMNS = 0, 3, 4, 5, 6
"""Columns of `cable_forces`, (cables, 6): direction from node a to node b in World, length (m),
tension T (N), dT/d(dl/dt) (N s/m), how much it rises with the rate of the length; and their
number."""


@inlined
def elastic_tension(stretch: Real, law: CableLaw) -> Real:
    """Tension (N) of a cable at rest that is longer by `stretch` (m) than its free length."""
    return law.stiffness * stretch


@inlined
def cable_tension(length: Real, rate: Real, signal: Real, law: CableLaw) -> Real:
    """Tension (N) of a cable of `length` (m) that lengthens at `rate` (m/s).

    Eq. 6, with the actuation `signal` (N) superimposed.
    """
    return elastic_tension(length - law.free_length, law) + law.damping * rate + signal
