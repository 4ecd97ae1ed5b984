"""The engine `drake`: one gait through one Drake diagram, with error-controlled integration."""

from __future__ import annotations

import time

import numpy as np
from pydrake.systems.analysis import IntegratorBase, ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import Context, Diagram, EventStatus

from tetra_drake.engines.recorder import Recorder, Sample, make_dataset
from tetra_drake.engines.viewer import Viewer
from tetra_drake.errors import Diverged, SimulationFailure, StepBudgetExceeded
from tetra_drake.results.result import IntegratorWork, SimulationResult, make_result
from tetra_drake.results.trajectory import sample_times
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.structure import MakeStructure, node_positions
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
    guard = _Guard(diagram, simulator, settings)
    aimer = _StepAimer(diagram, simulator, settings)
    recorder = Recorder(sample_times(settings.duration, settings.sample_period))

    def after_step(context: Context) -> EventStatus:
        # What is done here must not depend on whether somebody records or watches.
        if guard.check(context) is not None:
            return EventStatus.ReachedTermination(diagram, "the simulation has failed")
        aimer.aim(context)
        if record:
            recorder.after_step(context)
        if viewer is not None and viewer.wants(context.get_time()):
            viewer.show(make_dataset(diagram, structure, [Sample.of(context)]))
        return EventStatus.Succeeded()

    simulator.set_monitor(after_step)
    started = time.perf_counter()
    positions = []
    for instant in (0.0, settings.steady_from, settings.duration):
        guard.advance_to(instant)
        state = diagram.GetOutputPort("state").Eval(simulator.get_context())
        positions.append(node_positions(structure, state))
    wall_time = time.perf_counter() - started

    return make_result(
        scenario,
        structure,
        positions=positions,
        wall_time=wall_time,
        integrator=_integrator_work(simulator.get_integrator(), settings),
        trajectory=recorder.dataset(diagram, structure) if record else None,
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


class _Guard:
    """Ends a simulation that has failed, with the reason."""

    def __init__(
        self, diagram: Diagram, simulator: Simulator, settings: SimulationScenario
    ) -> None:
        self._simulator = simulator
        self._integrator = simulator.get_integrator()
        self._settings = settings
        self._state = diagram.GetOutputPort("state")
        self._failure: SimulationFailure | None = None

    def advance_to(self, time: float) -> None:
        """Simulates up to `time` (s); raises Diverged or StepBudgetExceeded."""
        try:
            self._simulator.AdvanceTo(time)
        except RuntimeError as error:
            # Drake's own reasons: a step below the least, a state that is not finite.
            now, reason = self._simulator.get_context().get_time(), str(error).strip()
            raise Diverged(time=now, reason=reason.splitlines()[0]) from error
        if self._failure is not None:
            raise self._failure

    def check(self, context: Context) -> SimulationFailure | None:
        """Why the simulation has failed; None if it has not."""
        settings, time = self._settings, context.get_time()
        state = self._state.Eval(context)
        v_WB = state[state.size // 13 * 7 :].reshape(-1, 6)[:, 3:]
        speed = np.abs(v_WB).max()
        used = self._integrator.get_num_derivative_evaluations()
        if not speed <= settings.max_speed:
            reason = f"a body moves at {speed:g} m/s, the limit is {settings.max_speed:g} m/s"
            self._failure = Diverged(time=time, reason=reason)
        elif used > settings.max_evaluations:
            reason = f"{used} derivative evaluations, the budget is {settings.max_evaluations}"
            self._failure = StepBudgetExceeded(time=time, reason=reason)
        return self._failure


class _StepAimer:
    """Lets steps end where the next mode change is predicted, if that is near.

    The prediction takes the mean acceleration of the last step, which costs nothing.
    """

    def __init__(
        self, diagram: Diagram, simulator: Simulator, settings: SimulationScenario
    ) -> None:
        self._integrator = simulator.get_mutable_integrator()
        self._settings = settings
        self._ground = diagram.GetSubsystemByName("ground")
        self._ground_context = self._ground.GetMyContextFromRoot(simulator.get_mutable_context())
        self._state = diagram.GetOutputPort("state")
        self._aims = (
            settings.mode_changes == "step_end"
            and settings.look_ahead > 0.0
            and settings.scheme in _IMPLICIT_SCHEMES
        )
        self._last_time = 0.0
        self._last_velocities = self._acceleration = np.zeros(0)

    def aim(self, context: Context) -> None:
        """Limits the next step; call it after each step."""
        if not self._aims:
            return
        time, state = context.get_time(), self._state.Eval(context)
        velocities = state[state.size // 13 * 7 :]
        step_taken = time - self._last_time
        if step_taken > 0.0:
            self._acceleration = (velocities - self._last_velocities) / step_taken
        elif not self._acceleration.size:
            self._acceleration = np.zeros(velocities.size)
        self._last_time, self._last_velocities = time, velocities
        horizon = self._settings.max_step
        predicted = self._ground.TimeToModeChange(
            self._ground_context, acceleration=self._acceleration, horizon=horizon
        )
        factor, margin = _AIM_BEYOND
        step = max(self._settings.look_ahead, factor * predicted + margin)
        self._integrator.set_maximum_step_size(min(horizon, step))


def _integrator_work(integrator: IntegratorBase, settings: SimulationScenario) -> IntegratorWork:
    statistics = dict(integrator.GetStatisticsSummary())
    return IntegratorWork(
        scheme=settings.scheme,
        accuracy=settings.accuracy,
        steps=int(integrator.get_num_steps_taken()),
        derivative_evaluations=int(integrator.get_num_derivative_evaluations()),
        jacobian_evaluations=int(
            statistics.get("integrator_num_derivative_evaluations_for_jacobian", 0)
        ),
    )
