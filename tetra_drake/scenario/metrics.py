"""Metrics of a simulation: each with its unit, a note, and its computation."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from tetra_drake.files import json_number
from tetra_drake.formatting import TextTable
from tetra_drake.laws.actuator import LIMITS
from tetra_drake.laws.curves import curvature, travelling_index
from tetra_drake.settings.units import INCH, INCHES, Units, current

if TYPE_CHECKING:
    from tetra_drake.laws.tally import Tally

STRAIGHT = 0.01
"""Curvature (1/m) below which a path counts as straight: over the thesis's fifteen inches, it bends
by a fifth of a millimetre."""

LEAST_WAY = 1e-3
"""Least way (m) of a robot in the computation of its cost of transport."""
ROW = "row of tetrahedra"
"""Properties of robots that some metrics need."""


@dataclass(frozen=True, kw_only=True)
class Poses:
    """Positions of a robot for the computation of metrics, in SI units.

    Positions (3, 3) are in the world frame, with a row for each time: 0, `simulation.steady_from`
    and the end.
    """

    markers: np.ndarray
    """Positions (3, markers, 3) of the points whose motion is shown; see Blueprint.markers. The
    first is T1's bottom left node, or the centre of mass."""
    centre: np.ndarray
    """Positions (3, 3) of the centre of mass."""
    tip: np.ndarray
    """Positions (3, 3) of the foremost node."""
    since_steady_from: float
    """Time from `simulation.steady_from` to the end."""

    @property
    def followed(self) -> np.ndarray:
        """Positions (3, 3) of the first marker."""
        return self.markers[:, 0]

    @property
    def followed_way(self) -> np.ndarray:
        """Displacement (3,) of the followed point from 0 to the end."""
        return np.asarray(self.followed[2] - self.followed[0])

    @property
    def steady_centre_way(self) -> np.ndarray:
        """Displacement (3,) of the centre from `simulation.steady_from` to the end."""
        return np.asarray(self.centre[2] - self.centre[1])


@dataclass(frozen=True, kw_only=True)
class Walk(Poses):
    """Numbers of a simulation for the computation of metrics, in SI units."""

    path: np.ndarray
    """Path (k, 2) of the centre of mass in the plane from `simulation.steady_from` on."""
    heading: np.ndarray
    """Heading (k,) of the robot during the whole simulation; see robot.path."""
    signals: np.ndarray
    """Signals (k, m) at evenly spaced times from `simulation.steady_from` on."""
    scale: float
    """See Blueprint.scale."""
    weight: float
    actuators: int
    """Number of driven cables."""
    tally: Tally
    """Tally of the whole simulation, as plain arrays."""

    @property
    def per_steady_time(self) -> float:
        """1 / duration of the steady stretch."""
        steady_time = max(0.0, self.tally.time[0] - self.tally.begins[0])
        return 1.0 / float(steady_time or 1)

    def mean(self, effort: str) -> float:
        """A total of laws.tally.Effort as mean over the steady stretch and the actuators."""
        per_actuator_time = self.per_steady_time / max(self.actuators, 1)
        return per_actuator_time * float(getattr(self.tally.effort, effort)[0])

    @property
    def lifted_shares(self) -> tuple[float, ...]:
        """Share of the steady stretch during which each body is off the ground."""
        return tuple((self.per_steady_time * self.tally.lifted.time).tolist())


@dataclass(frozen=True)
class Metric:
    """Declaration of a metric: its unit, its computation, and its use."""

    unit: str
    """SI unit; "" for none."""
    note: str
    """Short explanation for tables."""
    compute: Callable[[Any], float]
    """Function of a Walk."""
    least: bool = False
    """True if the least value of several simulations is recorded, not their mean."""
    most: bool = False
    """True if the greatest value of several simulations is recorded."""
    is_cost: bool = False
    """True if less is better. A requirement is then an upper limit."""
    is_share: bool = False
    """True for a share of time. It is shown in percent."""
    of_pose: bool = False
    """True if Poses are enough for it."""
    needs: str = ""
    """Property (ROW or LIMITS) that a robot must have for this metric; "" for no condition."""


def _metric(unit: str, note: str, compute: Callable[[Walk], float], **more: Any) -> Any:
    """A field of Metrics, with its declaration as metadata."""
    return field(metadata={"metric": Metric(unit, note, compute, **more)})


def _cost_of_transport(walk: Walk) -> float:
    x, y, _ = walk.steady_centre_way.tolist()
    carried = walk.weight * max(math.hypot(x, y), LEAST_WAY * walk.scale)
    return float(walk.tally.effort.work[0]) / carried if carried else math.inf


def _signal_rate(walk: Walk) -> float:
    mean_square = walk.per_steady_time * float(walk.tally.roughness.total[0])
    return math.sqrt(mean_square / max(walk.signals.shape[1], 1))


@dataclass(frozen=True)
class Metrics:
    """Metrics of a simulation, in SI units.

    T1's bottom left node is at x₁ and y₁, its bottom right node at x₂. The tip of the front
    tetrahedron is at x₃. For robots other than rows of tetrahedra, x₁ and y₁ belong to the centre.
    The centre is the centre of mass. The steady stretch begins at `simulation.steady_from`, or at
    `cpg.start_up` if it is later, and lasts to the end. A metric that does not apply to a robot is
    NaN.
    """

    __pydantic_config__: ClassVar = {"use_attribute_docstrings": True}  # for the page of keys

    distance: float = _metric("m", "along x", lambda walk: walk.followed_way[0], of_pose=True)
    """Displacement of x₁ from the start to the end."""
    steady_distance: float = _metric(
        "m",
        "without the start",
        lambda walk: walk.followed[2, 0] - walk.followed[1, 0],
        of_pose=True,
    )
    """Distance from `simulation.steady_from` on: Δx₁ of Eq. 10."""
    speed: float = _metric(
        "m/s",
        "of the centre",
        lambda walk: walk.steady_centre_way[0] / walk.since_steady_from,
        of_pose=True,
    )
    """Mean speed of the centre along x from `simulation.steady_from` on."""
    twist: float = _metric(
        "m",
        "one rear foot ahead of the other",
        lambda walk: abs(walk.markers[2, 0, 0] - walk.markers[2, 1, 0]),
        of_pose=True,
        needs=ROW,
        is_cost=True,
    )
    """Distance along x between the two rear feet at the end: abs(x₁ - x₂)."""
    lead: float = _metric(
        "m",
        "front tip ahead of rear foot",
        lambda walk: walk.tip[2, 0] - walk.followed[2, 0],
        of_pose=True,
        needs=ROW,
    )
    """Distance along x from the rear foot to the front tip at the end: x₃ - x₁."""
    lateral_drift: float = _metric(
        "m", "sideways", lambda walk: abs(walk.followed_way[1]), of_pose=True, is_cost=True
    )
    """Sideways displacement, abs(y₁), at the end."""
    heading_change: float = _metric(
        "rad", "left positive", lambda walk: walk.heading[-1] - walk.heading[0], needs=ROW
    )
    """Angle by which the robot has turned to the left at the end. Whole turns count. See
    robot.path."""
    rolled: float = _metric("rad", "forward positive", lambda walk: walk.tally.rolled.angle[0])
    """Angle by which the robot has rolled forward, about the world's y axis, at the end. Whole
    turns count. It is the integral of the angular velocity of the rigid motion that fits the nodes'
    velocities best, so a change of shape alone does not count."""
    path_curvature: float = _metric(
        "1/m", "1 / radius, left positive", lambda walk: curvature(walk.path, scale=walk.scale)
    )
    """Curvature of the centre's path from `simulation.steady_from` on; 0 if straight. Positive if
    the path bends left as seen along the motion, even if the robot walks backward."""
    actuator_work: float = _metric(
        "J", "of all actuators", lambda walk: walk.tally.effort.work[0], is_cost=True
    )
    """Work of the actuators in the steady stretch, if they cannot recover energy: the integral of
    max(0, -S dl/dt) for driven cables with signal S and length l."""
    cost_of_transport: float = _metric(
        "", "work / (weight x distance)", _cost_of_transport, is_cost=True
    )
    """Actuator work divided by weight and by the centre's displacement over the ground, in the
    steady stretch. The displacement counts as at least 1 mm. Infinite without gravity."""
    signal_rate: float = _metric("N/s", "how fast signals change", _signal_rate, is_cost=True)
    """Root mean square of dS/dt over all signals S in the steady stretch. Smaller is smoother."""
    lifted: float = _metric(
        "",
        "time off the ground",
        lambda walk: sum(walk.lifted_shares) / len(walk.lifted_shares),
        is_share=True,
    )
    """Share of the steady stretch during which a body is off the ground, mean over the bodies. A
    body is off the ground if no contact node of it bears a normal force. In MuJoCo this metric says
    little."""
    clearance: float = _metric(
        "m", "smallest gap of struts' axes", lambda walk: walk.tally.clearance[0], least=True
    )
    """Least distance, at any time, between the axes of struts of two bodies. Struts overlap if it
    is less than their diameter: the model does not prevent this."""
    tension: float = _metric(
        "N", "smallest of any cable", lambda walk: walk.tally.tension.of_all[0], least=True
    )
    """Least tension of any cable at any time. Below 0 the cable would have to push."""
    travelling_index: float = _metric(
        "", "0: standing wave, 1: travelling", lambda walk: travelling_index(walk.signals)
    )
    """Travelling index of the signals in the steady stretch: 0 for a standing wave along the robot,
    1 for a travelling wave."""
    peak_actuator_force: float = _metric(
        "N",
        "at any time; a cable can pull a winch backward",
        lambda walk: walk.tally.effort.peak_force[0],
        most=True,
        is_cost=True,
    )
    """Greatest tension of a driven cable at any time. It exceeds the `max_force` of a winch while
    the robot stretches the cable faster than the stalled winch pays out."""
    mean_actuator_force: float = _metric(
        "N", "of all driven cables", lambda walk: walk.mean("impulse"), is_cost=True
    )
    """Mean tension of the driven cables in the steady stretch."""
    peak_actuator_speed: float = _metric(
        "m/s", "at any time", lambda walk: walk.tally.effort.peak_speed[0], most=True, is_cost=True
    )
    """Greatest speed of an actuator at any time, winding or paying out: the rate of the free length
    for a winch, otherwise of the cable's length."""
    mean_actuator_speed: float = _metric(
        "m/s", "winding or paying out", lambda walk: walk.mean("wound"), is_cost=True
    )
    """Mean speed in the steady stretch, winding or paying out."""
    peak_actuator_power: float = _metric(
        "W", "at any time", lambda walk: walk.tally.effort.peak_power[0], most=True, is_cost=True
    )
    """Greatest product of an actuator's tension and winding speed, at any time."""
    mean_actuator_power: float = _metric(
        "W", "effort of an actuator", lambda walk: walk.mean("pulled"), most=True, is_cost=True
    )
    """Mean positive power of an actuator in the steady stretch: the effort of a gait."""
    actuator_limited: float = _metric(
        "",
        "time at a limit of an actuator",
        lambda walk: walk.mean("limited"),
        most=True,
        is_cost=True,
        is_share=True,
        needs=LIMITS,
    )
    """Share of the steady stretch during which a limit of an actuator binds, mean over the
    actuators."""
    lifted_shares: tuple[float, ...] = ()
    """Share of the steady stretch during which each body is off the ground, from T1 on."""
    units: Units = field(default=INCHES, repr=False, compare=False)
    """Units of the printed metrics; see also units.shown_in()."""

    @classmethod
    def of(cls, walk: Walk, *, lacking: Collection[str], units: Units) -> Self:
        """Computes all metrics. A metric is NaN if it needs a property that the robot is
        `lacking`. They are printed in `units`."""
        numbers = {
            name: math.nan if metric.needs in lacking else float(metric.compute(walk))
            for name, metric in METRICS.items()
        }
        return cls(**numbers, lifted_shares=walk.lifted_shares, units=units)

    @property
    def table(self) -> TextTable:
        """Table of the metrics that apply to the robot, with units, in two pairs of columns."""
        rows, units = [], current(self.units)
        for name, unit in UNITS.items():
            value = round(getattr(self, name), 9) + 0.0  # neither -0 nor rounding errors
            if not math.isnan(value):
                rows.append([name, units.shown(value, unit)])
        half = (len(rows) + 1) // 2
        pairs = itertools.zip_longest(rows[:half], rows[half:], fillvalue=["", ""])
        side_by_side = [left + right for left, right in pairs]
        return TextTable(["metric", "value"] * 2, side_by_side, text_columns=range(4))

    def __str__(self) -> str:
        return self.table.text()

    def _repr_html_(self) -> str:
        return self.table.html()

    @property
    def distance_in(self) -> float:
        """Distance in inches, as in the thesis."""
        return self.distance / INCH

    @property
    def path_radius(self) -> float:
        """Radius in m of the path of the centre in the steady stretch; inf if it is straight."""
        bend = abs(self.path_curvature)
        return 1.0 / bend if bend > STRAIGHT else math.inf

    def to_json(self) -> dict[str, Any]:
        """Metrics by name for JSON. A number that is not finite is None."""
        numbers = {name: json_number(getattr(self, name)) for name in METRICS}
        return numbers | {"lifted_shares": list(self.lifted_shares)}


METRICS: dict[str, Metric] = {
    field.name: field.metadata["metric"] for field in dataclasses.fields(Metrics) if field.metadata
}
"""Declaration of each metric that is a number, by name."""

UNITS = {name: metric.unit for name, metric in METRICS.items()}


def wrong_metric(metrics: Mapping[str, Any]) -> str:
    """Name of the first of some metrics in the form of Metrics.to_json() that is of another type
    there; "" if there is none."""
    for name, value in metrics.items():
        numbers = value if name == "lifted_shares" else [value]
        kinds = float if name == "lifted_shares" else float | None
        if not isinstance(numbers, list) or not all(isinstance(item, kinds) for item in numbers):
            return name
    return ""


def inverse(unit: str) -> str:
    """Inverse of an SI unit, such as "s/m" for "m/s"; "" for no unit."""
    above, _, below = unit.partition("/")
    if not unit or above == "1":
        return below
    return f"{below or 1}/{above}"


_WALKED = ("distance", "steady_distance", "speed")
"""Metrics that reward long distances."""


def looks_for_distance(objective: Mapping[str, float]) -> bool:
    """True if an objective rewards long distances."""
    return any(objective.get(name, 0.0) > 0.0 for name in _WALKED)


def looks_for_turns(objective: Mapping[str, float]) -> bool:
    """True if an objective is about turning, not about distances."""
    return "heading_change" in objective and not looks_for_distance(objective)
