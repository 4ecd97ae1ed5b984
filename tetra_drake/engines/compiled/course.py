"""What goes into a lane of the compiled engine, a prepared gait, and what comes out, its course."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tetra_drake.engines.compiled.loop import DONE, STEP_TOO_SMALL, TOO_FAST, TOO_MANY_EVALUATIONS
from tetra_drake.errors import MAX_SPEED, Diverged, SimulationFailure, StepBudgetExceeded
from tetra_drake.physics.tally import Tally
from tetra_drake.results.result import IntegratorWork, SimulationResult, make_result, motion_times
from tetra_drake.results.trajectory import Motion
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.robot import Robot, SteeringSignal
from tetra_drake.scenario.engine_kinds import Compiled
from tetra_drake.scenario.schema import Scenario


@dataclass(frozen=True)
class PreparedGait:
    """A gait on a scenario, prepared for a lane."""

    robot: Robot
    gait: Gait
    record: bool
    steering: SteeringSignal | None
    """Steering signal, in place of the gait's turn."""
    times: np.ndarray
    """The times (s) of the samples to keep, those of motion_times()."""
    marks: np.ndarray
    """The times (s) at which steps end."""

    @classmethod
    def of(
        cls,
        robot: Robot,
        gait: Gait,
        *,
        record: bool,
        steering: SteeringSignal | None = None,
    ) -> PreparedGait:
        """Prepares a gait."""
        simulation, start_up = robot.scenario.simulation, robot.scenario.cpg.start_up
        ends = 0.0, simulation.steady_from, simulation.duration
        return cls(
            robot,
            gait,
            record,
            steering,
            times=motion_times(simulation, record=record),
            marks=np.unique([*ends, *([start_up] if start_up <= simulation.duration else [])]),
        )

    @property
    def kind(self) -> tuple[object, ...]:
        """Properties that simulations on one engine must share."""
        scenario, ground = self.robot.scenario, self.robot.ground
        drivers = tuple(self.robot.actuation.drivers.tolist())
        return (
            scenario.robot.tetrahedra,
            len(ground.contacts),
            scenario.cables.slack,
            drivers,
            self.live,
            ground.flat,
            ground.friction.kind,
        )

    @property
    def live(self) -> bool:
        """True if the network is integrated with the robot."""
        return self.robot.scenario.cpg.signals == "live"

    @functools.cached_property
    def turns(self) -> np.ndarray:
        """The turns that Robot.turns() gives; raises InputError as it does."""
        return self.robot.turns(self.gait, self.steering)

    @property
    def recent_signals(self) -> int:
        """Number of signal samples that an engine holds: those within a step, and as many
        for lanes that run ahead; a power of two."""
        scenario = self.robot.scenario
        within = scenario.settings_of(Compiled).max_step / scenario.cpg.listing_step
        return 1 << math.ceil(math.log2(2.0 * within + 32.0))

    @property
    def turn_samples(self) -> int:
        """Number of samples of the turn that an engine holds."""
        if self.steering is None:
            return 1
        scenario = self.robot.scenario
        return round(scenario.simulation.duration / scenario.cpg.listing_step) + 1


class Course(NamedTuple):
    """The course of a simulation."""

    status: int
    time: float
    """When it ended, in s."""
    steps: int
    evaluations: int
    motion: Motion
    totals: Tally
    wall_time: float
    """Wall time in s, shared with the other lanes of the same core."""


def make_outcome(prepared: PreparedGait, course: Course) -> SimulationResult:
    """The result of a simulation; raises Diverged or StepBudgetExceeded if it failed."""
    scenario = prepared.robot.scenario
    if course.status != DONE:
        raise _failure(course, scenario)
    tolerance = scenario.settings_of(Compiled).tolerance
    return make_result(
        prepared.robot,
        course.motion,
        totals=course.totals,
        work=IntegratorWork("ros2", tolerance, course.steps, course.evaluations),
        wall_time=course.wall_time,
        record=prepared.record,
    )


def _failure(course: Course, scenario: Scenario) -> SimulationFailure:
    settings = scenario.simulation
    reasons = {
        TOO_FAST: f"a body's velocity exceeds the limit of {MAX_SPEED:g} m/s",
        STEP_TOO_SMALL: "no step is small enough for the tolerance",
        TOO_MANY_EVALUATIONS: f"force evaluations exceed the budget of {settings.max_evaluations}",
    }
    kind = StepBudgetExceeded if course.status == TOO_MANY_EVALUATIONS else Diverged
    failure = kind(time=course.time, reason=reasons[course.status])
    failure.wall_time = course.wall_time
    return failure
