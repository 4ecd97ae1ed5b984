"""GaitSimulation: what an engine simulates, and for whom."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from tetra_drake.robot.gait import Gait
from tetra_drake.robot.robot import Robot, SteeringSignal

if TYPE_CHECKING:
    import xarray


MARK_DECIMALS = 9
"""Decimals of the times (s) at which a step must end. A step between two times that differ in
rounding would be too short."""


class Viewer(Protocol):
    """Observer that shows a simulation while it runs."""

    def wants(self, time: float) -> bool:
        """True if the viewer needs the state at this time (s)."""

    def show(self, frame: xarray.Dataset) -> None:
        """Shows one sample of a trajectory (see results.trajectory.make_dataset)."""


@dataclass(frozen=True, eq=False)
class GaitSimulation:
    """What an engine simulates: a robot that walks with a gait."""

    robot: Robot
    gait: Gait
    record: bool = False
    """True to record the trajectory."""
    viewer: Viewer | None = None
    """Only for an engine with `can_be_watched`."""
    steering: SteeringSignal | None = None
    """The turn, in place of the gait's."""
