"""Cables: springs with damping, and an actuation force added to the tension (Eq. 6).

The cables of Eq. 6 also push. Other cables go slack: such a cable pulls only while it is stretched,
and its damper then at most doubles its tension, or takes it away. With the stretch x = l - l0,

    E = max(0, k x)
    T = E + c dl/dt, limited to 0 ... 2 E

A loose cable exerts no force, however fast it lengthens. The tension is continuous. Where the
damper is weaker than the spring, this is Eq. 6.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from pydantic import Field

from tetra_drake.kernels.compiling import inlined
from tetra_drake.kernels.lanes import Real, Table, maximum, minimum, select
from tetra_drake.settings.quantities import Damping
from tetra_drake.settings.section import Section

PASSIVE = -1
"""Value of `signal` for a cable without actuation."""


class CableConstants(Section):
    """Settings of cables that all kinds of robots have in common."""

    damping: Damping = Field(ge=0)
    """Damping coefficient of a cable: tension divided by the rate of its length."""

    def constants(self, *, stiffness: float, free_length: float) -> dict[str, float]:
        """Constants of one cable as keyword arguments of CableLaw, in SI units. `stiffness` is in
        N/m, `free_length` in m."""
        own = {name: getattr(self, name) for name in CableConstants.model_fields}
        return own | {"stiffness": stiffness, "free_length": free_length}


class CableLaw(NamedTuple):
    """Constants of a cable, or tables (cables,) of the constants of all cables: stiffness (N/m),
    damping (N s/m) and free length (m)."""

    stiffness: Real
    damping: Real
    free_length: Real
    intact: Real = 1.0
    """0 for a cut cable, which no actuator pulls; otherwise 1. A cut cable has no stiffness and no
    damping either."""

    def cut(self) -> Self:
        """These constants after the cable was cut: it has no tension, whatever its actuator
        does."""
        return self._replace(stiffness=0.0, damping=0.0, intact=0.0)

    @classmethod
    def of(cls, cables: Table) -> Self:
        """Constants of all cables as tables (cables,), from an array (cables,) of the NumPy record
        type CABLE."""
        tables: Any = (cables[name].copy() for name in cls._fields)
        return cls(*tables)


CABLE = np.dtype(
    [
        *((name, np.int64) for name in ("node_a", "node_b", "signal")),
        *((name, float) for name in CableLaw._fields),
    ]
)
"""NumPy record type of a cable: indices of its two nodes and its signal, and constants in SI."""


class Routes(NamedTuple):
    """Paths of the cables that run over rings at nodes. A straight cable has no path."""

    nodes: Table
    """Indices of the nodes of all paths, with both ends, one path after the other (path nodes,)."""
    first: Table
    """Index in `nodes` of the first node of each cable's path (cables + 1,). The last number is the
    number of path nodes."""


class Cables(NamedTuple):
    """Cables of a robot for the kernels: nodes, signals and constants, as arrays (cables,)."""

    node_a: Table
    node_b: Table
    signal: Table
    drive: Table
    """Row of each driven cable's actuator in the table `drives` of laws.actuator."""
    law: Any
    """Constants of all cables: a CableLaw of tables (cables,)."""
    routes: Routes

    @classmethod
    def of(cls, cables: Table, rings: Mapping[int, Sequence[int]] | None = None) -> Self:
        """Cables from an array (cables,) of the NumPy record type CABLE. `rings` has the inner
        nodes of each routed cable, by the cable's index."""
        node_a, node_b, signal = (cables[name].copy() for name in ("node_a", "node_b", "signal"))
        paths = [
            [node_a[i], *rings[i], node_b[i]] if rings and i in rings else []
            for i in range(len(cables))
        ]
        routes = Routes(
            nodes=np.array([node for path in paths for node in path], dtype=np.int64),
            first=np.cumsum([0, *map(len, paths)]),
        )
        drive = np.maximum(0, np.cumsum(signal != PASSIVE) - 1)
        return cls(node_a, node_b, signal, drive, CableLaw.of(cables), routes)

    @property
    def pieces(self) -> Table:
        """Indices of the two nodes of each straight piece of the cables (pieces, 2)."""
        ends = np.stack([self.node_a, self.node_b], axis=1)
        paths = np.split(self.routes.nodes, self.routes.first[1:-1])
        of_cables = (path if path.size else end for path, end in zip(paths, ends, strict=False))
        pieces = [piece for path in of_cables for piece in itertools.pairwise(path)]
        return np.array(pieces, dtype=np.int64).reshape(-1, 2)


@inlined
def law_of(cables: Cables, i: int) -> CableLaw:
    """Constants of cable i, from the tables of the constants of all cables."""
    law = cables.law
    return CableLaw(law.stiffness[i], law.damping[i], law.free_length[i], law.intact[i])


DIRECTION, LENGTH, TENSION, TENSION_PER_RATE, RATE, CABLE_FORCE_COLUMNS = 0, 3, 4, 5, 6, 7
"""Columns of the table `cable_forces` (cables, 7), and their number: direction from node a to node
b, or to the first ring, in the world frame, length l (m), tension T (N), the derivative
dT/d(dl/dt) (N s/m), and the rate dl/dt (m/s)."""


@inlined
def elastic_tension(stretch: Real, law: CableLaw) -> Real:
    """Tension (N) of a cable's spring at rest. `stretch` (m) is the cable's length minus its free
    length. The tension is negative if the stretch is; slack_tension() takes it as 0 then."""
    return law.stiffness * stretch


def elastic_stretch(tension: Real, law: CableLaw) -> Real:
    """Stretch (m) of a cable at rest with a tension (N): the inverse of elastic_tension()."""
    return tension / law.stiffness


def elastic_stiffness(stretch: Real, law: CableLaw) -> Real:
    """Derivative of elastic_tension() by the stretch, in N/m."""
    return law.stiffness + 0.0 * stretch


def elastic_energy(stretch: Real, law: CableLaw) -> Real:
    """Integral of elastic_tension() from 0 to a stretch (m), in J."""
    return 0.5 * law.stiffness * stretch**2


@inlined
def cable_tension(length: Real, rate: Real, signal: Real, law: CableLaw) -> Real:
    """Tension (N) of a cable by Eq. 6 of the thesis: spring plus damper plus actuation force. A
    negative tension pushes.

    `length` is in m, `rate` (m/s) is the rate of the length, `signal` (N) is the actuation force.
    """
    return elastic_tension(length - law.free_length, law) + law.damping * rate + signal


@inlined
def most_tension(elastic: Real) -> Real:
    """Greatest tension (N) of a cable that goes slack, 2 max(0, E): its damper at most doubles the
    elastic tension E. `elastic` (N) is E; see elastic_tension()."""
    return 2.0 * maximum(elastic, 0.0)


@inlined
def slack_tension(elastic: Real, rate: Real, law: CableLaw) -> tuple[Real, Real]:
    """Tension (N) of a cable that goes slack, and its derivative by the rate (N s/m).

    The tension is elastic + damping rate, limited to 0 ... 2 max(0, elastic). `elastic` (N) is
    elastic_tension(), `rate` (m/s) the rate of the length.
    """
    linear = elastic + law.damping * rate
    tension = minimum(maximum(linear, 0.0), most_tension(elastic))
    return tension, select(tension == linear, law.damping, 0.0)


def tendon_faults(cables: Table, *, slack: bool) -> dict[str, Table]:
    """Cables that MuJoCo's tendons cannot imitate: for each reason a mask (cables,), True where it
    holds.

    The keys are the reasons as sentences. `cables` is an array of dtype CABLE. `slack` is true if
    cables go slack.
    """
    is_damped = slack & (cables["damping"] != 0.0)
    return {"the dampers of MuJoCo's tendons also act where a cable is slack": is_damped}
