"""The metrics of a simulation: their names, SI units and definitions."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from tetra_drake.files import json_number
from tetra_drake.formatting import Table
from tetra_drake.scenario.units import INCH, customary, shown

STRAIGHT = 0.01
"""Curvature (1/m) below which a path counts as straight: over the thesis's fifteen inches, it bends
by a fifth of a millimetre."""

LEAST_WAY = 1e-3
"""m: a robot that goes less far counts as gone so far in its cost of transport."""


def _metric(unit: str, *, least: bool = False, most: bool = False, of_a_row: bool = False) -> Any:
    """A field of Metrics in the SI unit `unit`, "" for none.

    least: True if of several simulations the least value is recorded, in place of the mean.
    most: True if it is the greatest value, and a requirement is an upper limit.
    of_a_row: True if only the row of tetrahedra has the metric.
    """
    return field(metadata={"unit": unit, "least": least, "most": most, "of_a_row": of_a_row})


@dataclass(frozen=True)
class Metrics:
    """Metrics of a simulation, each number in the SI unit of its field's metadata.

    x₁ and y₁ are those of T1's bottom left node, or of the centre of a robot that is no row. x₂ is
    that of T1's bottom right node, x₃ that of the lead tetrahedron's tip. The steady stretch is
    from `simulation.steady_from`, or from `cpg.start_up` where that is later, to the end. The
    centre is that of mass. What a robot lacks is NaN. Values come from results.metrics.
    """

    distance: float = _metric("m")
    """Way along x, of x₁."""
    steady_distance: float = _metric("m")
    """Distance from `simulation.steady_from` on: Δx₁ of Eq. 10."""
    speed: float = _metric("m/s")
    """Mean speed of the centre along x from `simulation.steady_from` on."""
    twist: float = _metric("m", of_a_row=True)
    """abs(x₁ - x₂) at the end."""
    lead: float = _metric("m", of_a_row=True)
    """x₃ - x₁ at the end."""
    lateral_drift: float = _metric("m")
    """Sideways way, abs(y₁)."""
    heading_change: float = _metric("rad", of_a_row=True)
    """Angle by which the robot has turned to the left at the end. Whole turns count. See
    robot.path."""
    path_curvature: float = _metric("1/m")
    """Curvature of the centre's path from `simulation.steady_from` on; 0 if straight. Positive to
    the left of the direction in which the centre moves, be that backward. See robot.path."""
    actuator_work: float = _metric("J")
    """Integral of max(0, -S dl/dt) in the steady stretch, for driven cables with signal S and
    length l: the work of actuators that cannot take any back."""
    cost_of_transport: float = _metric("")
    """Actuator work / (weight times the centre's way over the ground) in the steady stretch. The
    way is LEAST_WAY at least. Infinite without gravity."""
    signal_rate: float = _metric("N/s")
    """Root mean square of dS/dt in the steady stretch, over all oscillators' signals S: the less,
    the smoother the drive."""
    lifted: float = _metric("")
    """Share of the steady stretch in which a body is off the ground, mean of all. Off the ground
    is one none of whose contact nodes bears a normal force. It says little in MuJoCo."""
    clearance: float = _metric("m", least=True)
    """Least distance, at any time, between the axes of struts of two bodies. Less than a
    strut's diameter is overlap: nothing in the model keeps struts apart."""
    tension: float = _metric("N", least=True)
    """Least tension of any cable at any time. Below 0 the cable would have to push."""
    travelling_index: float = _metric("")
    """0 if the signals stand along the robot, 1 if they travel, in the steady stretch. See
    results.measures."""
    peak_actuator_force: float = _metric("N", most=True)
    """Greatest tension of a driven cable at any time."""
    mean_actuator_force: float = _metric("N")
    """Mean tension of the driven cables in the steady stretch."""
    peak_actuator_speed: float = _metric("m/s", most=True)
    """Greatest speed of an actuator at any time, winding or paying out: a winch its free length,
    another one its cable."""
    mean_actuator_speed: float = _metric("m/s")
    """Mean speed in the steady stretch, winding or paying out."""
    peak_actuator_power: float = _metric("W", most=True)
    """Greatest product of an actuator's tension and winding speed, at any time."""
    mean_actuator_power: float = _metric("W", most=True)
    """Mean positive power of an actuator in the steady stretch: the effort of a gait."""
    actuator_limited: float = _metric("", most=True)
    """Share of the steady stretch in which a limit binds, mean of all winches or tension motors."""
    lifted_shares: tuple[float, ...] = ()
    """The share of `lifted` of each body, from T1 on."""

    def __str__(self) -> str:
        """A table of the metrics that the robot has, in SI and in the units that people read."""
        rows = []
        for name, unit in METRICS.items():
            value = round(getattr(self, name), 9) + 0.0  # neither -0 nor rounding errors
            if not math.isnan(value):
                read = shown(value, unit) if customary(unit)[1] != unit else ""
                rows.append([name, f"{value:.4g} {unit}".rstrip(), read])
        half = (len(rows) + 1) // 2
        pairs = itertools.zip_longest(rows[:half], rows[half:], fillvalue=[""] * 3)
        headings = ["metric", "SI", "in, lbf, deg"]
        side_by_side = [left + right for left, right in pairs]
        return Table(headings * 2, side_by_side, text_columns=range(6)).text()

    @property
    def distance_in(self) -> float:
        """The distance in inches, as the thesis gives it."""
        return self.distance / INCH

    @property
    def path_radius(self) -> float:
        """Radius in m of the path of the centre in the steady stretch; inf if it is straight."""
        bend = abs(self.path_curvature)
        return 1.0 / bend if bend > STRAIGHT else math.inf

    def to_json(self) -> dict[str, Any]:
        """The metrics by name, as JSON holds them: None for one that is not finite."""
        numbers = {name: json_number(getattr(self, name)) for name in METRICS}
        return numbers | {"lifted_shares": list(self.lifted_shares)}


_FIELDS = [field for field in dataclasses.fields(Metrics) if field.metadata]

METRICS: dict[str, str] = {field.name: field.metadata["unit"] for field in _FIELDS}
"""The SI unit of each metric that is a number, by name."""

METRICS_OF_A_ROW = tuple(field.name for field in _FIELDS if field.metadata["of_a_row"])
"""Metrics that only the row of tetrahedra has."""

LEAST = tuple(field.name for field in _FIELDS if field.metadata["least"])
"""Metrics of which the least of several simulations is recorded, in place of their mean."""

MOST = tuple(field.name for field in _FIELDS if field.metadata["most"])
"""Metrics of which the greatest is recorded; their requirements are upper limits."""


def inverse(unit: str) -> str:
    """The inverse of an SI unit, such as "s/m" of "m/s"; "" for none."""
    above, _, below = unit.partition("/")
    if not unit or above == "1":
        return below
    return f"{below or 1}/{above}"


_WALKED = ("distance", "steady_distance", "speed")
"""Metrics of which an objective that looks for far walks has one."""


def looks_for_distance(objective: Mapping[str, float]) -> bool:
    """True for an objective that rewards far walks."""
    return any(objective.get(name, 0.0) > 0.0 for name in _WALKED)
