"""GaitSimulation: what an engine simulates, and for whom."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, Self

from tetra_drake.robot.command import Command, commanded_robot
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.robot import Robot, SteeringSignal
from tetra_drake.scenario.scenario import Scenario

if TYPE_CHECKING:
    import xarray

Driver = Gait | Command
"""What drives the actuators."""

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

    @classmethod
    def of(
        cls,
        scenario: Scenario,
        driver: Driver,
        *,
        record: bool = False,
        viewer: Viewer | None = None,
        steering: SteeringSignal | None = None,
    ) -> Self:
        """The simulation of a gait or a command. Raises InputError if it does not fit."""
        if isinstance(driver, Command):
            robot, gait = commanded_robot(scenario, driver), driver.gait
        else:
            robot, gait = Robot.of(scenario), driver
        return cls(robot, gait, record=record, viewer=viewer, steering=steering)
