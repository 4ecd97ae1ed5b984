"""What a simulation is worth: the thesis's metrics and fitness (Eq. 10), in inches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tetra_drake.robot.structure import BOTTOM_LEFT, BOTTOM_RIGHT, TIP, Structure
from tetra_drake.scenario.schema import FitnessScenario
from tetra_drake.scenario.units import INCH


@dataclass(frozen=True)
class Metrics:
    """How far and how straight the robot went. Lengths in inches."""

    distance_in: float
    """Way along x of x1, the bottom left node of T1, from start to end."""
    steady_distance_in: float
    """dx1: the same from the start of the steady stretch on."""
    heading_error_in: float
    """abs(x1 - x2) at the end, x2 being the bottom right node of T1."""
    direction_in: float
    """x3 - x1 at the end, x3 being the tip of the lead tetrahedron."""
    lateral_drift_in: float
    """abs(y1): sideways displacement of the bottom left node of T1 at the end."""


def compute_metrics(
    structure: Structure, *, start: np.ndarray, steady: np.ndarray, end: np.ndarray
) -> Metrics:
    """The metrics from node positions p_WN (nodes, 3) in m at three instants."""
    tip = 4 * (len(structure.bodies) - 1) + TIP
    x1, x2, x3 = end[BOTTOM_LEFT, 0], end[BOTTOM_RIGHT, 0], end[tip, 0]
    return Metrics(
        distance_in=float(x1 - start[BOTTOM_LEFT, 0]) / INCH,
        steady_distance_in=float(x1 - steady[BOTTOM_LEFT, 0]) / INCH,
        heading_error_in=float(abs(x1 - x2)) / INCH,
        direction_in=float(x3 - x1) / INCH,
        lateral_drift_in=float(abs(end[BOTTOM_LEFT, 1] - start[BOTTOM_LEFT, 1])) / INCH,
    )


def compute_fitness(metrics: Metrics, phi: FitnessScenario) -> float:
    """Eq. 10: phi1 dx1 + phi2 abs(x1 - x2) + phi3 (x3 - x1) + phi4 abs(y1)."""
    return (
        phi.distance * metrics.steady_distance_in
        + phi.twist * metrics.heading_error_in
        + phi.direction * metrics.direction_in
        + phi.drift * metrics.lateral_drift_in
    )
