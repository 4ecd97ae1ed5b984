"""Metrics of a simulation in SI units, and the thesis's fitness (Eq. 10), in inches."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

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


@dataclass(frozen=True)
class Metrics:
    """How far and how straight the robot walked; lengths in m.

    x1 and y1 are those of T1's bottom left node, x2 is that of its bottom right node, x3 that of
    the lead tetrahedron's tip.
    """

    distance: float
    """x1 at the end less x1 at the start."""
    steady_distance: float
    """dx1: x1 at the end less x1 at the start of the steady stretch."""
    twist: float
    """abs(x1 - x2) at the end: how far the rear base triangle has turned about the vertical."""
    lead: float
    """x3 - x1 at the end: how far the tip of the lead is ahead; negative if it points backward."""
    lateral_drift: float
    """abs(y1): sideways displacement at the end."""

    @property
    def distance_in(self) -> float:
        """The distance in inches, as the thesis gives it."""
        return self.distance / INCH

    def in_inches(self) -> dict[str, float]:
        """The metrics that are lengths, in inches: distance_in, steady_distance_in ..."""
        return {f"{name}_in": value / INCH for name, value in dataclasses.asdict(self).items()}


def compute_metrics(
    structure: Structure, *, start: np.ndarray, steady: np.ndarray, end: np.ndarray
) -> Metrics:
    """The metrics from node positions p_WN (nodes, 3) in m at three instants."""
    tip = 4 * (len(structure.bodies) - 1) + TIP
    x1, x2, x3 = end[BOTTOM_LEFT, 0], end[BOTTOM_RIGHT, 0], end[tip, 0]
    return Metrics(
        distance=float(x1 - start[BOTTOM_LEFT, 0]),
        steady_distance=float(x1 - steady[BOTTOM_LEFT, 0]),
        twist=float(abs(x1 - x2)),
        lead=float(x3 - x1),
        lateral_drift=float(abs(end[BOTTOM_LEFT, 1] - start[BOTTOM_LEFT, 1])),
    )


def compute_fitness(metrics: Metrics | Mapping[str, float], phi: FitnessScenario) -> float:
    """Eq. 10: phi1 dx1 + phi2 abs(x1 - x2) + phi3 (x3 - x1) + phi4 abs(y1), lengths in inches."""
    values = dataclasses.asdict(metrics) if isinstance(metrics, Metrics) else metrics
    return sum(
        getattr(phi, term) * (values[metric] / INCH) for term, metric in FITNESS_TERMS.items()
    )
