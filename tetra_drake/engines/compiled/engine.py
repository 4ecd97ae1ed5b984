"""One gait through the compiled engine: what simulate() does when the scenario asks for it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

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
from tetra_drake.engines.viewer import Viewer, show_recording
from tetra_drake.errors import Diverged, SimulationFailure, StepBudgetExceeded
from tetra_drake.physics.cable import cable_forces
from tetra_drake.physics.contact import MODE_COLUMNS, STICK_POINT, ground_forces
from tetra_drake.results.result import IntegratorWork, SimulationResult, make_result
from tetra_drake.results.trajectory import assemble_dataset, sample_times
from tetra_drake.robot.gait import Gait, seeded_gait
from tetra_drake.robot.model import Model, make_model
from tetra_drake.robot.signals import signal_samples
from tetra_drake.robot.structure import MakeStructure, Structure, node_positions
from tetra_drake.scenario.schema import Scenario

if TYPE_CHECKING:
    import xarray

SCHEME = "ros2"


class Walk(NamedTuple):
    """All arguments of the kernel `walk` for one gait, by its names."""

    robot: Model
    settings: Settings
    actuation: Actuation
    marks: np.ndarray
    state: np.ndarray
    modes: np.ndarray
    positions: np.ndarray
    samples: Samples


def simulate_compiled(
    *,
    scenario: Scenario,
    gait: Gait,
    record: bool,
    viewer: Viewer | None = None,
    structure: Structure | None = None,
) -> SimulationResult:
    """Simulates a gait as simulate() does, without Drake.

    `structure` takes the place of the scenario's own, as for a robot that starts elsewhere.

    Deterministic: the numbers depend on scenario and gait only. Other threads run meanwhile.
    It is too fast to be watched: the viewer is shown the recording.

    Raises Diverged or StepBudgetExceeded, which say when and why.
    """
    structure = structure or MakeStructure(scenario.robot, scenario.cables)
    prepared = prepare(scenario, gait, structure, record=record or viewer is not None)
    compile_engine(scenario)
    start = node_positions(structure, prepared.state)
    started = time.perf_counter()
    status, ended, steps, evaluations = walk(*prepared)
    wall_time = time.perf_counter() - started
    if status != DONE:
        raise _failure(status, ended, scenario)

    duration, steady_from = scenario.simulation.duration, scenario.simulation.steady_from
    positions = {0.0: start, **dict(zip(prepared.marks, prepared.positions, strict=True))}
    trajectory = _dataset(structure, prepared) if record or viewer else None
    if viewer is not None and trajectory is not None:
        show_recording(viewer, trajectory)
    return make_result(
        scenario,
        structure,
        positions=(start, positions[steady_from], positions[duration]),
        wall_time=wall_time,
        integrator=IntegratorWork(
            scheme=SCHEME,
            accuracy=scenario.compiled.tolerance,
            steps=steps,
            derivative_evaluations=evaluations,
        ),
        trajectory=trajectory if record else None,
    )


def prepare(scenario: Scenario, gait: Gait, structure: Structure, *, record: bool) -> Walk:
    """What the kernel needs to simulate one gait, with room for a recording if asked for."""
    simulation, contacts = scenario.simulation, len(structure.contacts)
    state = structure.initial_state
    times = (scenario.cpg.start_up, simulation.steady_from, simulation.duration)
    marks = np.array(sorted({t for t in times if 0.0 < t <= simulation.duration}))
    samples = sample_times(simulation.duration, simulation.sample_period)
    samples = samples if record else samples[:0]
    rows = samples.size
    return Walk(
        robot=make_model(scenario, structure),
        settings=Settings(
            tolerance=scenario.compiled.tolerance,
            max_step=scenario.compiled.max_step,
            look_ahead=scenario.compiled.look_ahead,
            max_speed=simulation.max_speed,
            max_evaluations=simulation.max_evaluations,
        ),
        actuation=Actuation(
            samples=signal_samples(scenario, gait),
            step=scenario.cpg.listing_step,
            start_up=scenario.cpg.start_up,
        ),
        marks=marks,
        state=state,
        modes=np.zeros((contacts, MODE_COLUMNS)),
        positions=np.empty((len(marks), len(structure.node_names), 3)),
        samples=Samples(
            times=samples,
            states=np.empty((rows, state.size)),
            modes=np.empty((rows, contacts, MODE_COLUMNS)),
            signals=np.empty((rows, structure.signals)),
        ),
    )


def compile_engine(scenario: Scenario, announce: Callable[[str], None] | None = None) -> None:
    """Compiles the engine, or loads it from numba's cache; again, it returns at once.

    `announce` is told if that takes longer than a moment.
    """
    if walk.signatures:  # type: ignore[attr-defined]
        return
    message = "compiling the engine, which takes some seconds the first time ..."
    timer = threading.Timer(1.0, announce or (lambda _: None), [message])
    timer.start()
    try:
        structure = MakeStructure(scenario.robot, scenario.cables)
        prepared = prepare(scenario, seeded_gait(scenario), structure, record=False)
        walk(*prepared._replace(marks=np.zeros(1)))
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


def _dataset(structure: Structure, prepared: Walk) -> xarray.Dataset:
    """The recording with the forces that the kernels find at its states."""
    samples, robot = prepared.samples, prepared.robot
    kept = samples.times.size
    force = np.empty(6 * len(structure.bodies))
    tensions, lengths = np.empty((2, kept, len(structure.cables)))
    normal = np.empty((kept, len(structure.contacts)))
    friction = np.empty((kept, len(structure.contacts), 2))
    for i in range(kept):
        state, signals = samples.states[i], samples.signals[i]
        laws = robot.cables, robot.slack
        cable_forces(state, signals, robot.p_BN, *laws, force, tensions[i], lengths[i])
        modes = samples.modes[i]
        ground = robot.contacts, robot.ground
        ground_forces(state, modes, robot.p_BN, *ground, force, normal[i], friction[i])
    return assemble_dataset(
        structure,
        times=samples.times,
        states=samples.states,
        signals=samples.signals,
        tensions=tensions,
        lengths=lengths,
        normal_forces=normal,
        friction_forces=friction,
        modes=samples.modes[:, :, :STICK_POINT],
    )
