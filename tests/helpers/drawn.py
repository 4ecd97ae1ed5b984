"""What a figure is drawn from, and what it shows."""

from typing import Any, cast

import xarray
from matplotlib.axes import Axes
from matplotlib.figure import Figure

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
        recorded=trajectory,
    )


def panels(figure: Figure) -> list[Axes]:
    """The panels of a figure, row by row: its axes, or those into which they are split."""
    return [axes for axes in every_axes(figure) if axes.axison]


def every_axes(figure: Figure) -> list[Axes]:
    """The axes of a figure, and those into which they are split."""
    return [inner for axes in figure.axes for inner in _within(axes)]


def _within(axes: Axes) -> list[Axes]:
    if axes.axison:
        return [axes]
    return [axes, *(inner for child in axes.child_axes for inner in _within(child))]
