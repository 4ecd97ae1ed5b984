"""Engine `mujoco`: the same robot in MuJoCo (https://mujoco.org), modelled as MuJoCo's users do.

Bodies, cables, actuation and gravity are the same as in the other engines. The ground differs: it
is MuJoCo's soft contact with a friction cone.

- Cables are MuJoCo's tendons. If actuators have drives, or damped or driven cables can go slack,
  the law of the other engines computes the tensions, from MuJoCo's lengths at the beginning of each
  step.
- Normal force: the stiffness is the scenario's. The damping is constant; in the other engines it
  grows with depth. Both agree at the depth of a robot in equilibrium.
- Contact of struts: the forces are computed by the law of the other engines, from MuJoCo's state
  at the beginning of each step.
- Coulomb friction without bristle stiffness is the same law. Robots walk as far as on the other
  engines.
- The reset integrator does not exist in MuJoCo. A sticking node is held by the scenario's stiction
  damping. It breaks free at MUJOCO_FRICTION times the normal force, not after a deflection. A
  sliding node has Coulomb friction; with the reset integrator it slides almost freely.

The ground must be a plane, level or inclined, or there is none.
"""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np

from tetra_drake.engines.batch import LoneRobot, Viewer
from tetra_drake.engines.engine import Engine
from tetra_drake.engines.mjcf import check_mjcf, integrator_of, is_pulled, make_mjcf
from tetra_drake.engines.observer import Observer
from tetra_drake.engines.time_limit import check_time
from tetra_drake.errors import Diverged, InputError, StepBudgetExceeded
from tetra_drake.kernels.compiling import compiled
from tetra_drake.kernels.packed import Packed, unpacked
from tetra_drake.laws.actuator import DRIVE, DRIVE_COLUMNS, RATE
from tetra_drake.laws.cable import PASSIVE
from tetra_drake.laws.contact import CONTACT, MODE_COLUMNS
from tetra_drake.laws.forces import Forces, Parts, compute_strut_forces, pull_of_cable
from tetra_drake.results.result import IntegratorWork, SimulationResult, make_result, motion_times
from tetra_drake.results.trajectory import Motion
from tetra_drake.robot.driven import DrivenRobot
from tetra_drake.robot.equilibrium import (
    Unactuated,
    force_at_rest,
    mass_matrix,
    stiffness_at_rest,
)
from tetra_drake.robot.ground import ground_axes
from tetra_drake.robot.readings import Readings, readings_at
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.speed_limit import speed_limit
from tetra_drake.scenario.engine_kinds import Mujoco
from tetra_drake.scenario.scenario import Scenario

Array = np.ndarray

INSTALL = 'pip install "mujoco>=3.13"'

_STRETCH = 5000  # steps between two checks of stability


class MujocoEngine(Engine):
    """Engine that simulates with MuJoCo, in steps of `engine.step`.

    Other Python threads run meanwhile. Samples are taken at the nearest steps.
    """

    def check(self, scenario: Scenario) -> None:
        if not installed():
            raise InputError(scenario.name, "engine", f"mujoco is not installed: {INSTALL}")
        if scenario.cpg.feedback:
            problem = f"found {scenario.cpg.feedback}; mujoco computes signals beforehand"
            raise InputError(scenario.name, "cpg.feedback", problem)
        check_mjcf(scenario)

    def alone(self, robot: DrivenRobot, *, record: bool, viewer: Viewer | None) -> LoneRobot:
        self.check(robot.robot.scenario)
        return _MujocoRobot(robot, record=record)


def is_stable(robot: Robot, step: float) -> bool:
    """True if MuJoCo's steps (s) are stable for the springs and dampers of a robot at its start.

    They are explicit for positions and cables, and stable if step^2 K + 2 step C < 4 M with the
    stiffness K, the damping C and the mass M. So a damper c counts as a spring 2 c / step. All
    cables count as taut. Anchors and struts that touch do not count.
    """
    from scipy.linalg import eigvalsh

    anchors, cables = robot.model.anchors, robot.model.cables
    free = anchors._replace(stiffness=np.zeros_like(anchors.stiffness))
    taut = Unactuated(robot.model._replace(slack=False, anchors=free))
    force_at_rest(taut, robot.structure.initial_state)
    taut.forces.near_struts.count[:] = 0
    stiffer = cables.law._replace(stiffness=cables.law.stiffness + 2.0 / step * cables.law.damping)
    taut.model = taut.model._replace(cables=cables._replace(law=stiffer))
    return bool(eigvalsh(step**2 * stiffness_at_rest(taut), mass_matrix(taut)).max() < 4.0)


def installed() -> bool:
    """True if MuJoCo is installed, in a version with rollouts."""
    try:
        from mujoco.rollout import Rollout  # noqa: F401
    except ImportError:
        return False
    return True


class _Simulator:
    """MuJoCo's model of a robot, and its simulation."""

    def __init__(self, driven: DrivenRobot) -> None:
        import mujoco

        if mujoco.get_mju_user_warning() is None:
            # Otherwise MuJoCo prints warnings of instability, also to a file in the working folder.
            # The handler is not restored, because other threads may be simulating.
            mujoco.set_mju_user_warning(lambda message: None)
        self._mujoco: Any = mujoco
        robot = driven.robot
        self._robot = robot
        self.pulled = is_pulled(robot)
        """True if the law of the other engines computes the tensions at each step."""
        self._touches = robot.model.strut_contact.acts
        self.stepped = self.pulled or self._touches
        """True if a law of the other engines computes forces at each step."""
        self._parts = Packed((robot.model, Forces.of(robot.model)))
        model = make_mjcf(robot, own_laws=True)
        try:
            self._model = mujoco.MjModel.from_xml_string(model)
        except ValueError as error:
            problem = f"mujoco refuses the robot: {' '.join(str(error).split())}"
            raise InputError(robot.scenario.name, "robot", problem) from error
        self._data = mujoco.MjData(self._model)
        self._step = robot.scenario.settings_of(Mujoco).step
        self._speed_limit = speed_limit(driven)
        names = [robot.structure.node_names[node] for node in robot.structure.contacts]
        self._contact_of_geom = {self._model.geom(name).id: i for i, name in enumerate(names)}
        self._contacts = [self._model.site(name).id for name in names]
        of_cables = robot.structure.cables["signal"]
        self._motors = of_cables[of_cables != PASSIVE]  # index of each motor's signal

    def start(self) -> Array:
        """MuJoCo's state at the start."""
        kind = self._mujoco.mjtState.mjSTATE_FULLPHYSICS
        state = np.empty(self._mujoco.mj_stateSize(self._model, kind))
        self._mujoco.mj_getState(self._model, self._mujoco.MjData(self._model), state, kind)
        return state

    def roll_out(self, rollout: Any, state: Array, signals: Array) -> Array:
        """MuJoCo's states (time, qpos, qvel) after each step from a state, with a row of signals
        (steps, n) for each step."""
        controls = np.zeros((len(signals), self._model.nu))  # 0 for anchors and loads
        controls[:, : self._motors.size] = signals[:, self._motors]
        (states,), _ = rollout.rollout(self._model, [self._data], state, controls)
        return states

    def step_through(self, state: Array, signals: Array, drives: Array) -> tuple[Array, Array]:
        """MuJoCo's states after each step from a state, as roll_out(), and the drives (steps,
        drives) of the actuators. `drives` (drives,) are those at the state."""
        mujoco, model, data = self._mujoco, self._model, self._data
        kind, drives = mujoco.mjtState.mjSTATE_FULLPHYSICS, drives.copy()
        states = np.empty((len(signals), state.size))
        all_drives = np.empty((len(signals), drives.size))
        mujoco.mj_setState(model, data, state, kind)
        for k, row in enumerate(signals):
            mujoco.mj_step1(model, data)
            self._push(data, row, drives, self._step)
            mujoco.mj_step2(model, data)
            mujoco.mj_getState(model, data, states[k], kind)
            all_drives[k] = drives
        return states, all_drives

    def _push(self, data: Any, signals: Array, drives: Array, step: float) -> None:
        """Sets the forces between struts, and the controls for signals (n,) in N. Advances the
        drives by a step (s)."""
        if self._touches:
            velocity, force = data.qvel.reshape(-1, 6), np.empty(data.qvel.size)
            poses, turns = np.hstack([data.xquat, data.xpos])[1:], data.cvel[1:, :3]
            state = np.concatenate([poses.ravel(), np.hstack([turns, velocity[:, :3]]).ravel()])
            compute_strut_forces(self._parts, state, 0.0, force)
            data.xfrc_applied[1:] = np.roll(force.reshape(-1, 6), 3, axis=1)
        if not self.pulled:
            data.ctrl[: self._motors.size] = signals[self._motors]
            return
        lengths, rates = data.ten_length, data.ten_velocity
        pull_cables(self._parts, lengths, rates, signals, step, drives, data.ctrl[: lengths.size])

    def check(self, states: Array, first: int) -> None:
        """Raises Diverged if a body is too fast or MuJoCo found instability. `states` are after
        step `first` and the following ones."""
        v_WB = states[:, 1 + self._model.nq :].reshape(len(states), -1, 6)[:, :, :3]
        fast = ~(np.abs(v_WB).max(axis=(1, 2)) <= self._speed_limit)
        if fast.any():
            raise Diverged.too_fast(time=float(states[fast.argmax(), 0]), limit=self._speed_limit)
        # An unstable simulation starts again from time 0, or stops.
        times = self._step * (first + 1.0 + np.arange(len(states)))
        warned = np.abs(states[:, 0] - times) > 0.5 * self._step
        if warned.any():
            reason = "MuJoCo warns of instability"
            raise Diverged(time=float(times[warned.argmax()]), reason=reason)

    def body_states(self, states: Array) -> Array:
        """States [q; v] (rows, 13 bodies) from MuJoCo's states. MuJoCo's angular velocities are in
        the body's frame."""
        rows, end = len(states), 1 + self._model.nq
        pose = states[:, 1:end].reshape(rows, -1, 7)
        velocity = states[:, end:].reshape(rows, -1, 6)
        scalar, vector, w_WB_B = pose[..., 3:4], pose[..., 4:], velocity[..., 3:]
        turn = 2.0 * np.cross(vector, w_WB_B)
        w_WB = w_WB_B + scalar * turn + np.cross(vector, turn)
        parts = (pose[..., 3:], pose[..., :3]), (w_WB, velocity[..., :3])
        return np.hstack([np.concatenate(part, axis=2).reshape(rows, -1) for part in parts])

    def motion(self, times: Array, states: Array, signals: Array, drives: Array) -> Motion:
        """Motion from MuJoCo's states at `times` (s), with their signals and drives."""
        data = self._mujoco.MjData(self._model)
        rows = zip(states, signals, drives, strict=True)
        ground_forces = np.array([self._ground_forces(data, *row) for row in rows])
        modes = np.zeros((*ground_forces.shape[:2], MODE_COLUMNS))
        modes[:, :, CONTACT] = ground_forces[:, :, 2] > 0.0
        return Motion(times, self.body_states(states), signals, modes, drives, ground_forces)

    def _ground_forces(self, data: Any, state: Array, signals: Array, drives: Array) -> Array:
        """MuJoCo's contact forces on the nodes along t1, t2 and n (contacts, 3), in N."""
        mujoco, model = self._mujoco, self._model
        mujoco.mj_setState(model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        mujoco.mj_step1(model, data)
        self._push(data, signals, drives.copy(), 0.0)
        mujoco.mj_forward(model, data)
        forces, wrench = np.zeros((len(self._robot.structure.contacts), 3)), np.zeros(6)
        for i, contact in enumerate(data.contact):
            mujoco.mj_contactForce(model, data, i, wrench)
            node = self._contact_of_geom[contact.geom[1]]  # geom 0 is the floor
            forces[node] += contact.frame.reshape(3, 3).T @ wrench[:3]
        nodes = data.site_xpos[self._contacts]
        axes = ground_axes(nodes, self._robot.ground)
        return (axes @ forces[:, :, None])[:, :, 0]


class _MujocoRobot(LoneRobot):
    """A robot in MuJoCo, which is simulated in stretches."""

    def __init__(self, driven: DrivenRobot, *, record: bool) -> None:
        """Raises StepBudgetExceeded if the duration has too many steps, Diverged if a step is too
        long."""
        self.driven, self._record, robot = driven, record, driven.robot
        settings, self.step = robot.scenario.simulation, robot.scenario.settings_of(Mujoco).step
        self.steps = max(1, round(settings.duration / self.step))
        if self.steps > settings.max_evaluations:
            reason = f"{self.steps} steps exceed the budget of {settings.max_evaluations}"
            raise StepBudgetExceeded(time=0.0, reason=reason)
        self.times = motion_times(settings, record=record)
        """Times (s) of the samples."""
        self.signals = np.zeros((len(self.times), robot.structure.signals))
        """Signals (times, m) in N of the samples."""
        self._steps_kept = np.rint(self.times / self.step).astype(int)
        self._simulator, self._observer = _Simulator(driven), Observer(driven)
        if not is_stable(robot, self.step):
            reason = f"engine.step, {self.step:g} s, is too long for the robot's springs or dampers"
            raise Diverged(time=0.0, reason=reason)
        self._state = self._simulator.start()
        self._kept = np.tile(self._state, (len(self.times), 1))
        self._drives = robot.starting_drives()
        self._drives_kept = np.tile(self._drives, (len(self.times), 1))
        self._done, self.wall_time = 0, 0.0
        self._before = self._held = robot.first_signals
        self._is_held = False
        self._began = self._paused = 0.0

    def copied(self) -> _MujocoRobot:
        copy = _MujocoRobot(self.driven, record=self._record)
        observer = copy._observer
        observer.follow(self._observer)
        own = {name: value.copy() for name, value in vars(self).items() if isinstance(value, Array)}
        copy.__dict__.update(vars(self) | own | {"_observer": observer})
        return copy

    def hold(self, signals: Array) -> None:
        self._before, self._held, self._began = self._held, signals.copy(), self._paused
        self._is_held = True

    def advance_to(self, time: float) -> None:
        """Simulates the steps that begin before a time (s). Raises Diverged."""
        last = min(self.steps, math.ceil(time / self.step - 1e-6))
        self._paused = time
        self.run(self._signals_at(self.step * np.arange(self._done, last + 1)))

    def _signals_at(self, times: Array) -> Array:
        """Signals (times, m) in N at times (s) after the latest pause."""
        if not self._is_held:
            return self.driven.signals_at(times)
        change = self.driven.robot.scenario.cpg.listing_step
        left = 1.0 - np.clip((times - self._began) / change, 0.0, 1.0)[:, np.newaxis]
        return self._held - left * (self._held - self._before)

    def run(self, signals: Array) -> None:
        """Simulates steps with signals (steps + 1, m) in N at their beginnings and at the end of
        the last. Raises Diverged."""
        from mujoco.rollout import Rollout

        started, simulator = time.perf_counter(), self._simulator
        if self._done == 0 and len(signals) > 1:
            self.signals[0] = signals[0]
            start = simulator.body_states(self._kept[:1])
            self._observer.add(np.zeros(1), start, signals[:1], self._drives[np.newaxis])
        with Rollout(nthread=0) as rollout:
            for first in range(0, len(signals) - 1, _STRETCH):
                check_time()
                some, after = signals[first:-1][:_STRETCH], signals[first + 1 :][:_STRETCH]
                if simulator.stepped:
                    states, drives = simulator.step_through(self._state, some, self._drives)
                else:
                    states = simulator.roll_out(rollout, self._state, some)
                    drives = np.empty((len(states), 0))
                self._state, self._drives, done = states[-1], drives[-1], self._done
                here = (done < self._steps_kept) & (self._steps_kept <= done + len(states))
                rows = self._steps_kept[here] - done - 1
                self._kept[here], self.signals[here] = states[rows], after[rows]
                self._drives_kept[here] = drives[rows]
                times = self.step * np.arange(done + 1, done + len(states) + 1)
                self._observer.add(times, simulator.body_states(states), after, drives)
                simulator.check(states, done)
                self._done += len(states)
        self.wall_time += time.perf_counter() - started

    def readings(self) -> Readings:
        now = np.array([self.step * self._done])
        signals = self._signals_at(now)
        moment = self._simulator.motion(
            now, self._state[np.newaxis], signals, self._drives[np.newaxis]
        )
        assert moment.ground_forces is not None
        return readings_at(
            self.driven.robot,
            time=float(now[0]),
            state=moment.states[0],
            modes=moment.modes[0],
            signals=signals[0],
            drives=self._drives,
            ground_forces=moment.ground_forces[0],
        )

    def result(self) -> SimulationResult:
        robot, signals = self.driven.robot, self.signals
        if not self._is_held:  # known at the times themselves
            signals = self.driven.signals_at(self.times)
        return make_result(
            self.driven,
            self._simulator.motion(self.times, self._kept, signals, self._drives_kept),
            totals=self._observer.totals(),
            work=IntegratorWork(
                scheme=integrator_of(robot, pulled=self._simulator.pulled),
                accuracy=self.step,
                steps=self.steps,
                derivative_evaluations=self.steps,
            ),
            wall_time=self.wall_time,
            record=self._record,
        )


@compiled
def pull_cables(
    parts: Parts,
    lengths: Array,
    rates: Array,
    signals: Array,
    step: float,
    drives: Array,
    tensions: Array,
) -> None:
    """Writes the tensions (cables,) in N, and advances the drives (drives,) by a step (s).

    `lengths` (cables,) are in m, their `rates` in m/s, `signals` (n,) in N.
    """
    robot, _ = unpacked(parts)
    drive, table = 0, np.zeros((drives.size, DRIVE_COLUMNS))
    table[:, DRIVE] = drives
    for i in range(tensions.size):
        tensions[i], _, drive = pull_of_cable(robot, i, drive, lengths[i], rates[i], signals, table)
    drives += step * table[:, RATE]


ENGINE = MujocoEngine()
