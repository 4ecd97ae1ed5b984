"""Engine `drake`: one robot in one Drake diagram, with error-controlled integration."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
import weakref
from time import perf_counter
from typing import NamedTuple

import numpy as np
from pydrake.common import RandomGenerator
from pydrake.systems.analysis import (
    InitializeParams,
    IntegratorBase,
    ResetIntegratorFromFlags,
    Simulator,
)
from pydrake.systems.framework import Context, Diagram
from scipy.sparse import csc_array
from scipy.sparse.linalg import eigsh

from tetra_drake.engines.engine import SAME_TIME, Engine, Viewer
from tetra_drake.engines.observer import Observer
from tetra_drake.engines.sampler import Sampler, drives_at, frame_of
from tetra_drake.engines.time_limit import check_time
from tetra_drake.errors import (
    Diverged,
    InputError,
    SimulationFailure,
    StepBudgetExceeded,
    check_type,
)
from tetra_drake.results.result import IntegratorWork, SimulationResult, make_result, motion_times
from tetra_drake.robot.command import signals_of_one
from tetra_drake.robot.equilibrium import Unactuated, damping_at_rest, mass_matrix
from tetra_drake.robot.gait_file import GivenGait, given_gait
from tetra_drake.robot.parameter_space import with_body
from tetra_drake.robot.readings import Readings
from tetra_drake.robot.robot import Phase, Robot
from tetra_drake.robot.signals import DrivenRobot, Pilot
from tetra_drake.robot.speed_limit import speed_limit
from tetra_drake.scenario.disturbances import disturbed, fresh_draws
from tetra_drake.scenario.engine_kinds import Drake
from tetra_drake.scenario.load import GivenScenario, given_scenario
from tetra_drake.systems import GroundContact, SampledController
from tetra_drake.systems.diagram import MakeSignalSource, MakeTensegrityDiagram, SetStart

_WITNESS_WINDOW = 2e-5  # s; precision of witnessed mode changes for accuracies of 1e-3 and above
_WITNESS_WINDOW_PER_ACCURACY = 0.01  # s; Drake's isolation window is this times the accuracy

_NEAR = 1e-3
"""Largest predicted time (s) to a change of contact mode for which a step ends at the change."""
_AIM_FACTOR = 1.02
_AIM_BEYOND = 5e-5
"""Largest time (s) from a mode change to the end of a step that is aimed at it. The step is the
predicted time to the change, times _AIM_FACTOR, plus at most this time."""
_APPROACH = 0.8
"""Length of a step before a mode change later than _NEAR, as a share of the time to the change."""
_FEW, _RATE_PER_SQUARE = 12, 14.0
"""Limits of default_scheme(): a number of bodies, and a rate in 1/s per body squared. With the
second one, both schemes take equally long for rows of 25 tetrahedra."""
_FINEST = 2e-5
"""Smallest default of the target accuracy; see MakeSimulator()."""
_RENEWAL = 20
"""Most steps with one Jacobian of a robot with anchors or joints, whose stiff springs turn with its
bodies."""
_GOING_ON = InitializeParams(suppress_initialization_events=True)
"""Parameters of Initialize() for a simulation that goes on."""


class _Pace(NamedTuple):
    """Steps that suit a law of friction; times in s. Settings may give max_step and look_ahead."""

    coarsest: float
    """Largest target accuracy."""
    max_step: float
    look_ahead: float
    first_step: float
    """Longest step after a mode change."""
    growth: float
    """Factor by which the longest step grows with each step until the next mode change."""
    renew_from: float
    """Length of a step after a mode change from which it needs a new Jacobian. Shorter steps mostly
    converge without one."""


_SLIPPING = _Pace(
    5e-3, max_step=8e-3, look_ahead=2e-5, first_step=3e-4, growth=3.0, renew_from=8e-4
)
_VISCOUS = _Pace(
    1e-2, max_step=12e-3, look_ahead=3e-4, first_step=1e-4, growth=2.0, renew_from=3e-3
)
"""For friction that is nearly viscous. A foot that lands fast is thrown off the ground by its
friction, up to seven thousand times per second. Steps that end at each of these contacts gain
nothing. By default they are explicit: one takes 3 evaluations, an implicit one 17."""


class DrakeEngine(Engine):
    """Engine `drake`: simulates the Drake diagram of one robot at a time."""

    has_threads = False

    def simulate(
        self, robot: DrivenRobot, *, record: bool = False, viewer: Viewer | None = None
    ) -> SimulationResult:
        return _DiagramRobot(robot, record=record, viewer=viewer).simulated()


def _signals(pilot: Pilot, first: np.ndarray, time: float, readings: Readings) -> np.ndarray:
    """Signals (m,) in N of a policy or a controller, for a SampledController, after the `first`."""
    # Drake's multiples of the period may be just before the end.
    return signals_of_one(pilot, readings) if 0.0 < time < pilot.end - SAME_TIME else first


class _DiagramRobot:
    """Simulation of one robot from start to end, in a Drake diagram of its own.

    If no oscillators drive the robot, the diagram has a system `controller`: a SampledController
    for a policy or a controller, or a source of the signals of a command. After an event, the
    simulation goes on with the diagram of the changed robot, from the same state.
    """

    def __init__(self, driven: DrivenRobot, *, record: bool, viewer: Viewer | None) -> None:
        self._driven, self._record, self._viewer = driven, record, viewer
        self._marks = driven.marks.tolist()
        self._observer, self._speed_limit = Observer(driven), speed_limit(driven)
        self._build(driven.robot)
        self._monitor()

    def _build(self, robot: Robot) -> None:
        """Makes the diagram of a robot, and what follows its simulation."""
        driven, settings = self._driven, robot.scenario.settings_of(Drake)
        if robot.scenario.events:  # _become() plays them
            until = robot.scenario.with_sections(events=[])
            robot = dataclasses.replace(robot, scenario=until)
        gait, source = driven.oscillating, None
        if driven.pilot is not None:
            law = functools.partial(_signals, driven.pilot, driven.robot.first_signals)
            source = SampledController(robot, law, period=driven.pilot.period)
        elif driven.samples.size:
            source = MakeSignalSource(driven.samples, step=robot.scenario.cpg.listing_step)
        steering = driven.steering
        diagram = MakeTensegrityDiagram(robot, gait, steering=steering, controller=source)
        self._diagram, self._steps = diagram, _Steps.of(robot, settings)
        self._simulator = _make_simulator(diagram, robot, self._steps)
        self._state, self._signals = (diagram.GetOutputPort(name) for name in ("state", "signals"))
        self._work = _Work(self._simulator)
        self._aimer = _StepAimer(diagram, self._simulator, self._steps, self._work)
        times = motion_times(driven.robot.scenario.simulation, record=self._record)
        self._sampler = Sampler(diagram, times, max_step=self._steps.pace.max_step)

    def _monitor(self) -> None:
        """Lets _after_step() follow the simulation."""
        # A bound method in place of the lambda would keep the diagram alive for ever.
        this = weakref.proxy(self)
        self._simulator.set_monitor(lambda context: this._after_step(context))

    def simulated(self) -> SimulationResult:
        """The result at the end of the simulation. Raises Diverged or StepBudgetExceeded."""
        robot, started = self._driven.robot, perf_counter()
        try:
            for before, after in itertools.pairwise(robot.phases):
                # An action at the time of an event is before it, as on the other engines.
                self._advance_to(after.begins + (SAME_TIME if self._driven.pilot else 0.0))
                self._become(after, before)
            self._advance_to(robot.scenario.simulation.duration)
        except SimulationFailure as failure:
            failure.wall_time = perf_counter() - started
            raise
        wall_time = perf_counter() - started
        accuracy = self._simulator.get_integrator().get_target_accuracy()
        return make_result(
            self._driven,
            self._sampler.motion(),
            totals=self._observer.tally,
            work=self._work.total(self._steps.scheme, accuracy),
            wall_time=wall_time,
            record=self._record,
        )

    def _advance_to(self, time: float) -> None:
        """Simulates to a time (s), unless it has passed."""
        if time <= self._simulator.get_context().get_time():
            return
        stops = {time, *(mark for mark in self._marks if mark <= time)}
        self._marks = [mark for mark in self._marks if mark > time]
        for stop in sorted(stops):
            try:
                self._simulator.AdvanceTo(stop)
            except SimulationFailure:
                raise
            except RuntimeError as error:
                if error.__traceback__ and error.__traceback__.tb_next:
                    raise  # from Python code in the diagram, such as a controller
                # Errors of Drake: the step became too small, or the state is not finite.
                now, reason = self._simulator.get_context().get_time(), str(error).strip()
                raise Diverged(time=now, reason=reason.splitlines()[0]) from error

    def _become(self, phase: Phase, before: Phase) -> None:
        """Goes on with the robot of another phase in place of this one; see Phase.entered()."""
        simulator, aimer, sampler = self._simulator, self._aimer, self._sampler
        work, robot = self._work.total(), phase.robot
        self._build(robot)
        old, context = simulator.get_context(), self._simulator.get_mutable_context()
        state, bodies = old.get_continuous_state_vector().CopyToVector(), 13 * len(phase.p_BC)
        state[:bodies] = phase.entered(state[:bodies], before)
        context.SetTime(old.get_time())
        context.SetContinuousState(state)
        for group in range(context.num_discrete_state_groups()):
            context.SetDiscreteState(group, old.get_discrete_state(group).value())
        self._observer.follow(robot)
        self._work.before = work
        self._sampler.follow(sampler, context)
        self._aimer.follow(aimer)
        # Without a monitor, which would aim the step anew.
        self._simulator.Initialize(_GOING_ON)
        self._monitor()

    def _after_step(self, context: Context) -> None:
        # Nothing here may change the simulation, whether it is recorded or watched or not.
        if self._aimer.is_switching:
            return
        check_time()
        robot, viewer = self._driven.robot, self._viewer
        bodies, now = self._state.Eval(context), context.get_time()
        velocities = bodies[7 * len(robot.structure.bodies) :]
        if not np.abs(velocities.reshape(-1, 6)[:, 3:]).max() <= self._speed_limit:
            raise Diverged.too_fast(time=now, limit=self._speed_limit)
        used, budget = self._work.evaluations(), robot.scenario.simulation.max_evaluations
        if used > budget:
            reason = f"{used} derivative evaluations, the budget is {budget}"
            raise StepBudgetExceeded(time=now, reason=reason)

        self._aimer.aim(context)
        self._sampler.after_step(context)
        signals, drives = [self._signals.Eval(context)], drives_at(self._diagram, context)
        if now == self._driven.start_up and self._diagram.HasSubsystemNamed("cpg"):
            # The event that lets signals act is after this step.
            cpg = self._diagram.GetSubsystemByName("cpg")
            signals.append(cpg.get_output_port(0).Eval(cpg.GetMyContextFromRoot(context)))
        for each in signals:
            moment = np.array([now]), bodies[np.newaxis], each[np.newaxis], drives[np.newaxis]
            self._observer.add(*moment)
        if viewer is not None and viewer.wants(now):
            viewer.show(frame_of(robot, self._diagram, context))


def MakeSimulator(diagram: Diagram, robot: Robot, settings: Drake) -> Simulator:
    """Drake's Simulator for a robot's diagram, with the integrator settings of the scenario.

    If the scenario sets no target accuracy, it is half of Robot.damping_ratio, but at least 2e-5
    and at most 5e-3, or 1e-2 where friction is nearly viscous; a tenth of this for robots with
    joints. If it sets no longest step, Robot.longest_step limits it.

    The simulator's monitor lets steps end where contact modes change; see _StepAimer. Another
    monitor replaces it. The integrator stays the same, so a caller can hold it.
    """
    check_type("MakeSimulator", "diagram", diagram, Diagram)
    check_type("MakeSimulator", "robot", robot, Robot)
    check_type("MakeSimulator", "settings", settings, Drake)
    scheme = settings.scheme or default_scheme(robot)
    steps = _Steps.of(robot, settings.model_copy(update={"scheme": scheme}))
    simulator = _make_simulator(diagram, robot, steps)
    aimer = _StepAimer(diagram, simulator, steps, _Work(simulator))
    simulator.set_monitor(aimer.aim)
    return simulator


def _make_simulator(diagram: Diagram, robot: Robot, steps: _Steps) -> Simulator:
    simulator = Simulator(diagram)
    SetStart(diagram, simulator.get_mutable_context(), robot)
    _set_integrator(simulator, steps.scheme, steps)
    if not steps.at_step_end:
        window = _WITNESS_WINDOW * min(1.0, steps.accuracy / 1e-3)
        simulator.get_mutable_context().SetAccuracy(window / _WITNESS_WINDOW_PER_ACCURACY)
    return simulator


def _set_integrator(simulator: Simulator, scheme: str, steps: _Steps) -> None:
    integrator = ResetIntegratorFromFlags(simulator, scheme, steps.pace.max_step)
    integrator.set_target_accuracy(steps.accuracy)


def MakeDisturbedSimulator(
    scenario: GivenScenario, gait: GivenGait, generator: RandomGenerator
) -> Simulator:
    """Drake's Simulator of a robot with random disturbances, for Drake's Monte Carlo simulations:

    >>> results = MonteCarloSimulation(
    ...     make_simulator=functools.partial(MakeDisturbedSimulator, "robust", gait),
    ...     output=lambda system, context: system.GetOutputPort("state").Eval(context)[4],
    ...     final_time=5.0,
    ...     num_samples=100,
    ...     generator=RandomGenerator(1),
    ... )

    The generator's next number is the seed of a draw in scenario.disturbances.fresh_draws(), by the
    scenario's `disturbances`, which robustness() draws, too. Disturbances change masses, lengths,
    the terrain and so on, so each draw has its own diagram, whose context is not random.

    Raises InputError if the scenario has no disturbances, has events or `disturbances.cuts`, which
    a Simulator does not know, or the draw is no possible robot.
    """
    check_type("MakeDisturbedSimulator", "generator", generator, RandomGenerator)
    scenario = given_scenario(scenario).on_engine("drake")
    scenario, gait = with_body(scenario, given_gait(gait, scenario))
    if scenario.disturbances is None:
        raise InputError(scenario.name, "disturbances", "is missing; it says what varies")
    [draw] = fresh_draws(scenario, generator(), 1)
    robot = Robot.of(disturbed(scenario, draw))
    return MakeSimulator(MakeTensegrityDiagram(robot, gait), robot, scenario.settings_of(Drake))


@dataclasses.dataclass(frozen=True)
class _Steps:
    """Integrator of a robot and its steps: the settings, with defaults for what is not given."""

    scheme: str
    accuracy: float
    at_step_end: bool
    """True if modes change at the end of steps."""
    pace: _Pace
    renewal: float
    """Most steps with one Jacobian."""
    settling: int
    """Number of explicit steps after a mode change; 0 if none are explicit."""

    @classmethod
    def of(cls, robot: Robot, settings: Drake) -> _Steps:
        """The steps of a robot; see MakeSimulator()."""
        pace = _VISCOUS if robot.scenario.friction.is_viscous else _SLIPPING
        is_jointed = robot.model.joints.node_a.size > 0
        coarsest = 0.1 * pace.coarsest if is_jointed else pace.coarsest
        accuracy = min(coarsest, max(_FINEST, 0.5 * robot.damping_ratio))
        longest = settings.max_step or min(pace.max_step, robot.longest_step)
        pace = pace._replace(max_step=longest)
        if settings.look_ahead is not None:
            pace = pace._replace(look_ahead=settings.look_ahead)
        scheme, settling = settings.scheme or default_scheme(robot), 0
        if robot.scenario.friction.is_viscous and settings.scheme is None and scheme == "radau3":
            # They take as many evaluations as a Jacobian, which the next implicit step needs.
            settling = 13 * len(robot.structure.bodies) // 3
            pace = pace._replace(first_step=math.inf, renew_from=math.inf)
        return cls(
            scheme=scheme,
            accuracy=settings.accuracy or accuracy,
            at_step_end=settings.mode_changes == "step_end",
            pace=pace,
            renewal=_RENEWAL if is_jointed or robot.model.anchors.nodes.size else math.inf,
            settling=settling,
        )


def default_scheme(robot: Robot) -> str:
    """Integrator of a robot whose settings name none: the one that is mostly faster.

    The work of radau3 grows with the square of the number of bodies n: it renews a Jacobian of 13 n
    columns about n times per second. The work of runge_kutta3 grows with the rate at which dampers
    stop the fastest motion, because longer steps would be unstable. So it is runge_kutta3 for
    robots of more than _FEW bodies whose rate is below _RATE_PER_SQUARE n².
    """
    bodies = len(robot.structure.bodies)
    if bodies <= _FEW:
        return "radau3"
    unactuated = Unactuated(robot.model)
    damping = damping_at_rest(unactuated, robot.structure.initial_state)
    if not damping.any():
        return "runge_kutta3"
    matrices = csc_array(damping), csc_array(mass_matrix(unactuated))
    rate = eigsh(matrices[0], 1, matrices[1], which="LA", return_eigenvectors=False)[0]
    return "runge_kutta3" if rate < _RATE_PER_SQUARE * bodies**2 else "radau3"


class _Work:
    """Counter of the steps and derivative evaluations of an integrator.

    An integrator that is initialised again counts from zero. This counter continues if total() was
    put into `before` first.
    """

    def __init__(self, simulator: Simulator) -> None:
        # A reference to the simulator or its integrator in its monitor would keep it for ever.
        self._simulator = weakref.ref(simulator)
        self.before = IntegratorWork(scheme="", accuracy=0.0, steps=0, derivative_evaluations=0)
        """Work before the integrator was initialised for the last time."""

    @property
    def integrator(self) -> IntegratorBase:
        """The simulator's present integrator."""
        simulator = self._simulator()
        assert simulator is not None
        return simulator.get_mutable_integrator()

    def go_on(self, scheme: str, steps: _Steps) -> None:
        """Replaces the integrator by a new one. Calls the simulator's monitor."""
        self.before, simulator = self.total(), self._simulator()
        assert simulator is not None
        _set_integrator(simulator, scheme, steps)
        simulator.Initialize(_GOING_ON)

    def total(self, scheme: str = "", accuracy: float = 0.0) -> IntegratorWork:
        before, statistics = self.before, dict(self.integrator.GetStatisticsSummary())
        for_jacobian = int(statistics.get("integrator_num_derivative_evaluations_for_jacobian", 0))
        return IntegratorWork(
            scheme=scheme,
            accuracy=accuracy,
            steps=before.steps + self.integrator.get_num_steps_taken(),
            derivative_evaluations=self.evaluations(),
            jacobian_evaluations=before.jacobian_evaluations + for_jacobian,
        )

    def evaluations(self) -> int:
        earlier = self.before.derivative_evaluations
        return earlier + self.integrator.get_num_derivative_evaluations()


class _StepAimer:
    """Limits the next integrator step by the predicted time to the next change of contact mode.

    A change is, for instance, that a node touches the ground. `max_step` is the longest step,
    `look_ahead` the shortest one that is aimed at a change; see _Pace for the others.

    | predicted mode change   | longest step                                                     |
    |-------------------------|------------------------------------------------------------------|
    | in max_step or later    | max_step                                                         |
    | later than 1 ms         | 0.8 of the time to it: over a long step the prediction is poor   |
    | in 1 ms or sooner       | to just after it, but at least look_ahead                        |
    | at the end of this step | first_step, which then grows: long steps mostly fail at first    |

    The prediction uses the mean acceleration of the last step, which costs nothing. The present
    acceleration is no better: the vibrations after a mode change decay at rates of 1e4 /s.

    A mode change also changes the Jacobian. The integrator would keep the old one as long as
    Newton's iterations converge, slowly and with an error of one sign. So we renew the Jacobian,
    unless the next step is shorter than `renew_from`. It is also renewed after `renewal` steps.

    Where friction is nearly viscous, the default scheme has explicit steps after a mode change: the
    integrator is runge_kutta3 until `settling` steps have passed without another mode change, and
    then a new radau3. Error control limits their length.

    All this is for the scheme radau3 with `mode_changes: step_end`. With any scheme, struts
    that approach limit the step, so that they cannot pass through each other.
    """

    def __init__(self, diagram: Diagram, simulator: Simulator, steps: _Steps, work: _Work) -> None:
        self._pace, self._work, self._state = steps.pace, work, diagram.GetOutputPort("state")
        self._renewal, self._age = steps.renewal, 0  # steps
        self._ground = diagram.GetSubsystemByName("ground")
        self._aims = (
            steps.at_step_end
            and steps.pace.look_ahead > 0.0
            and steps.scheme == "radau3"  # other schemes take short steps anyway
            and isinstance(self._ground, GroundContact)
        )
        touches = diagram.HasSubsystemNamed("state_forces")
        self._struts = diagram.GetSubsystemByName("state_forces") if touches else None
        self._last_time = 0.0
        size = simulator.get_context().get_continuous_state().num_v()
        self._last_velocities = self._acceleration = np.zeros(size)
        self._longest = steps.pace.max_step
        self._jacobian_is_old = False
        self._steps, self._settled = steps, steps.settling  # steps since a mode change
        self._is_explicit = self.is_switching = False

    def follow(self, other: _StepAimer) -> None:
        """Goes on as another aimer would, in the diagram of a changed robot."""
        self._last_time, self._last_velocities = other._last_time, other._last_velocities
        self._longest, self._acceleration = other._longest, other._acceleration
        self._jacobian_is_old, self._age = other._jacobian_is_old, other._age
        self._settled = other._settled
        if other._is_explicit:
            self._switch()
        longest = other._work.integrator.get_maximum_step_size()
        self._work.integrator.set_maximum_step_size(longest)
        self._work.integrator.request_initial_step_size_target(longest)  # for Initialize()

    def _switch(self) -> None:
        """Goes on with the other integrator: the explicit or the implicit one."""
        self._is_explicit, self.is_switching = not self._is_explicit, True
        self._work.go_on("runge_kutta3" if self._is_explicit else "radau3", self._steps)
        self.is_switching = False

    def aim(self, context: Context) -> None:
        """Limits the length of the next step. Call it after each step, with the simulator's context
        at the end of the step."""
        if self.is_switching:
            return
        pace, longest = self._pace, self._pace.max_step
        if self._struts is not None:
            here = self._struts.GetMyContextFromRoot(context)
            longest = self._struts.LongestStep(here, horizon=longest)
            self._work.integrator.set_maximum_step_size(longest)
        if not self._aims:
            return
        velocities = self._state.Eval(context)[-self._last_velocities.size :]
        step_taken = context.get_time() - self._last_time
        if step_taken > SAME_TIME:  # a step to an action at a mark may be nothing but rounding
            self._acceleration = (velocities - self._last_velocities) / step_taken
        self._last_time, self._last_velocities = context.get_time(), velocities

        due, time_to_change = self._ground.NextModeChange(
            self._ground.GetMyContextFromRoot(context),
            acceleration=self._acceleration,
            horizon=pace.max_step,
        )
        self._settled = 0 if due else self._settled + 1
        if self._is_explicit != (self._settled < self._steps.settling):
            self._switch()
        if due:
            self._longest, self._jacobian_is_old = pace.first_step, True
        elif self._longest < pace.max_step:
            self._longest = pace.growth * max(step_taken, pace.first_step)
        if _NEAR < time_to_change < pace.max_step:
            aimed = _APPROACH * time_to_change
        else:
            margin = min(_AIM_BEYOND, 0.25 * pace.look_ahead)
            aimed = max(pace.look_ahead, _AIM_FACTOR * time_to_change + margin)
        step, integrator = min(longest, self._longest, aimed), self._work.integrator
        self._age += 1
        if self._age >= self._renewal or (self._jacobian_is_old and step >= pace.renew_from):
            self._work.before = self._work.total()
            # Initialize() needs a limit that allows the initial step, which is the longest.
            integrator.set_maximum_step_size(pace.max_step)
            integrator.Initialize()
            self._jacobian_is_old, self._age = False, 0
        integrator.set_maximum_step_size(step)


ENGINE = DrakeEngine()
