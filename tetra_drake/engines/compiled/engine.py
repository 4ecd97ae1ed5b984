"""From a gait to its result through the compiled engine."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tetra_drake.engines.compiled.dynamics import Forces, forces_at
from tetra_drake.engines.compiled.lane_engine import Course, LaneEngine, PreparedGait
from tetra_drake.engines.compiled.loop import (
    DONE,
    STEP_TOO_SMALL,
    TOO_FAST,
    TOO_MANY_EVALUATIONS,
)
from tetra_drake.engines.time_limit import check_time
from tetra_drake.errors import MAX_SPEED, Diverged, SimulationFailure, StepBudgetExceeded
from tetra_drake.physics.cable import LENGTH, PULL_COLUMNS, TENSION
from tetra_drake.physics.contact import STICK_POINT
from tetra_drake.physics.kinematics import NODE_COLUMNS
from tetra_drake.physics.terrain import FRAME_COLUMNS
from tetra_drake.results.result import IntegratorWork, SimulationResult, make_result
from tetra_drake.results.trajectory import assemble_dataset, sample_times
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.network import SteeringSignal
from tetra_drake.scenario.engine_kinds import Compiled
from tetra_drake.scenario.schema import Scenario

if TYPE_CHECKING:
    import xarray

_BODY_STEPS = 100_000
"""Iterations times bodies, some 70 ms, after which signals of the operating system are heard."""


def simulate_compiled(
    *, scenario: Scenario, gait: Gait, record: bool, steering: SteeringSignal | None = None
) -> SimulationResult:
    """Simulates a gait as simulate() does, without Drake. Other threads run meanwhile."""
    prepared = PreparedGait.of(scenario, gait, record=record, steering=steering)
    engine = LaneEngine(prepared, width=1)
    engine.load(0, prepared)
    while not (ended := engine.advance(_BODY_STEPS)):
        check_time()
    _, prepared, course = ended[0]
    return make_outcome(prepared, course)


def make_outcome(prepared: PreparedGait, course: Course) -> SimulationResult:
    """The result of a simulation; raises Diverged or StepBudgetExceeded if it failed."""
    scenario, structure = prepared.scenario, prepared.structure
    if course.status != DONE:
        raise _failure(course, scenario)
    trajectory = None
    if prepared.record:
        simulation = scenario.simulation
        times = sample_times(simulation.duration, simulation.sample_period)
        trajectory = _dataset(prepared, course, times)
    steps, evaluations = course.steps, course.evaluations
    tolerance = scenario.settings_of(Compiled).tolerance
    return make_result(
        scenario,
        structure,
        times=course.times,
        states=course.states,
        signals=course.signals,
        totals=course.totals,
        mass=float(prepared.model.body.mass[0]),
        wall_time=course.wall_time,
        integrator=IntegratorWork("ros2", tolerance, steps, evaluations),
        trajectory=trajectory,
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


def _dataset(prepared: PreparedGait, course: Course, times: np.ndarray) -> xarray.Dataset:
    """The recording at `times`, with the forces that the kernels find at its states."""
    chosen = np.searchsorted(course.times, times)
    states, modes, signals = course.states[chosen], course.modes[chosen], course.signals[chosen]
    count, model = len(times), prepared.model
    pulls = np.empty((count, len(model.cables), PULL_COLUMNS))
    contacts, nodes = len(model.ground.contacts), len(prepared.structure.node_names)
    pushes = np.empty((count, contacts, 3))
    moved, frames = np.empty((nodes, NODE_COLUMNS)), np.empty((contacts, FRAME_COLUMNS))
    generalized = np.empty(6 * len(prepared.structure.bodies))
    for i, state in enumerate(states):
        forces = Forces(moved, frames, pulls[i], pushes[i])
        forces_at(model, state, modes[i], signals[i], forces, generalized)
    return assemble_dataset(
        prepared.structure,
        times=times,
        states=states,
        signals=signals,
        tensions=pulls[:, :, TENSION],
        lengths=pulls[:, :, LENGTH],
        normal_forces=pushes[:, :, 2],
        friction_forces=pushes[:, :, :2],
        modes=modes[:, :, :STICK_POINT],
    )
