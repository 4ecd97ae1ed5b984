"""The engine `drake`: one gait through one Drake diagram, with error-controlled integration."""

from __future__ import annotations

import time

import numpy as np
from pydrake.systems.analysis import IntegratorBase, ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import Context, Diagram, EventStatus

from tetra_drake.engines.viewer import Viewer
from tetra_drake.errors import Diverged, SimulationFailure, StepBudgetExceeded
from tetra_drake.results.metrics import compute_fitness, compute_metrics
from tetra_drake.results.result import IntegratorWork, SimulationResult
from tetra_drake.results.trajectory import Recorder, Sample, make_dataset
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.structure import MakeStructure, Structure, node_positions
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
    diagram = MakeTensegrityDiagram(scenario, gait)
    structure = MakeStructure(scenario.robot, scenario.cables)
    simulator = MakeSimulator(diagram, scenario.simulation)
    recorder = Recorder(scenario.simulation.sample_period) if record else None
    watch = _Watch(diagram, simulator, structure, scenario.simulation, recorder, viewer)
    simulator.set_monitor(watch.after_step)

    times = (0.0, scenario.simulation.steady_from, scenario.simulation.duration)
    started = time.perf_counter()
    start, steady, end = (watch.advance_to(t) for t in times)
    wall_time = time.perf_counter() - started

    metrics = compute_metrics(structure, start=start, steady=steady, end=end)
    return SimulationResult(
        metrics=metrics,
        fitness=compute_fitness(metrics, scenario.fitness),
        duration=scenario.simulation.duration,
        wall_time=wall_time,
        integrator=_integrator_work(simulator.get_integrator(), scenario.simulation),
        engine="drake",
        trajectory=make_dataset(diagram, structure, recorder.samples()) if recorder else None,
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


class _Watch:
    """Looks on after every step: ends what has failed, aims the next step, records, shows."""

    def __init__(
        self,
        diagram: Diagram,
        simulator: Simulator,
        structure: Structure,
        settings: SimulationScenario,
        recorder: Recorder | None,
        viewer: Viewer | None,
    ) -> None:
        self._diagram = diagram
        self._simulator = simulator
        self._integrator = simulator.get_mutable_integrator()
        self._structure = structure
        self._settings = settings
        self._recorder = recorder
        self._viewer = viewer
        self._ground = diagram.GetSubsystemByName("ground")
        self._ground_context = self._ground.GetMyContextFromRoot(simulator.get_mutable_context())
        self._state = diagram.GetOutputPort("state")
        bodies = len(structure.bodies)
        self._velocities = slice(7 * bodies, 13 * bodies)
        self._aims = (
            settings.mode_changes == "step_end"
            and settings.look_ahead > 0.0
            and settings.scheme in _IMPLICIT_SCHEMES
        )
        self._last_time = 0.0
        self._last_velocities = np.zeros(6 * bodies)
        self._acceleration = np.zeros(6 * bodies)
        self._failure: SimulationFailure | None = None

    def advance_to(self, time: float) -> np.ndarray:
        """Simulates up to `time` (s); the positions p_WN (nodes, 3) in m there."""
        context = self._simulator.get_context()
        try:
            self._simulator.AdvanceTo(time)
        except RuntimeError as error:
            # Drake's own reasons: a step below the least, a state that is not finite.
            raise Diverged(time=context.get_time(), reason=_first_sentence(error)) from error
        if self._failure is not None:
            raise self._failure
        return node_positions(self._structure, self._state.Eval(context))

    def after_step(self, context: Context) -> EventStatus:
        """The simulator's monitor; it must not depend on who records or watches."""
        state = self._state.Eval(context)
        self._failure = self._find_failure(context.get_time(), state)
        if self._failure is not None:
            return EventStatus.ReachedTermination(self._diagram, self._failure.reason)
        if self._aims:
            self._aim_next_step(context.get_time(), state[self._velocities])
        if self._recorder is not None:
            self._recorder.after_step(context)
        if self._viewer is not None and self._viewer.wants(context.get_time()):
            frame = make_dataset(self._diagram, self._structure, [Sample.of(context)])
            self._viewer.show(frame)
        return EventStatus.Succeeded()

    def _find_failure(self, time: float, state: np.ndarray) -> SimulationFailure | None:
        settings = self._settings
        v_WB = state[self._velocities].reshape(-1, 6)[:, 3:]
        speed = np.abs(v_WB).max()
        if not speed <= settings.max_speed:
            limit = f"the limit of {settings.max_speed:g} m/s"
            return Diverged(time=time, reason=f"a body's velocity of {speed:g} m/s exceeds {limit}")
        used = self._integrator.get_num_derivative_evaluations()
        if used > settings.max_evaluations:
            limit = f"the budget of {settings.max_evaluations}"
            return StepBudgetExceeded(time=time, reason=f"{used} derivative evaluations, {limit}")
        return None

    def _aim_next_step(self, time: float, velocities: np.ndarray) -> None:
        """Lets the next step end where the next mode change is predicted, if that is near.

        The prediction takes the mean acceleration of the last step, which costs nothing.
        """
        step_taken = time - self._last_time
        if step_taken > 0.0:
            self._acceleration = (velocities - self._last_velocities) / step_taken
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


def _first_sentence(error: Exception) -> str:
    return str(error).strip().splitlines()[0]
