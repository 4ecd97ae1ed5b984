"""What a figure is drawn from."""

from typing import Any, cast

import xarray

from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.robot import Robot


def result_of(
    robot: Robot, trajectory: xarray.Dataset, *, name: str = "a gait"
) -> SimulationResult:
    """A result of which nothing but the motion is known."""
    unknown = cast(Any, None)
    return SimulationResult(
        scenario=robot.scenario,
        robot=robot,
        name=name,
        gait=None,
        metrics=unknown,
        fitness=0.0,
        duration=float(trajectory.time[-1]),
        wall_time=1.0,
        integrator=unknown,
        engine="none",
        path=unknown,
        recorded=trajectory.assign_attrs(title=name),
    )
