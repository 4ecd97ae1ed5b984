"""One gait through the compiled engine: what simulate() does when the scenario asks for it."""

from __future__ import annotations

import dataclasses
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from tetra_drake.engines.compiled.dynamics import compute_forces
from tetra_drake.engines.compiled.walk import (
    DONE,
    STEP_TOO_SMALL,
    TOO_FAST,
    TOO_MANY_EVALUATIONS,
    Actuation,
    Samples,
    Settings,
    walk,
)
from tetra_drake.errors import Diverged, SimulationFailure, StepBudgetExceeded
from tetra_drake.physics.contact import STICK_POINT
from tetra_drake.physics.kinematics import move_nodes
from tetra_drake.results.result import IntegratorWork, SimulationResult, make_result
from tetra_drake.results.trajectory import assemble_dataset, sample_times
from tetra_drake.robot.gait import Gait, seeded_gait
from tetra_drake.robot.model import Model, make_model
from tetra_drake.robot.signals import signal_samples
from tetra_drake.robot.structure import MakeStructure, Structure
from tetra_drake.scenario.schema import Scenario

if TYPE_CHECKING:
    import xarray


def simulate_compiled(*, scenario: Scenario, gait: Gait, record: bool) -> SimulationResult:
    """Simulates a gait as simulate() does, without Drake. Other threads run meanwhile."""
    compile_engine(scenario)
    simulation = scenario.simulation
    structure = MakeStructure(scenario.robot, scenario.cables)
    constants, start = kernel_constants(scenario, gait, structure), structure.initial_state
    ends = (0.0, simulation.steady_from, simulation.duration)
    times = sample_times(simulation.duration, simulation.sample_period)
    instants = np.unique([*ends, *(times if record else ())])
    marks = np.unique([t for t in (scenario.cpg.start_up, *ends) if t <= simulation.duration])
    started = time.perf_counter()
    status, ended, steps, evaluations, samples = walk(*constants, start, marks, instants)
    wall_time = time.perf_counter() - started
    if status != DONE:
        raise _failure(status, ended, scenario)

    trajectory = None
    if record:
        chosen = np.searchsorted(instants, times)
        kept = Samples(*(column[chosen] for column in samples))
        trajectory = _dataset(structure, constants[0], times, kept)
    return make_result(
        scenario,
        structure,
        states=samples.states[np.searchsorted(instants, ends)],
        wall_time=wall_time,
        integrator=IntegratorWork("ros2", scenario.compiled.tolerance, steps, evaluations),
        trajectory=trajectory,
    )


def kernel_constants(
    scenario: Scenario, gait: Gait, structure: Structure
) -> tuple[Model, Settings, Actuation]:
    """The first arguments of the kernel `walk`."""
    cpg, simulation = scenario.cpg, scenario.simulation
    limits = {name: getattr(simulation, name) for name in ("max_speed", "max_evaluations")}
    settings = Settings(**dataclasses.asdict(scenario.compiled), **limits)
    actuation = Actuation(signal_samples(scenario, gait), cpg.listing_step, cpg.start_up)
    return make_model(scenario, structure), settings, actuation


def compile_engine(scenario: Scenario, announce: Callable[[str], None] | None = None) -> None:
    """Compiles the engine, or loads it from numba's cache, unless that is done already;
    `announce` is told if it takes longer than a moment."""
    if walk.signatures:  # type: ignore[attr-defined]
        return
    message = "compiling the engine, which takes some seconds the first time ..."
    timer = threading.Timer(1.0, announce or (lambda _: None), [message])
    structure = MakeStructure(scenario.robot, scenario.cables)
    timer.start()
    try:
        constants = kernel_constants(scenario, seeded_gait(scenario), structure)
        walk(*constants, structure.initial_state, np.zeros(1), np.zeros(1))
    finally:
        timer.cancel()


def _failure(status: int, time: float, scenario: Scenario) -> SimulationFailure:
    settings = scenario.simulation
    reasons = {
        TOO_FAST: f"a body's velocity exceeds the limit of {settings.max_speed:g} m/s",
        STEP_TOO_SMALL: "no step is small enough for the tolerance",
        TOO_MANY_EVALUATIONS: f"force evaluations exceed the budget of {settings.max_evaluations}",
    }
    kind = StepBudgetExceeded if status == TOO_MANY_EVALUATIONS else Diverged
    return kind(time=time, reason=reasons[status])


def _dataset(
    structure: Structure, robot: Model, times: np.ndarray, samples: Samples
) -> xarray.Dataset:
    """The recording with the forces that the kernels find at its states."""
    forces = [
        compute_forces(robot, move_nodes(state, robot.p_BN), modes, signals)
        for state, modes, signals in zip(*samples, strict=True)
    ]
    cables = np.array([found.cables for found in forces])
    contacts = np.array([found.contacts for found in forces])
    return assemble_dataset(
        structure,
        times=times,
        states=samples.states,
        signals=samples.signals,
        tensions=cables[:, 0],
        lengths=cables[:, 1],
        normal_forces=contacts[:, :, 2],
        friction_forces=contacts[:, :, :2],
        modes=samples.modes[:, :, :STICK_POINT],
    )
