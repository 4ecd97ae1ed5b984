"""GaitSimulation: what an engine simulates, and for whom."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, Self

import numpy as np

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

    @property
    def marks(self) -> np.ndarray:
        """Times (s) at which a step must end, ascending: start, start-up, `simulation.steady_from`,
        end, and where a change of the command begins or ends."""
        settings, cpg = self.robot.scenario.simulation, self.robot.scenario.cpg
        ends = cpg.listing_step * np.add.outer([0, 1], self._changes).ravel()
        instants = np.append([0.0, settings.settling_time, cpg.start_up], ends)
        marks = np.unique(instants.round(MARK_DECIMALS))
        before = marks[marks < settings.duration - 0.5 * 10.0**-MARK_DECIMALS]
        return np.append(before, settings.duration)

    @property
    def changes(self) -> dict[float, np.ndarray]:
        """Signals (m,) in N after each change of the command, by the time (s) at which it begins:
        one of the marks."""
        begins = self.robot.scenario.cpg.listing_step * self._changes
        after = self.robot.commanded[self._changes + 1]
        return dict(zip(begins.round(MARK_DECIMALS).tolist(), after, strict=True))

    @property
    def _changes(self) -> np.ndarray:
        """Indices of the samples of the command that differ from the next."""
        return np.flatnonzero((np.diff(self.robot.commanded, axis=0) != 0.0).any(axis=1))

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
