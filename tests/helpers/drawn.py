"""Results from which figures are drawn."""

from typing import Any

import xarray

from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.robot import Robot


def result_of(robot: Robot, trajectory: xarray.Dataset, *, name: str = "gait") -> SimulationResult:
    """A result with nothing but a motion."""
    unknown: dict[str, Any] = dict.fromkeys(("gait", "metrics", "integrator", "path"))
    return SimulationResult(
        scenario=robot.scenario,
        robot=robot,
        name=name,
        fitness=0.0,
        duration=float(trajectory.time[-1]),
        wall_time=1.0,
        engine="none",
        recorded=trajectory.assign_attrs(title=name),
        **unknown,
    )
