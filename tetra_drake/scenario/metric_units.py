"""The metrics of a simulation: their names, SI units and definitions."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from typing import Any

from tetra_drake.files import json_number
from tetra_drake.scenario.units import INCH

STRAIGHT = 0.01
"""Curvature (1/m) below which a path counts as straight: over the thesis's fifteen inches, it bends
by a fifth of a millimetre."""

LEAST_WAY = 1e-3
"""m: a robot that goes less far counts as gone so far in its cost of transport."""


def _metric(unit: str) -> Any:
    """A field of Metrics in the SI unit `unit`, "" for none."""
    return field(metadata={"unit": unit})


@dataclass(frozen=True)
class Metrics:
    """How a robot walked, each number in the SI unit of its field's metadata.

    x1 and y1 are those of T1's bottom left node, x2 is that of its bottom right node, x3 that of
    the lead tetrahedron's tip. The steady stretch is from `simulation.steady_from`, or from
    `cpg.start_up` where that is later, to the end. The centre is the mean of the bodies' origins.
    """

    distance: float = _metric("m")
    """x1 at the end less x1 at the start."""
    steady_distance: float = _metric("m")
    """dx1: x1 at the end less x1 at `simulation.steady_from`."""
    speed: float = _metric("m/s")
    """Mean speed of the centre along x from `simulation.steady_from` on."""
    twist: float = _metric("m")
    """abs(x1 - x2) at the end: how far the rear base triangle has turned about the vertical."""
    lead: float = _metric("m")
    """x3 - x1 at the end: how far the tip of the lead is ahead; negative if it points backward."""
    lateral_drift: float = _metric("m")
    """abs(y1): sideways displacement at the end."""
    heading_change: float = _metric("rad")
    """By how much the robot has turned to the left, from the start to the end; whole turns count.
    See results.path."""
    path_curvature: float = _metric("1/m")
    """Curvature of the path of the centre from `simulation.steady_from` on, positive to the left of
    the direction in which it moves, be that backward; 0 if it is straight. See results.path."""
    actuator_work: float = _metric("J")
    """The integral of max(0, -S dl/dt) over the steady stretch, summed over the driven cables, of
    length l and signal S: the work of actuators that cannot take any back."""
    cost_of_transport: float = _metric("")
    """actuator_work / (weight of the robot * way of the centre over the ground in the steady
    stretch); the way counts as LEAST_WAY at least. Infinite without gravity."""
    signal_rate: float = _metric("N/s")
    """Root mean square of dS/dt over the steady stretch and the oscillators' signals S: the less,
    the smoother the drive."""
    lifted: float = _metric("")
    """Share of the steady stretch in which no contact node of a tetrahedron bears a normal force:
    mean of the tetrahedra."""
    clearance: float = _metric("m")
    """Least distance between the axes of two struts of different tetrahedra, of all times. Struts
    overlap where it is less than their diameter: nothing in the model keeps them apart."""
    tension: float = _metric("N")
    """Least tension of a cable, of all times: a cable that would have to push is below 0."""
    travelling_index: float = _metric("")
    """How far the signals travel along the robot in the steady stretch: 0 if they stand, 1 if they
    travel. See results.measures."""
    lifted_shares: tuple[float, ...] = ()
    """The share of `lifted` of each tetrahedron, from T1 on."""

    @property
    def distance_in(self) -> float:
        """The distance in inches, as the thesis gives it."""
        return self.distance / INCH

    @property
    def path_radius(self) -> float:
        """Radius in m of the path of the centre in the steady stretch; inf if it is straight."""
        bend = abs(self.path_curvature)
        return 1.0 / bend if bend > STRAIGHT else math.inf

    def in_inches(self) -> dict[str, float]:
        """The metrics that are lengths, in inches: distance_in, steady_distance_in ..."""
        return {f"{n}_in": getattr(self, n) / INCH for n, unit in METRICS.items() if unit == "m"}

    def to_json(self) -> dict[str, Any]:
        """The metrics by name, as JSON holds them: None for an infinite one."""
        numbers = {name: json_number(getattr(self, name)) for name in METRICS}
        return numbers | {"lifted_shares": list(self.lifted_shares)}


METRICS: dict[str, str] = {
    f.name: f.metadata["unit"] for f in dataclasses.fields(Metrics) if f.metadata
}
"""The SI unit of each metric that is a number, by name."""


def inverse(unit: str) -> str:
    """The inverse of an SI unit, such as "s/m" of "m/s"; "" for none."""
    above, _, below = unit.partition("/")
    if not unit or above == "1":
        return below
    return f"{below or 1}/{above}"
