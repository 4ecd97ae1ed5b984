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

import bisect
import itertools
import math
import operator
from time import perf_counter
from typing import Any

import numpy as np

from tetra_drake.engines.engine import SAME_TIME, Engine, Viewer
from tetra_drake.engines.mjcf import check_mjcf, integrator_of, is_pulled, make_mjcf
from tetra_drake.engines.observer import Observer
from tetra_drake.engines.time_limit import check_time
from tetra_drake.errors import Diverged, InputError, SimulationFailure, StepBudgetExceeded
from tetra_drake.kernels.compiling import compiled
from tetra_drake.kernels.packed import Packed, unpacked
from tetra_drake.laws.actuator import DRIVE, DRIVE_COLUMNS, RATE
from tetra_drake.laws.cable import LENGTH, PASSIVE, steepest
from tetra_drake.laws.contact import CONTACT, MODE_COLUMNS
from tetra_drake.laws.forces import Forces, Parts, compute_strut_forces, pull_of_cable
from tetra_drake.results.result import IntegratorWork, SimulationResult, make_result, motion_times
from tetra_drake.results.trajectory import Motion
from tetra_drake.robot.command import signals_of_one
from tetra_drake.robot.equilibrium import (
    Unactuated,
    force_at_rest,
    mass_matrix,
    stiffness_at_rest,
)
from tetra_drake.robot.ground import ground_axes
from tetra_drake.robot.readings import Readings, readings_at
from tetra_drake.robot.robot import Phase, Robot
from tetra_drake.robot.signals import DrivenRobot, interpolated
from tetra_drake.robot.speed_limit import speed_limit
from tetra_drake.robot.structure import rotated, turned_back
from tetra_drake.scenario.engine_kinds import Mujoco
from tetra_drake.scenario.world import World

Array = np.ndarray

INSTALL = 'pip install "mujoco>=3.13"'

_STRETCH = 5000  # steps between two checks of stability


class MujocoEngine(Engine):
    """Engine `mujoco`: simulates with MuJoCo, in steps of the scenario's `engine.step` (s).

    Other Python threads run meanwhile. Samples of the motion are taken at the ends of the steps
    that are nearest to their times.
    """

    def check(self, scenario: World) -> None:
        if not installed():
            raise InputError(scenario.name, "engine", f"mujoco is not installed: {INSTALL}")
        if scenario.cpg.feedback:
            problem = f"found {scenario.cpg.feedback}; mujoco computes signals beforehand"
            raise InputError(scenario.name, "cpg.feedback", problem)
        if keys := scenario.robot.blueprint().rubbing:
            problem = "has friction at rings or in a joint, which mujoco cannot simulate"
            raise InputError(scenario.name, f"robot.{keys[0]}", problem)
        check_mjcf(scenario)

    def simulate(
        self, robot: DrivenRobot, *, record: bool = False, viewer: Viewer | None = None
    ) -> SimulationResult:
        self.check(robot.robot.scenario)
        return _MujocoRobot(robot, record=record).simulated()


def is_stable(robot: Robot, step: float) -> bool:
    """True if MuJoCo's steps of length `step` (s) are stable for the springs and dampers of a robot
    at its start.

    The steps are explicit for positions and cables. They are stable if step^2 K + 2 step C < 4 M
    with the stiffness K, the damping C and the mass M. So a damper c counts as a spring 2 c / step.
    All cables count as taut. Anchors and struts that touch do not count.
    """
    from scipy.linalg import eigvalsh

    anchors, cables = robot.model.anchors, robot.model.cables
    free = anchors._replace(stiffness=np.zeros_like(anchors.stiffness))
    taut = Unactuated(robot.model._replace(slack=False, anchors=free))
    force_at_rest(taut, robot.structure.initial_state)
    taut.forces.near_struts.count[:] = 0
    law, lengths = cables.law, taut.forces.cable_forces[:, LENGTH]
    stiffness = steepest(lengths - law.free_length, law) + 2.0 / step * law.damping
    stiffer = law._replace(stiffness=stiffness, curve=law.curve._replace(pieces=0))
    taut.model = taut.model._replace(cables=cables._replace(law=stiffer))
    stiffness = stiffness_at_rest(taut).toarray()
    return bool(eigvalsh(step**2 * stiffness, mass_matrix(taut)).max() < 4.0)


def installed() -> bool:
    """True if MuJoCo is installed in a version that this engine can use."""
    try:
        from mujoco.rollout import Rollout  # noqa: F401
    except ImportError:
        return False
    return True


class _MujocoRobot:
    """Simulation of one robot in MuJoCo from start to end, with many steps in each call of MuJoCo.

    A policy or a controller is asked between calls. After an event, the simulation goes on with
    MuJoCo's model of the changed robot, from the same state.
    """

    def __init__(self, driven: DrivenRobot, *, record: bool) -> None:
        """Raises StepBudgetExceeded if the duration has too many steps, Diverged if a step is too
        long, and InputError if MuJoCo refuses the robot."""
        import mujoco

        self._driven, self._record, self._robot = driven, record, driven.robot
        robot = self._robot
        settings, self._step = robot.scenario.simulation, robot.scenario.settings_of(Mujoco).step
        self._steps = max(1, round(settings.duration / self._step))
        if self._steps > settings.max_evaluations:
            reason = f"{self._steps} steps exceed the budget of {settings.max_evaluations}"
            raise StepBudgetExceeded(time=0.0, reason=reason)
        if mujoco.get_mju_user_warning() is None:
            # Otherwise MuJoCo prints warnings of instability, also to a file in the working folder.
            # The handler is not restored, because other threads may be simulating.
            mujoco.set_mju_user_warning(lambda message: None)
        self._mujoco: Any = mujoco
        self._make_model()
        self._whole_state = mujoco.mjtState.mjSTATE_FULLPHYSICS
        self._state = np.empty(mujoco.mj_stateSize(self._model, self._whole_state))
        mujoco.mj_getState(self._model, self._data, self._state, self._whole_state)
        self._drives = robot.starting_drives()
        self._speed_limit, self._observer = speed_limit(driven), Observer(driven)
        self._motions: list[Motion] = []
        """The motion up to the latest event, in parts."""
        self._known = 0
        """Number of samples in these parts."""
        of_cables = robot.structure.cables["signal"]
        self._motors = of_cables[of_cables != PASSIVE]  # index of each motor's signal

        self._times = motion_times(settings, record=record)
        self._due = np.rint(self._times / self._step).astype(int)  # numbers of the sampled steps
        count = len(self._times)
        self._states_kept = np.tile(self._state, (count, 1))
        self._drives_kept = np.tile(self._drives, (count, 1))

        self._done, self._bends = 0, [(0.0, robot.first_signals)]
        """Number of simulated steps; times (s) and signals (m,) in N of a policy or controller,
        which are linear in between and held at the end."""

    def _make_model(self) -> None:
        """Makes MuJoCo's model of the present robot, at its start."""
        mujoco, robot = self._mujoco, self._robot
        self._pulled, self._touches = is_pulled(robot), robot.model.strut_contact.acts
        self._parts = Packed((robot.model, Forces.of(robot.model)))
        try:
            self._model = mujoco.MjModel.from_xml_string(make_mjcf(robot, own_laws=True))
        except ValueError as error:
            problem = f"mujoco refuses the robot: {' '.join(str(error).split())}"
            raise InputError(robot.scenario.name, "robot", problem) from error
        if not is_stable(robot, self._step):
            problem = "is too long for the robot's springs or dampers"
            raise Diverged(time=0.0, reason=f"engine.step, {self._step:g} s, {problem}")
        self._data = mujoco.MjData(self._model)
        if self._model.nkey:
            mujoco.mj_resetDataKeyframe(self._model, self._data, 0)

    def simulated(self) -> SimulationResult:
        """The result at the end of the simulation. Raises Diverged."""
        pilot, scenario = self._driven.pilot, self._driven.robot.scenario
        changes = [*itertools.pairwise(self._driven.robot.phases)]
        action = pilot.acts_after(0.0) if pilot else math.inf
        end, started = scenario.simulation.duration, perf_counter()
        try:
            while (now := min(action, changes[0][1].begins if changes else end)) < end:
                self._advance_to(now)
                if pilot and action <= now + SAME_TIME:
                    held, signals = self._bends[-1][1], signals_of_one(pilot, self._readings())
                    self._bends += [(now, held), (now + scenario.cpg.listing_step, signals)]
                    action = pilot.acts_after(action)
                while changes and changes[0][1].begins <= now + SAME_TIME:
                    self._become(*changes.pop(0))
            self._advance_to(end)
        except SimulationFailure as failure:
            failure.wall_time = perf_counter() - started
            raise
        wall_time = perf_counter() - started
        return make_result(
            self._driven,
            Motion.joined([*self._motions, self._kept(slice(self._known, None))]),
            totals=self._observer.tally,
            work=IntegratorWork(
                scheme=integrator_of(self._robot, pulled=self._pulled),
                accuracy=self._step,
                steps=self._steps,
                derivative_evaluations=self._steps,
            ),
            wall_time=wall_time,
            record=self._record,
        )

    def _become(self, before: Phase, phase: Phase) -> None:
        """Goes on with the robot of another phase in place of this one; see Phase.entered()."""
        robot, passed = phase.robot, int(np.searchsorted(self._times, phase.begins, side="right"))
        self._motions.append(self._kept(slice(self._known, passed)))
        self._robot, self._known = robot, passed
        self._make_model()
        self._observer.follow(robot)
        # The last step may end after the event, with a sample.
        self._state = self._moved(self._state[np.newaxis], before, phase)[0]
        self._states_kept[passed:] = self._moved(self._states_kept[passed:], before, phase)

    def _moved(self, states: Array, before: Phase, phase: Phase) -> Array:
        """MuJoCo's states (rows, numbers) at the beginning of a phase; see Phase.entered()."""
        old, moved = self._body_states(states), states.copy()
        after, bodies = phase.entered(old, before), np.arange(len(phase.p_BC))[:, np.newaxis]
        p, v = 7 * bodies + np.arange(3), self._model.nq + 6 * bodies + np.arange(3)
        q_WB = after[:, 7 * bodies + np.arange(4)]
        moved[:, 1 + p], moved[:, 1 + v] = after[:, 4 + p], after[:, 3 + v]
        moved[:, 4 + v] += turned_back(q_WB, after[:, v] - old[:, v])  # 0 without a push
        return moved

    def _advance_to(self, time: float) -> None:
        """Simulates the steps that begin before a time (s), from the present one on. Raises
        Diverged."""
        from mujoco.rollout import Rollout

        rounding = min(1e-6, 5e-10 / self._step)  # readings there are of this time, to 1e-9 s
        last = min(self._steps, math.ceil(time / self._step - rounding))
        signals = self._signals_at(self._step * np.arange(self._done, last + 1))
        if self._done == 0 and len(signals) > 1:
            start = self._body_states(self._state[np.newaxis])
            self._observer.add(np.zeros(1), start, signals[:1], self._drives[np.newaxis])
        with Rollout(nthread=0) as rollout:
            for first in range(0, len(signals) - 1, _STRETCH):
                check_time()
                some, after = signals[first:-1][:_STRETCH], signals[first + 1 :][:_STRETCH]
                states, drives = self._stepped(rollout, some)
                self._state, self._drives, done = states[-1], drives[-1], self._done
                here = (done < self._due) & (self._due <= done + len(states))
                rows = self._due[here] - done - 1
                self._states_kept[here], self._drives_kept[here] = states[rows], drives[rows]
                times = self._step * np.arange(done + 1, done + len(states) + 1)
                self._observer.add(times, self._body_states(states), after, drives)
                v_WB = states[:, 1 + self._model.nq :].reshape(len(states), -1, 6)[:, :, :3]
                fast = ~(np.abs(v_WB).max(axis=(1, 2)) <= self._speed_limit)
                if fast.any():
                    at = float(states[fast.argmax(), 0])
                    raise Diverged.too_fast(time=at, limit=self._speed_limit)
                # An unstable simulation starts again from time 0, or stops.
                warned = np.abs(states[:, 0] - times) > 0.5 * self._step
                if warned.any():
                    at, reason = float(times[warned.argmax()]), "MuJoCo warns of instability"
                    raise Diverged(time=at, reason=reason)
                self._done += len(states)

    def _signals_at(self, times: Array) -> Array:
        """Signals (times, m) in N at simulated times (s) (times,)."""
        if not self._driven.pilot:
            return self._driven.signals_at(times)
        earliest = np.min(times, initial=math.inf)
        first = max(0, bisect.bisect_right(self._bends, earliest, key=operator.itemgetter(0)) - 1)
        bends, signals = zip(*self._bends[first:], strict=True)
        return interpolated(times, bends, signals)

    def _stepped(self, rollout: Any, signals: Array) -> tuple[Array, Array]:
        """Simulates one step for each row of signals (steps, m) in N, from the present state.
        Returns the results after each step: MuJoCo's states with the columns time, qpos and qvel
        (steps, numbers), and the actuators' states (steps, drives)."""
        mujoco, model, data = self._mujoco, self._model, self._data
        if not (self._pulled or self._touches):
            controls = np.zeros((len(signals), model.nu))  # 0 for anchors and loads
            controls[:, : self._motors.size] = signals[:, self._motors]
            (states,), _ = rollout.rollout(model, [data], self._state, controls)
            return states, np.empty((len(states), 0))
        drives = self._drives.copy()
        states = np.empty((len(signals), self._state.size))
        all_drives = np.empty((len(signals), drives.size))
        mujoco.mj_setState(model, data, self._state, self._whole_state)
        for k, row in enumerate(signals):
            mujoco.mj_step1(model, data)
            self._push(data, row, drives, self._step)
            mujoco.mj_step2(model, data)
            mujoco.mj_getState(model, data, states[k], self._whole_state)
            all_drives[k] = drives
        return states, all_drives

    def _push(self, data: Any, signals: Array, drives: Array, step: float) -> None:
        """Writes the forces between struts, and the motors' controls for signals (m,) in N, to
        MuJoCo's `data`. Advances the actuators' states `drives` (drives,) in place by a step
        (s)."""
        if self._touches:
            velocity, force = data.qvel.reshape(-1, 6), np.empty(data.qvel.size)
            poses, turns = np.hstack([data.xquat, data.xpos])[1:], data.cvel[1:, :3]
            state = np.concatenate([poses.ravel(), np.hstack([turns, velocity[:, :3]]).ravel()])
            compute_strut_forces(self._parts, state, 0.0, force)
            data.xfrc_applied[1:] = np.roll(force.reshape(-1, 6), 3, axis=1)
        if not self._pulled:
            data.ctrl[: self._motors.size] = signals[self._motors]
            return
        lengths, rates = data.ten_length, data.ten_velocity
        pull_cables(self._parts, lengths, rates, signals, step, drives, data.ctrl[: lengths.size])

    def _body_states(self, states: Array) -> Array:
        """States [q; v] (rows, 13*bodies), as Drake orders them, from MuJoCo's states (rows,
        numbers). MuJoCo's angular velocities are in the body's frame, the returned ones in the
        world's."""
        rows, bodies, end = len(states), self._model.nv // 6, 1 + self._model.nq
        pose = states[:, 1:end].reshape(rows, bodies, 7)
        velocity = states[:, end:].reshape(rows, bodies, 6)
        w_WB = rotated(pose[..., 3:], velocity[..., 3:])
        q = np.concatenate([pose[..., 3:], pose[..., :3]], axis=2).reshape(rows, 7 * bodies)
        v = np.concatenate([w_WB, velocity[..., :3]], axis=2).reshape(rows, 6 * bodies)
        return np.hstack([q, v])

    def _motion(self, times: Array, states: Array, signals: Array, drives: Array) -> Motion:
        """Motion from MuJoCo's states (rows, numbers) at `times` (rows,) in s, with MuJoCo's
        contact forces. `signals` (rows, m) are in N, `drives` (rows, drives) are the actuators'
        states."""
        mujoco, model, data = self._mujoco, self._model, self._mujoco.MjData(self._model)
        ground, structure = self._robot.ground, self._robot.structure
        names = [structure.node_names[node] for node in structure.contacts]
        contact_of_geom = {model.geom(f"foot {name}").id: i for i, name in enumerate(names)}
        sites, wrench = [model.site(name).id for name in names], np.zeros(6)
        ground_forces = np.zeros((len(times), len(names), 3))  # along t1, t2 and n
        for row, state in enumerate(states):
            mujoco.mj_setState(model, data, state, self._whole_state)
            mujoco.mj_step1(model, data)
            self._push(data, signals[row], drives[row].copy(), 0.0)
            mujoco.mj_forward(model, data)
            forces = np.zeros((len(names), 3))
            for i, contact in enumerate(data.contact):
                mujoco.mj_contactForce(model, data, i, wrench)
                node = contact_of_geom[contact.geom[1]]  # geom 0 is the floor
                forces[node] += contact.frame.reshape(3, 3).T @ wrench[:3]
            axes = ground_axes(data.site_xpos[sites], ground)
            ground_forces[row] = (axes @ forces[:, :, None])[:, :, 0]
        modes = np.zeros((*ground_forces.shape[:2], MODE_COLUMNS))
        modes[:, :, CONTACT] = ground_forces[:, :, 2] > 0.0
        return Motion(times, self._body_states(states), signals, modes, drives, ground_forces)

    def _readings(self) -> Readings:
        """The readings of the robot at its present time, without the axis of robots."""
        now = np.array([self._step * self._done])
        signals = self._signals_at(now)
        moment = self._motion(now, self._state[np.newaxis], signals, self._drives[np.newaxis])
        assert moment.ground_forces is not None
        return readings_at(
            self._robot,
            time=float(now[0]),
            state=moment.states[0],
            modes=moment.modes[0],
            signals=signals[0],
            drives=self._drives,
            ground_forces=moment.ground_forces[0],
        )

    def _kept(self, rows: slice) -> Motion:
        """The motion of the present robot at some of the times of the samples."""
        times, signals = self._times[rows], self._signals_at(self._times[rows])
        return self._motion(times, self._states_kept[rows], signals, self._drives_kept[rows])


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
    """Writes the cables' tensions in N to `tensions` (cables,), by the law of the other engines.

    Advances the states of the actuators `drives` (drives,) in place by a step (s).

    `parts` has the robot's model. `lengths` (cables,) are in m, their `rates` in m/s, positive if a
    cable becomes longer. `signals` (m,) in N are the actuator signals.
    """
    robot, _ = unpacked(parts)
    table = np.zeros((drives.size, DRIVE_COLUMNS))
    table[:, DRIVE] = drives
    for i in range(tensions.size):
        tensions[i], _ = pull_of_cable(robot, i, lengths[i], rates[i], signals, table)
    drives += step * table[:, RATE]


ENGINE = MujocoEngine()
