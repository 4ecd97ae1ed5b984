"""Engine `mujoco`: the same robot in MuJoCo (https://mujoco.org), modelled as MuJoCo's users do.

Bodies, cables, actuation and gravity are the same as in the other engines. The ground differs: it
is MuJoCo's soft contact with a friction cone.

- Actuators with drives (winches and tension motors): each cable's tension is computed by the law of
  the other engines, from MuJoCo's lengths at the beginning of each step. Otherwise cables are
  MuJoCo's own tendons.
- Normal force: the stiffness is the scenario's. The damping is constant; in the other engines it
  grows with depth. Both agree at the depth of a robot in equilibrium.
- Contact of struts: capsules with the scenario's stiffness. The damping is constant, too.
- Coulomb friction without bristle stiffness is the same law. Robots walk as far as on the other
  engines.
- The reset integrator does not exist in MuJoCo. A sticking node is held by the scenario's stiction
  damping. It breaks free at MUJOCO_FRICTION times the normal force, not after a deflection. A
  sliding node has Coulomb friction; with the reset integrator it slides almost freely.

The ground must be a plane, level or inclined, or there is none.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np
from pydrake.multibody.tree import RotationalInertia

from tetra_drake.engines.gait_simulation import Driver, GaitSimulation
from tetra_drake.engines.interface import Engine, Outcome
from tetra_drake.engines.observer import Observer
from tetra_drake.engines.stepper import SerialStepper
from tetra_drake.engines.time_limit import check_time
from tetra_drake.errors import Diverged, InputError, SimulationFailure, StepBudgetExceeded
from tetra_drake.physics.actuator import Actuator, actuator_force, has_drive
from tetra_drake.physics.cable import PASSIVE, Cables, cable_tension, law_of
from tetra_drake.physics.contact import CONTACT, MODE_COLUMNS, NormalForce
from tetra_drake.physics.inertia import XX
from tetra_drake.results.result import IntegratorWork, SimulationResult, make_result, motion_times
from tetra_drake.results.trajectory import Motion
from tetra_drake.robot.ground import ground_axes
from tetra_drake.robot.readings import Readings, readings_at
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.signals import signals_at
from tetra_drake.robot.structure import Structure, node_positions
from tetra_drake.scenario.engine_kinds import Mujoco
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.simd.compiling import compiled

Array = np.ndarray

INSTALL = 'pip install "mujoco>=3.13"'

_IMPRATIO = 1000.0
"""MuJoCo's option impratio: the ratio of the impedances of friction and normal force. In MuJoCo a
slipping node gets a part, 1 / impratio, of the force that would hold it as normal force. With the
default 1, nodes are thrown up and chatter."""
_IMPEDANCE = 1.0 / (1.0 + _IMPRATIO)
"""Impedance of contacts. It adds inertia to a contact: the body's mass along the ground, which
keeps friction stable in long steps, and 1 / _IMPRATIO of the mass along the normal."""
_POINT = 1e-8  # radius (m) of the spheres that touch the floor; larger ones spin thin bars
_ALONE = {"contype": "0", "conaffinity": "0"}  # only the pairs in `contact` can touch
_FLOOR = 0  # index of the floor's geom
_STRETCH = 5000  # steps between two checks of stability
_OBSERVED = 8  # steps from one observation to the next; 1 ms with the default step
INTEGRATOR = "implicitfast"
"""Name of MuJoCo's integrator."""
MAX_SPEED = 1.0
"""Largest speed of a body (m/s) of a robot that starts on the ground; less than in other engines.
With too long a step a robot is thrown about, sometimes far forward. A walking robot stays below
0.2 m/s. A robot that may roll over can be faster by the speed of a fall from its own height."""


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
        if scenario.terrain.plane_slope is None:
            kind = type(scenario.terrain).__name__
            problem = f"found !{kind}, but mujoco simulates planes: !Flat, !Incline, or !Nothing"
            raise InputError(scenario.name, "terrain", problem)
        scenario.friction.cone(scenario.name)  # raises InputError for a law without a cone

    def simulate(self, simulation: GaitSimulation) -> SimulationResult:
        robot, gait, steering = simulation.robot, simulation.gait, simulation.steering
        self.check(robot.scenario)
        walk = _MujocoWalk(simulation)
        signals = signals_at(robot, gait, walk.step * np.arange(walk.steps), steering=steering)
        walk.run(signals)
        walk.signals[:] = signals_at(robot, gait, walk.times, steering=steering)
        return walk.result()

    def stepper(self, first: GaitSimulation, *, count: int, threads: int) -> SerialStepper:
        self.check(first.robot.scenario)
        return SerialStepper(_MujocoWalk, first.robot.structure, count=count)

    def simulate_many(
        self, simulations: Sequence[tuple[Scenario, Driver]], *, record: bool, threads: int
    ) -> list[Outcome]:
        with ThreadPoolExecutor(threads) as pool:
            return list(pool.map(lambda each: self.outcome(*each, record=record), simulations))


def installed() -> bool:
    """True if MuJoCo is installed, in a version with rollouts."""
    try:
        from mujoco.rollout import Rollout  # noqa: F401
    except ImportError:
        return False
    return True


def make_mjcf(robot: Robot) -> str:
    """The robot and its ground in MuJoCo's XML format, with one motor per driven cable. If the
    actuators have drives, tendons have no law, and a motor for each cable exerts its tension."""
    scenario = robot.scenario
    model = Element("mujoco", model=scenario.name)
    steps = {"integrator": INTEGRATOR, "timestep": scenario.settings_of(Mujoco).step}
    _add(model, "compiler", inertiafromgeom="false")
    contact = {"cone": "elliptic", "impratio": _IMPRATIO}
    _add(model, "option", gravity=[0.0, 0.0, -scenario.robot.gravity], **contact, **steps)
    world = _add(model, "worldbody")
    if scenario.terrain.is_ground:
        _add_floor(world, robot)
    _add_fixed_nodes(world, robot.structure)
    _add_bodies(model, world, robot)
    if robot.model.strut_contact.acts:
        _add_strut_contacts(model, robot)
    _add_cables(model, robot)
    _add_pushes(model, world, robot.structure)
    return tostring(model, encoding="unicode")


class _Simulator:
    """MuJoCo's model of a robot, and its simulation."""

    def __init__(self, robot: Robot) -> None:
        import mujoco

        if mujoco.get_mju_user_warning() is None:
            # Otherwise MuJoCo prints warnings of instability, also to a file in the working folder.
            # The handler is not restored, because other threads may be simulating.
            mujoco.set_mju_user_warning(lambda message: None)
        self._mujoco: Any = mujoco
        self._robot = robot
        try:
            self._model = mujoco.MjModel.from_xml_string(make_mjcf(robot))
        except ValueError as error:
            problem = f"mujoco refuses the robot: {' '.join(str(error).split())}"
            raise InputError(robot.scenario.name, "robot", problem) from error
        self._data = mujoco.MjData(self._model)
        self._step = robot.scenario.settings_of(Mujoco).step
        heights = node_positions(robot.structure, robot.structure.initial_state)[:, 2]
        height = max(0.0, heights.min() if robot.structure.points_ahead else heights.max())
        fall = math.sqrt(2.0 * robot.scenario.robot.gravity * height)
        self._max_speed = MAX_SPEED + fall
        nodes = [robot.structure.node_names[node] for node in robot.structure.contacts]
        self._contact_of_geom = {self._model.geom(name).id: i for i, name in enumerate(nodes)}
        driven = robot.structure.cables["signal"]
        self._motors = driven[driven != PASSIVE]  # index of each motor's signal
        self.has_drives = has_drive(robot.model.actuator)
        """True if the actuators have states."""
        names = np.array(robot.structure.node_names)[robot.structure.contacts]
        self._contacts = [self._model.site(name).id for name in names]

    def start(self) -> Array:
        """MuJoCo's state at the start."""
        kind = self._mujoco.mjtState.mjSTATE_FULLPHYSICS
        state = np.empty(self._mujoco.mj_stateSize(self._model, kind))
        self._mujoco.mj_getState(self._model, self._mujoco.MjData(self._model), state, kind)
        return state

    def roll_out(self, rollout: Any, state: Array, signals: Array) -> Array:
        """MuJoCo's states (time, qpos, qvel) after each step from a state, with a row of signals
        (steps, n) for each step."""
        (states,), _ = rollout.rollout(self._model, [self._data], state, self._controls(signals))
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
            self._pull(data, row, drives, self._step)
            mujoco.mj_step2(model, data)
            mujoco.mj_getState(model, data, states[k], kind)
            all_drives[k] = drives
        return states, all_drives

    def _pull(self, data: Any, signals: Array, drives: Array, step: float) -> None:
        """Sets the tensions of all cables for signals (n,), and advances the drives by a step
        (s)."""
        robot = self._robot.model
        tensions = data.ctrl[: robot.cables.signal.size]
        pull_cables(
            robot.cables,
            robot.actuator,
            robot.slack,
            data.ten_length,
            data.ten_velocity,
            signals,
            step,
            drives,
            tensions,
        )

    def _controls(self, signals: Array) -> Array:
        """MuJoCo's controls (steps, actuators) for signals (steps, n). Anchors and loads have the
        control 0."""
        controls = np.zeros((len(signals), self._model.nu))
        controls[:, : self._motors.size] = signals[:, self._motors]
        return controls

    def observe(
        self,
        observer: Observer,
        states: Array,
        drives: Array,
        signals: Array,
        *,
        first: int,
        begin: int,
    ) -> None:
        """Passes states to an observer: every _OBSERVED-th one, and the state at the end of the
        start-up. `states` and `drives` are after step `first` and the following ones. `signals`
        begin at step `begin`."""
        begins = round(self._robot.scenario.cpg.start_up / self._step)
        observed = np.arange(first + 1, first + len(states) + 1)
        rows = np.flatnonzero((observed % _OBSERVED == 0) | (observed == begins))
        if not rows.size:
            return
        steps: list[int] = observed[rows].tolist()
        moments = zip(steps, self.body_states(states[rows]), drives[rows], strict=True)
        for step, state, of_step in moments:
            now = signals[min(step - begin, len(signals) - 1)]
            observer.add(self._step * step, state, now, of_step)

    def check(self, states: Array, first: int) -> None:
        """Raises Diverged if a body is too fast or MuJoCo found instability. `states` are after
        step `first` and the following ones."""
        v_WB = states[:, 1 + self._model.nq :].reshape(len(states), -1, 6)[:, :, :3]
        fast = ~(np.abs(v_WB).max(axis=(1, 2)) <= self._max_speed)
        if fast.any():
            reason = f"a body's velocity exceeds the limit of {self._max_speed:.3g} m/s"
            raise Diverged(time=float(states[fast.argmax(), 0]), reason=reason)
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
        if self.has_drives:
            mujoco.mj_step1(model, data)
            self._pull(data, signals, drives.copy(), 0.0)
        else:
            data.ctrl[:] = self._controls(signals[np.newaxis])[0]
        mujoco.mj_forward(model, data)
        forces, wrench = np.zeros((len(self._robot.structure.contacts), 3)), np.zeros(6)
        for i, contact in enumerate(data.contact):
            mujoco.mj_contactForce(model, data, i, wrench)
            if contact.geom[0] == _FLOOR:
                node = self._contact_of_geom[contact.geom[1]]
                forces[node] += contact.frame.reshape(3, 3).T @ wrench[:3]
        nodes = data.site_xpos[self._contacts]
        axes = ground_axes(nodes, self._robot.ground)
        return (axes @ forces[:, :, None])[:, :, 0]


class _MujocoWalk:
    """Simulation of a robot in MuJoCo, in stretches."""

    def __init__(self, simulation: GaitSimulation) -> None:
        """Raises StepBudgetExceeded if the duration has too many steps."""
        self._simulation, robot = simulation, simulation.robot
        settings, self.step = robot.scenario.simulation, robot.scenario.settings_of(Mujoco).step
        self.steps = max(1, round(settings.duration / self.step))
        if self.steps > settings.max_evaluations:
            reason = f"{self.steps} steps exceed the budget of {settings.max_evaluations}"
            raise StepBudgetExceeded(time=0.0, reason=reason)
        self.times = motion_times(settings, record=simulation.record)
        """Times (s) of the samples."""
        self.signals = np.zeros((len(self.times), robot.structure.signals))
        """Signals (times, m) in N of the samples."""
        self._steps_kept = np.rint(self.times / self.step).astype(int)
        self._simulator, self._observer = _Simulator(robot), Observer(robot)
        self._state = self._simulator.start()
        self._kept = np.tile(self._state, (len(self.times), 1))
        self._drives = robot.starting_drives()
        self._drives_kept = np.tile(self._drives, (len(self.times), 1))
        self._done, self._held, self._wall_time = 0, self.signals[0], 0.0

    def hold(self, signals: Array) -> None:
        """Sets the signals (m,) in N from now on."""
        self._held = signals.copy()

    def advance_to(self, time: float) -> None:
        """Simulates to the step that is nearest to a time (s). Raises Diverged."""
        steps = round(time / self.step) - self._done
        self.run(np.tile(self._held, (max(0, steps), 1)))

    def run(self, signals: Array) -> None:
        """Simulates a step for each row of signals (steps, m). Raises Diverged."""
        from mujoco.rollout import Rollout

        started, begin, simulator = time.perf_counter(), self._done, self._simulator
        if begin == 0 and len(signals):
            self.signals[0] = signals[0]
            start = simulator.body_states(self._kept[:1])[0]
            self._observer.add(0.0, start, signals[0], self._drives)
        with Rollout(nthread=0) as rollout:
            for first in range(0, len(signals), _STRETCH):
                check_time()
                some = signals[first : first + _STRETCH]
                if simulator.has_drives:
                    states, drives = simulator.step_through(self._state, some, self._drives)
                else:
                    states = simulator.roll_out(rollout, self._state, some)
                    drives = np.empty((len(states), 0))
                self._state, self._drives, done = states[-1], drives[-1], self._done
                here = (done < self._steps_kept) & (self._steps_kept <= done + len(states))
                rows = self._steps_kept[here] - done - 1
                self._kept[here], self.signals[here] = states[rows], some[rows]
                self._drives_kept[here] = drives[rows]
                simulator.observe(self._observer, states, drives, signals, first=done, begin=begin)
                simulator.check(states, done)
                self._done += len(states)
        self._wall_time += time.perf_counter() - started

    def readings(self) -> Readings:
        """The readings of the robot now."""
        now, signals = np.array([self.step * self._done]), self._held
        last = (self._state[np.newaxis], signals[np.newaxis], self._drives[np.newaxis])
        moment = self._simulator.motion(now, *last)
        assert moment.ground_forces is not None
        return readings_at(
            self._simulation.robot,
            time=float(now[0]),
            state=moment.states[0],
            modes=moment.modes[0],
            signals=signals,
            drives=self._drives,
            ground_forces=moment.ground_forces[0],
        )

    def result(self) -> SimulationResult:
        """The result, at the end. Raises SimulationFailure if a damped cable went slack."""
        robot, totals = self._simulation.robot, self._observer.totals()
        is_damped = robot.structure.cables["damping"].any() and not self._simulator.has_drives
        if robot.model.slack and is_damped and totals.tension.of_all[0] <= 0.0:
            reason = "a cable went slack, and the damper of MuJoCo's tendon would push"
            raise SimulationFailure(time=float(totals.time[0]), reason=reason)
        return make_result(
            robot,
            self._simulation.gait,
            self._simulator.motion(self.times, self._kept, self.signals, self._drives_kept),
            totals=totals,
            work=IntegratorWork(
                scheme=INTEGRATOR,
                accuracy=self.step,
                steps=self.steps,
                derivative_evaluations=self.steps,
            ),
            wall_time=self._wall_time,
            record=self._simulation.record,
        )


@compiled
def pull_cables(
    cables: Cables,
    actuator: Actuator,
    slack: bool,
    lengths: Array,
    rates: Array,
    signals: Array,
    step: float,
    drives: Array,
    tensions: Array,
) -> None:
    """Writes the tensions (cables,) in N, and advances the drives (drives,) by a step (s).

    `lengths` (cables,) are in m, their `rates` in m/s, `signals` (n,) in N. With `slack`, passive
    cables do not push.
    """
    drive = 0
    for i in range(tensions.size):
        law, driver = law_of(cables, i), cables.signal[i]
        if driver == PASSIVE:
            tensions[i] = cable_tension(lengths[i], rates[i], 0.0, law)
            if slack:
                tensions[i] = max(tensions[i], 0.0)
            continue
        driven = actuator_force(actuator, drives[drive], lengths[i], rates[i], signals[driver], law)
        tensions[i] = driven.tension
        drives[drive] += step * driven.rate
        drive += 1


def _add_floor(world: Element, robot: Robot) -> None:
    """Adds the floor: a plane, the first geom."""
    slope = robot.scenario.terrain.plane_slope or 0.0
    pos = [_POINT * math.sin(slope), 0.0, -_POINT * math.cos(slope)]
    quat = [math.cos(slope / 2), 0.0, -math.sin(slope / 2), 0.0]
    _add(world, "geom", name="floor", type="plane", size="0 0 1", pos=pos, quat=quat, **_ALONE)


def _add_fixed_nodes(world: Element, structure: Structure) -> None:
    """Adds a site of the world for each fixed node."""
    for node in range(structure.first_node[-1], len(structure.node_names)):
        _add(world, "site", name=structure.node_names[node], pos=structure.p_BN[node])


def _add_bodies(model: Element, world: Element, robot: Robot) -> None:
    """Adds the bodies: a site at each node, a small sphere at each contact node, and struts."""
    structure, bodies = robot.structure, robot.model.bodies
    pairs = _add(model, "contact")
    for i, body_name in enumerate(structure.bodies):
        pos, quat = structure.p_WB[i], structure.q_WB[i]
        body = _add(world, "body", name=body_name, pos=pos, quat=quat)
        _add(body, "freejoint")
        mass, inertia = bodies.mass[i], bodies.inertia[i]
        is_bar = structure.first_node[i + 1] - structure.first_node[i] == 2
        if is_bar:
            # A bar gets a larger moment of inertia about its axis: the same as across it. A spin
            # about the axis moves no node, and cables cause none. But MuJoCo's contact points are
            # above the nodes by half the depth, so friction would soon spin a thin bar.
            across = np.linalg.eigvalsh(RotationalInertia(*inertia).CopyToFullMatrix3())[-1]
            moments = {"diaginertia": 3 * [across]}
        elif structure.isotropic:
            moments = {"diaginertia": 3 * [inertia[XX]]}
        else:
            moments = {"fullinertia": inertia}
        _add(body, "inertial", pos="0 0 0", mass=mass, **moments)
        contact = _contact(robot, mass)
        for node in range(structure.first_node[i], structure.first_node[i + 1]):
            name, p_BN = structure.node_names[node], structure.p_BN[node]
            _add(body, "site", name=name, pos=p_BN)
            if node in structure.contacts:
                _add(body, "geom", name=name, pos=p_BN, size=_POINT, **_ALONE)
                _add(pairs, "pair", geom1="floor", geom2=name, **contact)
        for strut in np.flatnonzero(structure.carriers[structure.struts[:, 0]] == i):
            ends = structure.p_BN[structure.struts[strut]]
            size = structure.strut_radius[strut]
            geom = {"name": f"strut {strut}", "type": "capsule", "fromto": ends, "size": size}
            _add(body, "geom", **geom, **_ALONE)


def _contact(robot: Robot, mass: float) -> dict:
    """Contact settings for the floor and a body of this mass (kg)."""
    ground = robot.scenario.ground
    cone = robot.scenario.friction.cone(robot.scenario.name)
    borne = robot.weight / _feet(robot)
    rest_damping = ground.damping * borne / ground.stiffness
    # MuJoCo's numbers are per mass, divided by 1 - impedance, and for friction multiplied by
    # impratio. Negative numbers mean stiffness and damping.
    per_mass = -(1.0 - _IMPEDANCE) / mass
    return {
        "condim": "3",
        "friction": [cone.coefficient, cone.coefficient, 0, 0, 0],
        "solref": [ground.stiffness * per_mass, rest_damping * per_mass],
        "solreffriction": [ground.stiffness * per_mass, cone.damping * per_mass / _IMPRATIO],
        "solimp": [_IMPEDANCE, _IMPEDANCE, 1, 0.5, 1],
    }


def _add_strut_contacts(model: Element, robot: Robot) -> None:
    """Adds the contact of all struts of different bodies, without friction."""
    normal = NormalForce(*robot.model.strut_contact.normal)
    rest_damping = normal.damping * robot.weight / normal.stiffness
    bodies = robot.structure.carriers[robot.structure.struts[:, 0]]
    pairs = _add(model, "contact")
    for i, j in itertools.combinations(range(len(bodies)), 2):
        if bodies[i] == bodies[j]:
            continue
        per_mass = (1.0 / robot.structure.mass[bodies[[i, j]]]).sum()
        scale = -(1.0 - _IMPEDANCE) * per_mass
        contact = {
            "condim": "1",
            "solref": [normal.stiffness * scale, rest_damping * scale],
            "solimp": [_IMPEDANCE, _IMPEDANCE, 1, 0.5, 1],
        }
        _add(pairs, "pair", geom1=f"strut {i}", geom2=f"strut {j}", **contact)


def _feet(robot: Robot) -> int:
    """Number of nodes that bear the weight: from the blueprint, or in equilibrium."""
    return robot.structure.feet or max(1, robot.equilibrium.feet)


def _add_cables(model: Element, robot: Robot) -> None:
    """Adds a tendon for each cable and a motor for each driven cable, or for all cables if the
    actuators have drives."""
    structure, has_drives = robot.structure, has_drive(robot.model.actuator)
    tendons, actuators = _add(model, "tendon"), _add(model, "actuator")
    for name, cable in zip(structure.cable_names, structure.cables, strict=True):
        law = {"stiffness": cable["stiffness"], "damping": cable["damping"]}
        least = 0.0 if structure.slack else cable["free_length"]
        springlength = [least, cable["free_length"]]  # the spring exerts no force in between
        own = {} if has_drives else {"springlength": springlength, **law}
        tendon = _add(tendons, "spatial", name=name, **own)
        for node in (cable["node_a"], cable["node_b"]):
            _add(tendon, "site", site=structure.node_names[node])
        if (
            has_drives or cable["signal"] != PASSIVE
        ):  # a motor's force lengthens its tendon, ours shortens it
            _add(actuators, "motor", name=name, tendon=name, gear="-1")


def _add_pushes(model: Element, world: Element, structure: Structure) -> None:
    """Adds an actuator for each axis of an anchor, a spring with damping, and for each component of
    a load, a constant force."""
    actuators, anchors, loads = _add(model, "actuator"), structure.anchors, structure.loads
    laws = np.stack([0.0 * anchors.stiffness, -anchors.stiffness, -anchors.damping], axis=2)
    for node, place, of_axes in zip(anchors.nodes, anchors.places, laws, strict=True):
        _add_push(actuators, world, f"anchor {structure.node_names[node]}", place, of_axes)
    for node, force in zip(loads.nodes, loads.forces, strict=True):
        of_axes = np.outer(force, [1.0, 0.0, 0.0])
        _add_push(actuators, world, f"load {structure.node_names[node]}", np.zeros(3), of_axes)


def _add_push(actuators: Element, world: Element, name: str, place: Array, laws: Array) -> None:
    """Adds an actuator along each axis of the world that pushes the node after the blank of `name`.

    The three numbers of each law are a constant force, and the force per displacement from `place`
    and per velocity.
    """
    _add(world, "site", name=name, pos=place)
    ends = {"site": name.partition(" ")[2], "refsite": name}
    for axis, gear, law in zip("xyz", np.eye(3, 6), laws, strict=True):
        if law.any():
            force = {"gear": gear, "gainprm": "0", "biastype": "affine", "biasprm": law}
            _add(actuators, "general", name=f"{name} {axis}", **ends, **force)


def _add(parent: Element, tag: str, **attributes: Any) -> Element:
    """Adds an XML element. Attributes are texts, numbers or arrays of numbers."""
    text = {
        name: value if isinstance(value, str) else " ".join(map(repr, np.ravel(value).tolist()))
        for name, value in attributes.items()
    }
    return SubElement(parent, tag, text)


ENGINE = MujocoEngine()
