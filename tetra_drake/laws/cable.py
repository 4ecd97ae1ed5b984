"""Cables: springs with damping, and an actuation force added to the tension (Eq. 6).

The cables of Eq. 6 also push. Other cables go slack: such a cable pulls only while it is stretched,
and its damper then at most doubles its tension, or takes it away. With the stretch x = l - l0,

    E = max(0, k x)
    T = E + c dl/dt, limited to 0 ... 2 E

A loose cable exerts no force, however fast it lengthens. The tension is continuous. Where the
damper is weaker than the spring, this is Eq. 6.

The spring of some cables is not k x: a coil spring has an initial tension, other springs have a
table or a polynomial. These are polynomials in pieces, a Curve. elastic_tension(), and its
derivative, integral and inverse, are the only functions that know what a spring is.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Self

import numpy as np

from tetra_drake.kernels.compiling import called, inlined
from tetra_drake.kernels.lanes import Real, Table, maximum, minimum, select

PASSIVE = -1
"""Value of `signal` for a cable without actuation."""


class Curve(NamedTuple):
    """Elastic tension of a cable, or of all cables, as polynomials of the stretch in pieces. All
    cables of a robot have the same number of pieces, 0 if the tension of each is k x."""

    rows: Table
    """Pieces (cables * pieces, 5), cable by cable, with ascending starts: the stretch (m) at which
    a piece starts, then the coefficients (N, N/m, N/m², N/m³) of its polynomial in the stretch
    beyond. The last piece goes on. Unused pieces start at NOWHERE."""
    first: Any
    """Row of the first piece: an index, or indices (cables,)."""
    pieces: int
    """Number of pieces of each cable."""

    @classmethod
    def of(cls, rows: Any) -> Self:
        """The curve of one cable from its pieces (pieces, 5)."""
        return cls(np.array(rows, dtype=float).reshape(-1, 5), 0, len(rows))

    @classmethod
    def of_spring(
        cls,
        stiffness: float,
        *,
        initial_tension: float = 0.0,
        quadratic: float = 0.0,
        cubic: float = 0.0,
        table: Sequence[tuple[float, float]] = (),
    ) -> Self:
        """The curve of a spring with the tension F0 + k x + a x² + b x³, or F0 + a table.

        Args:
            stiffness: k, in N/m; not used with a table.
            initial_tension: F0, in N. Below it the coils touch: the spring is CLOSED times as
                stiff.
            quadratic: a, in N/m².
            cubic: b, in N/m³.
            table: stretches (m) and tensions (N) without F0, ascending from beyond 0. The tension
                is straight between them.
        """
        points = [(0.0, 0.0), *table]
        rows = [
            [x, initial_tension + force, (next_force - force) / (next_x - x), 0.0, 0.0]
            for (x, force), (next_x, next_force) in itertools.pairwise(points)
        ]
        if not table and (initial_tension or quadratic or cubic):
            rows = [[0.0, initial_tension, stiffness, quadratic, cubic]]
        if initial_tension:
            slope = rows[0][2]
            parting = initial_tension / ((CLOSED - 1.0) * slope)  # where the coils part
            first = [parting, CLOSED * slope * parting, slope + 2.0 * quadratic * parting]
            rows[:1] = [[0.0, 0.0, CLOSED * slope, 0.0, 0.0], [*first, quadratic, cubic]]
        return cls.of(rows)

    @classmethod
    def stacked(cls, curves: Sequence[Curve]) -> Self:
        """The curves of several robots: `first` gets an axis of robots (N, cables)."""
        rows = np.concatenate([curve.rows for curve in curves])
        first = [k * len(curve.rows) + curve.first for k, curve in enumerate(curves)]
        return cls(rows, np.array(first), curves[0].pieces)

    def scaled(self, factor: float) -> Self:
        """This curve with its tensions multiplied by a factor."""
        return self._replace(rows=self.rows * [1.0, *4 * [factor]])


CLOSED = 1000.0
"""Stiffness of a coil spring whose coils touch, as a multiple of its stiffness beyond."""
MEETING = 1e-5
"""Distance e (m) of a cable's ends below which its length is (d² + e²) / 2e for a distance d. The
direction of a pull has no meaning where the ends meet. There the pull becomes 0 in proportion."""
NOWHERE = 1e300
"""Stretch (m) at which unused pieces of curves start."""
NO_CURVE = Curve.of([])


class CableLaw(NamedTuple):
    """Constants of a cable, or tables (cables,) of the constants of all cables: stiffness (N/m),
    damping (N s/m) and free length (m). For a cable with a curve, the stiffness is the one that
    controllers convert forces to lengths with."""

    stiffness: Real
    damping: Real
    free_length: Real
    intact: Real = 1.0
    """0 for a cut cable, which no actuator pulls; otherwise 1. A cut cable has no stiffness and no
    damping either."""
    mu: Real = 0.0
    """Coefficient of friction at the rings of a routed cable; see laws.dry_friction."""
    curve: Curve = NO_CURVE
    """Tension of the spring in place of k x."""

    def cut(self) -> Self:
        """These constants after the cable was cut: it has no tension, whatever its actuator
        does."""
        cut = self._replace(stiffness=0.0, damping=0.0, intact=0.0)
        return cut._replace(curve=self.curve.scaled(0.0))

    @classmethod
    def of(cls, cables: Table) -> Self:
        """Constants of all cables as tables (cables,), from an array (cables,) of a NumPy record
        type of cable_type()."""
        count, pieces, _ = cables["curve"].shape
        rows = cables["curve"].reshape(-1, 5).copy()
        curve = Curve(rows, pieces * np.arange(count), pieces)
        return cls._make([*(cables[name].copy() for name in NUMBERS), curve])

    @classmethod
    def put(cls, laws: Sequence[CableLaw], node_a: Any, node_b: Any) -> np.ndarray:
        """Records (cables,) of cable_type() for passive cables, from the constants of each and the
        indices (cables,) of its nodes."""
        cables = np.zeros(len(laws), cable_type(max([law.curve.pieces for law in laws], default=0)))
        cables["node_a"], cables["node_b"], cables["signal"] = node_a, node_b, PASSIVE
        for name in NUMBERS:
            cables[name] = [getattr(law, name) for law in laws]
        cables["curve"][..., 0] = NOWHERE
        for own, law in zip(cables["curve"], laws, strict=True):
            own[: law.curve.pieces] = law.curve.rows
        return cables


NUMBERS = CableLaw._fields[:-1]
"""Names of the constants that are one number per cable."""


def cable_type(pieces: int) -> np.dtype:
    """NumPy record type of a cable: indices of its two nodes and its signal, and constants in SI.
    `pieces` is the number of pieces of its curve."""
    indices = [(name, np.int64) for name in ("node_a", "node_b", "signal")]
    numbers = [(name, float) for name in NUMBERS]
    return np.dtype([*indices, *numbers, ("curve", float, (pieces, 5))])


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
        """Cables from an array (cables,) of a type of cable_type(). `rings` has the inner
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


NO_CABLES = Cables.of(np.zeros(0, cable_type(0)))


@inlined
def law_of(cables: Cables, i: int) -> CableLaw:
    """Constants of cable i, from the tables of the constants of all cables."""
    law, curve = cables.law, cables.law.curve
    own = Curve(curve.rows, i * curve.pieces, curve.pieces)
    numbers = law.stiffness[i], law.damping[i], law.free_length[i], law.intact[i], law.mu[i]
    return CableLaw(*numbers, own)


DIRECTION, LENGTH, TENSION, TENSION_PER_RATE, RATE, CABLE_FORCE_COLUMNS = 0, 3, 4, 5, 6, 7
"""Columns of the table `cable_forces` (cables, 7), and their number: direction from node a to node
b, or to the first ring, in the world frame, length l (m), tension T (N), the derivative
dT/d(dl/dt) (N s/m), and the rate dl/dt (m/s)."""


@inlined
def elastic_tension(stretch: Real, law: CableLaw) -> Real:
    """Tension (N) of a cable's spring at rest. `stretch` (m) is the cable's length minus its free
    length. The tension is negative if the stretch is; slack_tension() takes it as 0 then."""
    tension = law.stiffness * stretch
    if law.curve.pieces:
        tension = tension_on_curve(stretch, tension, law.curve)
    return tension


@called
def tension_on_curve(stretch: Real, tension: Real, curve: Curve) -> Real:
    """Tension (N) of a cable's curve at a stretch (m); `tension` (N) before its first piece."""
    for piece in range(curve.pieces):
        start, constant, linear, square, cube = piece_of(curve, piece)
        x = stretch - start
        on_piece = constant + x * (linear + x * (square + x * cube))
        tension = select(x >= 0.0, on_piece, tension)
    return tension


@inlined
def piece_of(curve: Curve, piece: int) -> tuple[Real, Real, Real, Real, Real]:
    """Start and coefficients of a piece of a cable's curve; see Curve."""
    rows, i = curve.rows, curve.first + piece
    return rows[i, 0], rows[i, 1], rows[i, 2], rows[i, 3], rows[i, 4]


def elastic_stiffness(stretch: Any, law: CableLaw) -> Any:
    """Derivative of elastic_tension() by the stretch, in N/m. For arrays, too."""
    stiffness = law.stiffness + 0.0 * stretch
    for piece in range(law.curve.pieces):
        start, _, linear, square, cube = piece_of(law.curve, piece)
        x = stretch - start
        slope = linear + x * (2.0 * square + x * 3.0 * cube)
        stiffness = select(x >= 0.0, slope, stiffness)
    return stiffness


def elastic_energy(stretch: Any, law: CableLaw) -> Any:
    """Integral of elastic_tension() from 0 to a stretch (m), in J. For arrays, too."""
    pieces = [piece_of(law.curve, piece) for piece in range(law.curve.pieces)]
    ends = [piece[0] for piece in pieces] + [np.inf]
    energy = 0.5 * law.stiffness * np.minimum(stretch, ends[0]) ** 2
    for (start, constant, linear, square, cube), end in zip(pieces, ends[1:], strict=True):
        x = np.clip(stretch, start, end) - start
        energy += x * (constant + x * (linear / 2 + x * (square / 3 + x * cube / 4)))
    return energy


def elastic_stretch(tension: Any, law: CableLaw) -> Any:
    """Stretch (m) of a cable at rest with a tension (N): the inverse of elastic_tension(). For
    arrays, too."""
    if not law.curve.pieces:
        return tension / law.stiffness
    low, high = np.minimum(tension / law.stiffness, 0.0), 0.0 * tension + 1e-3
    while np.any(short := elastic_tension(high, law) < tension):
        high = np.where(short, 2.0 * high, high)
    for _ in range(64):  # to the last digit
        middle = 0.5 * (low + high)
        is_low = elastic_tension(middle, law) < tension
        low, high = np.where(is_low, middle, low), np.where(is_low, high, middle)
    return high[()]


def steepest(stretch: Any, law: CableLaw) -> Any:
    """Greatest stiffness (N/m) of a cable at a stretch (m) and where a piece of its curve starts.
    For arrays, too."""
    starts = [piece_of(law.curve, piece)[2] for piece in range(law.curve.pieces)]
    return functools.reduce(np.maximum, starts, elastic_stiffness(stretch, law))


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

    The keys are the reasons as sentences. `cables` is an array of a type of cable_type(). `slack`
    is true if cables go slack.
    """
    is_damped = slack & (cables["damping"] != 0.0)
    is_cubic = np.array([tendon_coefficients(one["curve"]) is not None for one in cables], bool)
    return {
        "the dampers of MuJoCo's tendons also act where a cable is slack": is_damped,
        "MuJoCo's tendons have neither an initial tension nor a table": ~is_cubic,
    }


def tendon_coefficients(curve: np.ndarray) -> list[float] | None:
    """Coefficients (N/m, N/m², N/m³) of a curve (pieces, 5) that is a polynomial from 0 on, as
    MuJoCo's tendons have; empty for a cable without a curve, None for another curve."""
    used = curve[curve[:, 0] < NOWHERE]
    if len(used) == 0:
        return []
    return used[0, 2:].tolist() if len(used) == 1 and not used[0, :2].any() else None
