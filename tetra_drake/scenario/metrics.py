"""Metrics of a simulation: each with its unit, a note, and its computation."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np

from tetra_drake.files import json_number
from tetra_drake.formatting import TextTable
from tetra_drake.laws.curves import curvature, travelling_index
from tetra_drake.laws.tally import Metric, TalliedMetrics, Tally, metric
from tetra_drake.scenario.robot_settings import ROW
from tetra_drake.settings.units import INCH, INCHES, Units, current

STRAIGHT = 0.01
"""Curvature (1/m) below which a path counts as straight. A path of fifteen inches, as in the
thesis, then deviates from a line by less than a fifth of a millimetre."""

LEAST_WAY = 1e-3
"""Least distance (m) for the cost of transport; a shorter one counts as this distance."""


@dataclass(frozen=True, kw_only=True)
class Poses:
    """Positions of a robot at three times, for the computation of metrics, in SI units.

    Positions (3, 3) are in the world frame, with a row for each time: 0, `simulation.steady_from`
    and the end.
    """

    markers: np.ndarray
    """Positions (3, markers, 3), by time, marker and axis, of the points whose motion is shown; see
    Blueprint.markers. The first is T1's bottom left node, or the centre of mass."""
    centre: np.ndarray
    """Positions (3, 3) of the centre of mass."""
    tip: np.ndarray
    """Positions (3, 3) of the foremost node."""
    since_steady_from: float
    """Time from `simulation.steady_from` to the end."""
    length: float
    """Length of the robot; see Blueprint.length."""

    @property
    def x1(self) -> np.ndarray:
        """Coordinates x (3,) of the first marker."""
        return self.markers[:, 0, 0]


@dataclass(frozen=True, kw_only=True)
class Walk(Poses):
    """Data of one simulation for the computation of metrics, in SI units."""

    path: np.ndarray
    """Path (k, 2) of the centre of mass in the plane from `simulation.steady_from` on."""
    heading: np.ndarray
    """Heading (k,) of the robot during the whole simulation; see robot.measures."""
    signals: np.ndarray
    """Signals (k, m) at evenly spaced times from `simulation.steady_from` on."""
    scale: float
    """Factor for lengths that grow with the robot; see Blueprint.scale."""
    weight: float
    actuators: int
    """Number of driven cables."""
    tally: Tally
    """Sums and extremes over all steps of the simulation, as plain arrays."""

    @property
    def per_steady_time(self) -> float:
        """Inverse (1/s) of the duration of the steady stretch, which is the simulation without its
        start; see Metrics."""
        steady_time = max(0.0, self.tally.time[0] - self.tally.begins[0])
        return 1.0 / float(steady_time or 1)

    @property
    def per_actuator_time(self) -> float:
        """Inverse (1/s) of the duration of the steady stretch (see Metrics), divided by the number
        of actuators. It turns an integral summed over actuators into a mean."""
        return self.per_steady_time / max(self.actuators, 1)

    @property
    def lifted_shares(self) -> tuple[float, ...]:
        """Share of the steady stretch (see Metrics) during which each body is off the ground."""
        return tuple((self.per_steady_time * self.tally.lifted).tolist())


def _mean_speed(walk: Poses) -> float:
    return float(walk.centre[2, 0] - walk.centre[1, 0]) / walk.since_steady_from


def _cost_of_transport(walk: Walk) -> float:
    x, y, _ = (walk.centre[2] - walk.centre[1]).tolist()
    carried = walk.weight * max(math.hypot(x, y), LEAST_WAY * walk.scale)
    return float(walk.tally.effort.work[0]) / carried if carried else math.inf


_of_poses = functools.partial(metric, of_pose=True)
"""Declaration of a metric that is a function of Poses."""


@dataclass(frozen=True)
class WalkMetrics:
    """Metrics of a walk: distances, turning, cost of transport and travelling index."""

    distance: float = _of_poses("m", "along x", lambda walk: walk.x1[2] - walk.x1[0])
    """Displacement of x₁ along x from the start to the end."""
    steady_distance: float = _of_poses(
        "m", "without the start", lambda walk: walk.x1[2] - walk.x1[1]
    )
    """Displacement of x₁ along x from `simulation.steady_from` to the end: Δx₁ of Eq. 10."""
    speed: float = _of_poses("m/s", "of the centre", _mean_speed)
    """Mean speed of the centre of mass along x from `simulation.steady_from` on."""
    relative_speed: float = _of_poses(
        "1/s",
        "body lengths per second",
        lambda walk: _mean_speed(walk) / walk.length if walk.length else math.nan,
    )
    """Speed divided by the robot's length, its largest extent along an axis at the start."""
    twist: float = _of_poses(
        "m",
        "one rear foot ahead of the other",
        lambda walk: abs(walk.x1[2] - walk.markers[2, 1, 0]),
        needs=ROW,
        is_cost=True,
    )
    """Distance along x between the rear feet at the end: abs(x₁ - x₂)."""
    lead: float = _of_poses(
        "m", "front tip ahead of rear foot", lambda walk: walk.tip[2, 0] - walk.x1[2], needs=ROW
    )
    """Distance along x from the rear foot to the front tip at the end: x₃ - x₁."""
    lateral_drift: float = _of_poses(
        "m",
        "sideways",
        lambda walk: abs(walk.markers[2, 0, 1] - walk.markers[0, 0, 1]),
        is_cost=True,
    )
    """Sideways displacement, abs(y₁), at the end."""
    heading_change: float = metric(
        "rad", "left positive", lambda walk: walk.heading[-1] - walk.heading[0], needs=ROW
    )
    """Angle by which the robot has turned to the left at the end, whole turns included."""
    path_curvature: float = metric(
        "1/m", "1 / radius, left positive", lambda walk: curvature(walk.path, scale=walk.scale)
    )
    """Curvature of the centre's path from `simulation.steady_from` on; positive if it bends left
    along the motion."""
    cost_of_transport: float = metric(
        "", "work / (weight x distance)", _cost_of_transport, is_cost=True
    )
    """Actuator work divided by weight and by the centre's displacement over the ground (at least 1
    mm), in the steady stretch. Infinite without gravity."""
    travelling_index: float = metric(
        "", "0: standing wave, 1: travelling", lambda walk: travelling_index(walk.signals)
    )
    """Travelling index of the signals in the steady stretch: 0 for a standing wave along the robot,
    1 for a travelling wave."""


@dataclass(frozen=True)
class Metrics(TalliedMetrics, WalkMetrics):
    """Metrics of a simulation, in SI units.

    T1's bottom left node is at x₁ and y₁, its bottom right node at x₂, the front tip at x₃. Robots
    other than rows of tetrahedra have x₁ and y₁ at the centre of mass, here called the centre. The
    steady stretch goes from `simulation.steady_from`, or `cpg.start_up` if it is later, to the end.
    A metric that does not apply to a robot is NaN.
    """

    lifted_shares: tuple[float, ...] = ()
    """Share of the steady stretch (see Metrics) during which each body is off the ground, from T1
    on."""
    units: Units = field(default=INCHES, repr=False, compare=False)
    """Units of the printed metrics; see also units.shown_in()."""

    @classmethod
    def of(cls, walk: Walk, *, lacking: Collection[str], units: Units) -> Self:
        """Computes all metrics of a simulation, for printing in `units`. `lacking` are properties
        that the robot does not have, such as "row of tetrahedra": metrics that need them are
        NaN."""
        numbers = {
            name: math.nan if metric.needs in lacking else float(metric.compute(walk))
            for name, metric in METRICS.items()
        }
        return cls(**numbers, lifted_shares=walk.lifted_shares, units=units)

    def __eq__(self, other: object) -> bool:
        """True if all numbers are equal; NaN equals NaN (dataclasses of Python 3.13 differ)."""
        if not isinstance(other, Metrics):
            return NotImplemented
        pairs = [(getattr(self, name), getattr(other, name)) for name in METRICS]
        are_equal = all(a == b or (math.isnan(a) and math.isnan(b)) for a, b in pairs)
        return are_equal and self.lifted_shares == other.lifted_shares

    @property
    def table(self) -> TextTable:
        """Table of the metrics that apply to the robot, with units. Its four columns are metric and
        value, twice side by side."""
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
        """Radius in m of the path of the centre in the steady stretch (see Metrics); inf from 100 m
        on, which counts as straight."""
        bend = abs(self.path_curvature)
        return 1.0 / bend if bend > STRAIGHT else math.inf

    def to_json(self) -> dict[str, Any]:
        """Metrics by name for JSON. A number that is not finite is None."""
        numbers = {name: json_number(getattr(self, name)) for name in METRICS}
        return numbers | {"lifted_shares": list(self.lifted_shares)}


METRICS: dict[str, Metric] = {
    field.name: field.metadata["metric"] for field in dataclasses.fields(Metrics) if field.metadata
}
"""Unit, note and computation of each metric that is a single number, by name."""

UNITS = {name: metric.unit for name, metric in METRICS.items()}


def wrong_metric(metrics: Mapping[str, Any]) -> str:
    """Name of the first metric whose value has a wrong type; "" if there is none. The values, read
    from JSON, are expected in the form of Metrics.to_json(): a float or None, for `lifted_shares` a
    list of floats."""
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


MetricRanges = Mapping[str, Sequence[float]]
"""Least and greatest value of each metric, by name, in SI units, if the start moves by 1 nm to 100
nm; see lab.spread. Empty if it is unknown."""

MOVED = "under starts moved by 1e-7 m"
"""Words for the range of a number in a MetricRanges."""

_WALKED = ("distance", "steady_distance", "speed", "relative_speed")
"""Metrics that reward long distances."""


def looks_for_distance(objective: Mapping[str, float]) -> bool:
    """True if an objective, weights by metric, has a positive weight for a distance or speed along
    x."""
    return any(objective.get(name, 0.0) > 0.0 for name in _WALKED)


def looks_for_turns(objective: Mapping[str, float]) -> bool:
    """True if an objective, weights by metric, is about turning and does not reward distances."""
    return "heading_change" in objective and not looks_for_distance(objective)


def has_rolled(metrics: Mapping[str, float]) -> bool:
    """True if a robot with these metrics (by name, in SI units) has rolled by half a turn or
    more."""
    return abs(metrics.get("rolled", 0.0)) >= math.pi


def compute_fitness(metrics: Metrics, objective: Mapping[str, float]) -> float:
    """Fitness: the sum of metrics times their weights. `objective` has weights by metric, in SI
    units. A weight may be negative."""
    total = 0.0
    for name, weight in objective.items():
        # Inches give Eq. 10 the constants of the thesis, and keep the digits of recorded numbers.
        unit = INCH if UNITS[name] == "m" else 1.0
        total += (weight * unit) * (getattr(metrics, name) / unit)
    return total


def headline_metric(objective: Mapping[str, float], metrics: Mapping[str, float]) -> str:
    """Name of the most important metric of a gait: "distance" if the objective rewards distances,
    otherwise the metric with the largest part (weight times value) in the fitness. Metrics with
    negative weights do not count if one has a positive weight. Both mappings are by metric, SI."""
    if looks_for_distance(objective):
        return "distance"
    rewarded = {name: weight for name, weight in objective.items() if weight > 0.0} or objective
    parts = {name: abs(weight * metrics[name]) for name, weight in rewarded.items()}
    return max(parts, key=lambda name: -1.0 if math.isnan(parts[name]) else parts[name])


def unmet_requirements(metrics: Metrics, require: Mapping[str, float]) -> list[str]:
    """Texts about the metrics that do not meet their limits in `require` (SI, by metric), such as
    "clearance is 0.05 in, less than 0.125 in". A limit is the greatest value for costs, the least
    value for other metrics. NaN meets no limit."""
    texts, shown = [], current(metrics.units).shown
    for name, limit in require.items():
        value, unit, is_cost = getattr(metrics, name), UNITS[name], METRICS[name].is_cost
        is_met = value <= limit if is_cost else value >= limit
        if not is_met:
            beyond = "more" if is_cost else "less"
            texts.append(f"{name} is {shown(value, unit)}, {beyond} than {shown(limit, unit)}")
    return texts
