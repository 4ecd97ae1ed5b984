"""Simulation of one gait on the compiled engine."""

from __future__ import annotations

from tetra_drake.engines.compiled.lane_engine import Course, LaneEngine, PreparedGait
from tetra_drake.engines.compiled.loop import (
    DONE,
    STEP_TOO_SMALL,
    TOO_FAST,
    TOO_MANY_EVALUATIONS,
)
from tetra_drake.engines.time_limit import check_time
from tetra_drake.errors import MAX_SPEED, Diverged, SimulationFailure, StepBudgetExceeded
from tetra_drake.results.result import IntegratorWork, SimulationResult, make_result
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.robot import Robot, SteeringSignal
from tetra_drake.scenario.engine_kinds import Compiled
from tetra_drake.scenario.schema import Scenario

_BODY_STEPS = 100_000
"""Iterations times bodies, some 70 ms, after which signals of the operating system are heard."""


def simulate_compiled(
    robot: Robot, gait: Gait, *, record: bool, steering: SteeringSignal | None = None
) -> SimulationResult:
    """Simulates a gait as simulate() does, without Drake. Other threads run meanwhile."""
    prepared = PreparedGait.of(robot, gait, record=record, steering=steering)
    engine = LaneEngine(prepared, width=1)
    engine.load(0, prepared)
    while not (ended := engine.advance(_BODY_STEPS)):
        check_time()
    _, prepared, course = ended[0]
    return make_outcome(prepared, course)


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
