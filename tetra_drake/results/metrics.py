"""The metrics of a simulation, and the fitness that a scenario's objective makes of them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from tetra_drake.results.path import CentrePath, curvature
from tetra_drake.robot.structure import BOTTOM_LEFT, BOTTOM_RIGHT, TIP, Structure
from tetra_drake.scenario.metrics import METRICS, Metrics
from tetra_drake.scenario.units import INCH, shown


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
    way = end.mean(axis=0) - steady.mean(axis=0)  # of the centre
    x1, x2, x3 = end[BOTTOM_LEFT, 0], end[BOTTOM_RIGHT, 0], end[tip, 0]
    return Metrics(
        distance=float(x1 - start[BOTTOM_LEFT, 0]),
        steady_distance=float(x1 - steady[BOTTOM_LEFT, 0]),
        speed=float(way[0] / (path.times[-1] - steady_from)),
        twist=float(abs(x1 - x2)),
        lead=float(x3 - x1),
        lateral_drift=float(abs(end[BOTTOM_LEFT, 1] - start[BOTTOM_LEFT, 1])),
        heading_change=float(path.heading[-1] - path.heading[0]),
        path_curvature=curvature(steady_path),
    )


def compute_fitness(metrics: Metrics, objective: Mapping[str, float]) -> float:
    """The sum of the metrics times an objective's weights, which are SI; Eq. 10 by default."""
    total = 0.0
    for name, weight in objective.items():
        # In inches, so that Eq. 10 has the thesis's constants, and its numbers their digits.
        unit = INCH if METRICS[name] == "m" else 1.0
        total += (weight * unit) * (getattr(metrics, name) / unit)
    return total


def unmet_requirements(metrics: Metrics, require: Mapping[str, float]) -> list[str]:
    """Of each metric that is less than its required SI value, or NaN: name, value and limit, as
    "clearance is 0.05 in, less than 0.125 in"."""
    found = {name: (getattr(metrics, name), least) for name, least in require.items()}
    return [
        f"{name} is {shown(value, METRICS[name])}, less than {shown(least, METRICS[name])}"
        for name, (value, least) in found.items()
        if not value >= least
    ]
