"""The engine `drake`: one gait through one Drake diagram, with error-controlled integration."""

from __future__ import annotations

import time

import numpy as np
from pydrake.systems.analysis import IntegratorBase, ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import Context, Diagram

from tetra_drake.engines.recorder import Recorder, Sample, make_dataset
from tetra_drake.engines.viewer import Viewer
from tetra_drake.errors import Diverged, SimulationFailure, StepBudgetExceeded
from tetra_drake.results.result import IntegratorWork, SimulationResult, make_result
from tetra_drake.results.trajectory import sample_times
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.structure import MakeStructure
from tetra_drake.scenario.schema import Scenario, SimulationScenario
from tetra_drake.systems.diagram import MakeTensegrityDiagram

_WITNESS_WINDOW_PER_ACCURACY = 0.01  # s; how Drake's Simulator derives the isolation window
_IMPLICIT_SCHEMES = ("radau3", "radau1", "implicit_euler", "velocity_implicit_euler")
"""Those whose steps may be long; stability keeps the steps of the others short."""

_AIM_BEYOND = 1.02, 5e-5  # factor and s: a step shall end just after the mode change it aims at


def simulate_drake(
    *, scenario: Scenario, gait: Gait, record: bool = False, viewer: Viewer | None = None
) -> SimulationResult:
    """Simulates a gait as simulate() does, on the Drake diagram."""
    settings = scenario.simulation
    diagram = MakeTensegrityDiagram(scenario, gait)
    structure = MakeStructure(scenario.robot, scenario.cables)
    simulator = MakeSimulator(diagram, settings)
    integrator, state = simulator.get_integrator(), diagram.GetOutputPort("state")
    aimer = _StepAimer(diagram, simulator, settings)
    times = sample_times(settings.duration, settings.sample_period)
    recorder = Recorder(structure, times)

    def after_step(context: Context) -> None:
        # What is done here must not depend on whether somebody records or watches.
        velocities = state.Eval(context)[7 * len(structure.bodies) :]
        _check(settings, context.get_time(), velocities, integrator)
        aimer.aim(context, velocities)
        if record:
            recorder.after_step(context)
        if viewer is not None and viewer.wants(context.get_time()):
            viewer.show(make_dataset(diagram, structure, [Sample.of(context)]))

    simulator.set_monitor(after_step)
    started = time.perf_counter()
    states = []
    try:
        for instant in (0.0, settings.steady_from, settings.duration):
            simulator.AdvanceTo(instant)
            states.append(state.Eval(simulator.get_context()))
    except SimulationFailure:
        raise
    except RuntimeError as error:
        # Drake's own reasons: a step below the least, a state that is not finite.
        now, reason = simulator.get_context().get_time(), str(error).strip()
        raise Diverged(time=now, reason=reason.splitlines()[0]) from error
    wall_time = time.perf_counter() - started

    for_jacobian = "integrator_num_derivative_evaluations_for_jacobian"
    return make_result(
        scenario,
        structure,
        states=states,
        wall_time=wall_time,
        integrator=IntegratorWork(
            scheme=settings.scheme,
            accuracy=settings.accuracy,
            steps=integrator.get_num_steps_taken(),
            derivative_evaluations=integrator.get_num_derivative_evaluations(),
            jacobian_evaluations=int(dict(integrator.GetStatisticsSummary()).get(for_jacobian, 0)),
        ),
        trajectory=make_dataset(diagram, structure, recorder.samples) if record else None,
    )


def MakeSimulator(diagram: Diagram, settings: SimulationScenario) -> Simulator:
    """A simulator of the diagram with the scenario's integrator settings."""
    simulator = Simulator(diagram)
    integrator = ResetIntegratorFromFlags(simulator, settings.scheme, settings.max_step)
    if not integrator.get_fixed_step_mode():
        integrator.set_target_accuracy(settings.accuracy)
    if settings.mode_changes == "witness":
        per_accuracy = _WITNESS_WINDOW_PER_ACCURACY
        if integrator.get_fixed_step_mode():
            per_accuracy *= settings.max_step
        simulator.get_mutable_context().SetAccuracy(settings.witness_window / per_accuracy)
    return simulator


def _check(
    settings: SimulationScenario, now: float, velocities: np.ndarray, integrator: IntegratorBase
) -> None:
    """Raises Diverged or StepBudgetExceeded if the simulation has failed."""
    speed = np.abs(velocities.reshape(-1, 6)[:, 3:]).max()
    used = integrator.get_num_derivative_evaluations()
    if not speed <= settings.max_speed:
        reason = f"a body moves at {speed:g} m/s, the limit is {settings.max_speed:g} m/s"
        raise Diverged(time=now, reason=reason)
    if used > settings.max_evaluations:
        reason = f"{used} derivative evaluations, the budget is {settings.max_evaluations}"
        raise StepBudgetExceeded(time=now, reason=reason)


class _StepAimer:
    """Lets steps end where the next mode change is predicted, if that is near.

    The prediction takes the mean acceleration of the last step, which costs nothing.
    """

    def __init__(
        self, diagram: Diagram, simulator: Simulator, settings: SimulationScenario
    ) -> None:
        self._integrator, self._settings = simulator.get_mutable_integrator(), settings
        self._ground = diagram.GetSubsystemByName("ground")
        self._ground_context = self._ground.GetMyContextFromRoot(simulator.get_mutable_context())
        self._aims = (
            settings.mode_changes == "step_end"
            and settings.look_ahead > 0.0
            and settings.scheme in _IMPLICIT_SCHEMES
        )
        self._last_time = 0.0
        size = simulator.get_context().get_continuous_state().num_v()
        self._last_velocities = self._acceleration = np.zeros(size)

    def aim(self, context: Context, velocities: np.ndarray) -> None:
        """Limits the next step; call it after each step."""
        if not self._aims:
            return
        step_taken = context.get_time() - self._last_time
        if step_taken > 0.0:
            self._acceleration = (velocities - self._last_velocities) / step_taken
        self._last_time, self._last_velocities = context.get_time(), velocities
        horizon = self._settings.max_step
        predicted = self._ground.TimeToModeChange(
            self._ground_context, acceleration=self._acceleration, horizon=horizon
        )
        factor, margin = _AIM_BEYOND
        step = max(self._settings.look_ahead, factor * predicted + margin)
        self._integrator.set_maximum_step_size(min(horizon, step))
