"""Metrics of a simulation in SI units, and the thesis's fitness (Eq. 10), in inches."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tetra_drake.results.path import CentrePath, curvature
from tetra_drake.robot.structure import BOTTOM_LEFT, BOTTOM_RIGHT, TIP, Structure
from tetra_drake.scenario.schema import FitnessScenario
from tetra_drake.scenario.units import INCH

FITNESS_TERMS = {
    "distance": "steady_distance",
    "twist": "twist",
    "direction": "lead",
    "drift": "lateral_drift",
}
"""The metric that each constant of the scenario's fitness section multiplies, in inches."""

STRAIGHT = 0.01
"""Curvature (1/m) below which a path counts as straight: over the thesis's fifteen inches, it bends
by a fifth of a millimetre."""


def _metric(unit: str) -> Any:
    """A field of Metrics in the SI unit `unit`."""
    return field(metadata={"unit": unit})


@dataclass(frozen=True)
class Metrics:
    """How far and how straight the robot walked, each in the SI unit of its field's metadata.

    x1 and y1 are those of T1's bottom left node, x2 is that of its bottom right node, x3 that of
    the lead tetrahedron's tip.
    """

    distance: float = _metric("m")
    """x1 at the end less x1 at the start."""
    steady_distance: float = _metric("m")
    """dx1: x1 at the end less x1 at the start of the steady stretch."""
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
    """Curvature of the path of the centre in the steady stretch, positive to the left of the
    direction in which it moves, be that backward; 0 if it is straight. See results.path."""

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
        lengths = [f.name for f in dataclasses.fields(self) if f.metadata["unit"] == "m"]
        return {f"{name}_in": getattr(self, name) / INCH for name in lengths}


def compute_metrics(
    structure: Structure,
    *,
    start: np.ndarray,
    steady: np.ndarray,
    end: np.ndarray,
    path: CentrePath,
    steady_from: float,
) -> Metrics:
    """The metrics from node positions p_WN (nodes, 3) in m at three instants, and from the path of
    the centre; the steady stretch begins at `steady_from` (s)."""
    tip = 4 * (len(structure.bodies) - 1) + TIP
    steady_path = path.centre[np.searchsorted(path.times, steady_from) :, :2]
    x1, x2, x3 = end[BOTTOM_LEFT, 0], end[BOTTOM_RIGHT, 0], end[tip, 0]
    return Metrics(
        distance=float(x1 - start[BOTTOM_LEFT, 0]),
        steady_distance=float(x1 - steady[BOTTOM_LEFT, 0]),
        twist=float(abs(x1 - x2)),
        lead=float(x3 - x1),
        lateral_drift=float(abs(end[BOTTOM_LEFT, 1] - start[BOTTOM_LEFT, 1])),
        heading_change=float(path.heading[-1] - path.heading[0]),
        path_curvature=curvature(steady_path),
    )


def compute_fitness(metrics: Metrics | Mapping[str, float], phi: FitnessScenario) -> float:
    """Eq. 10: phi1 dx1 + phi2 abs(x1 - x2) + phi3 (x3 - x1) + phi4 abs(y1), lengths in inches."""
    values = vars(metrics) if isinstance(metrics, Metrics) else metrics
    return sum(
        getattr(phi, term) * (values[metric] / INCH) for term, metric in FITNESS_TERMS.items()
    )
