"""The engine `mujoco`: the same robot in MuJoCo (https://mujoco.org), as its users would model it.

Bodies, cables, actuation and gravity are those of the other engines. The ground is MuJoCo's soft
contact with a cone of friction. The normal force has the scenario's stiffness, but constant
damping: the scenario's at the depth of rest on the nodes of the thesis, which otherwise grows with
depth. Coulomb friction without stiffness is the scenario's own, and robots walk as far as on the
other engines. In place of the reset integrator, a node that sticks is held by the scenario's
stiction damping, but breaks free where that exceeds MUJOCO_FRICTION times the normal force, not
after a deflection, and then does not slide almost freely.

The ground is a plane, level or inclined; other terrains are refused.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from typing import Any
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np

from tetra_drake.engines.observer import Observer
from tetra_drake.engines.time_limit import check_time
from tetra_drake.errors import Diverged, InputError, SimulationFailure, StepBudgetExceeded
from tetra_drake.physics.cable import PASSIVE
from tetra_drake.physics.contact import CONTACT, MODE_COLUMNS
from tetra_drake.results.result import IntegratorWork, SimulationResult, make_result, motion_times
from tetra_drake.results.trajectory import Motion
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.ground import ground_axes
from tetra_drake.robot.robot import Robot, SteeringSignal
from tetra_drake.robot.signals import signals_at
from tetra_drake.robot.structure import Structure
from tetra_drake.scenario.engine_kinds import MUJOCO_FRICTION, Mujoco
from tetra_drake.scenario.friction_kinds import Coulomb
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.terrain_kinds import Flat, Incline, Terrain

Array = np.ndarray

INSTALL = 'pip install "mujoco>=3.13"'

_IMPEDANCE = 0.5
"""Damping of contacts. Nothing at rest depends on it, nor do converged distances by over 0.01 in;
with a smaller one friction chatters in steps beyond 0.06 ms, with a larger one errors grow."""

_POINT = 1e-5  # radius (m) of the spheres that touch the floor, which acts on the nodes' centres

_ALONE = {"contype": "0", "conaffinity": "0"}  # only the pairs of `contact` touch each other

_STRETCH = 5000  # steps between two checks of whether a simulation is still stable

_OBSERVED = 8  # steps from one observation to the next: with the default step, 1 ms

_GAITS = 8  # for each thread at a time; each takes some 10 MB, mostly for a stretch of states

INTEGRATOR = "implicitfast"
"""Integrator of MuJoCo."""

MAX_SPEED = 1.0
"""Top speed of a body (m/s), less than in other engines. Too long a step throws a robot about,
at times far forward; a walking robot stays below 0.2 m/s."""


def simulate_mujoco(
    robot: Robot, gait: Gait, *, record: bool, steering: SteeringSignal | None = None
) -> SimulationResult:
    """Simulates a gait as simulate() does, in MuJoCo, in steps of `engine.step`.

    Instants asked for, as of samples, are those of the nearest steps. Other threads run meanwhile.
    Raises InputError, too, if MuJoCo is missing or cannot do it.
    """
    (outcome,) = simulate_in_rollouts(robot, [gait], record=record, threads=1, steering=steering)
    if isinstance(outcome, SimulationFailure):
        raise outcome
    return outcome


def simulate_in_rollouts(
    robot: Robot,
    gaits: Sequence[Gait],
    *,
    record: bool,
    threads: int,
    steering: SteeringSignal | None = None,
) -> list[SimulationResult | SimulationFailure]:
    """Simulates gaits as simulate_mujoco() does, on so many threads of MuJoCo's `Rollout`: the
    same numbers, bit for bit; for a gait that fails its Diverged or StepBudgetExceeded."""
    scenario = robot.scenario
    check_mujoco(scenario)
    simulation, step = scenario.simulation, scenario.settings_of(Mujoco).step
    steps = max(1, round(simulation.duration / step))
    if steps > simulation.max_evaluations:
        reason = f"{steps} steps exceed the budget of {simulation.max_evaluations}"
        return [StepBudgetExceeded(time=0.0, reason=reason) for _ in gaits]
    times, starts = motion_times(simulation, record=record), step * np.arange(steps)
    simulator = _Simulator(robot)
    outcomes: list[SimulationResult | SimulationFailure] = []
    for first in range(0, len(gaits), threads * _GAITS):
        group = gaits[first : first + threads * _GAITS]
        signals = [signals_at(robot, gait, starts, steering=steering) for gait in group]
        observers = [Observer(robot) for _ in group]
        started = time.perf_counter()
        wanted = np.rint(times / step).astype(int)
        courses = simulator.simulate(signals, wanted, observers, threads=threads)
        wall_time = (time.perf_counter() - started) * min(threads, len(group)) / len(group)
        for gait, course, observer in zip(group, courses, observers, strict=True):
            if isinstance(course, Diverged):
                course.wall_time = wall_time
                outcomes.append(course)
                continue
            driving = signals_at(robot, gait, times, steering=steering)
            result = make_result(
                robot,
                simulator.motion(times, course, driving),
                totals=observer.totals(),
                work=IntegratorWork(INTEGRATOR, step, steps, steps),
                wall_time=wall_time,
                record=record,
            )
            outcomes.append(result)
    return outcomes


def installed() -> bool:
    """True if a MuJoCo with rollouts is installed."""
    try:
        from mujoco.rollout import Rollout  # noqa: F401
    except ImportError:
        return False
    return True


def make_mjcf(robot: Robot) -> str:
    """The robot and its ground in MuJoCo's format, with one motor per driven cable."""
    scenario = robot.scenario
    model = Element("mujoco", model=scenario.name)
    steps = {"integrator": INTEGRATOR, "timestep": scenario.settings_of(Mujoco).step}
    _add(model, "compiler", inertiafromgeom="false")
    _add(model, "option", gravity=[0.0, 0.0, -scenario.robot.gravity], cone="elliptic", **steps)
    world = _add(model, "worldbody")
    _add_floor(world, robot)
    _add_bodies(model, world, robot)
    _add_cables(model, robot.structure)
    return tostring(model, encoding="unicode")


class _Simulator:
    """MuJoCo with its model of a robot."""

    def __init__(self, robot: Robot) -> None:
        import mujoco

        if mujoco.get_mju_user_warning() is None:
            # MuJoCo would print that a simulation is unstable, and append it to a file in the
            # working folder. Not set back: other threads may be simulating.
            mujoco.set_mju_user_warning(lambda message: None)
        self._mujoco: Any = mujoco
        self._robot = robot
        try:
            self._model = mujoco.MjModel.from_xml_string(make_mjcf(robot))
        except ValueError as error:
            problem = f"mujoco refuses the robot: {' '.join(str(error).split())}"
            raise InputError(robot.scenario.name, "robot", problem) from error
        driven = robot.structure.cables["signal"]
        self._motors = driven[driven != PASSIVE]  # the signal of each motor

    def simulate(
        self,
        signals: Sequence[Array],
        wanted: Array,
        observers: Sequence[Observer],
        *,
        threads: int,
    ) -> list[Array | Diverged]:
        """Simulates gaits by their signals (steps, n); MuJoCo's states (time, qpos, qvel) after
        each of the `wanted` steps, or how a gait failed. Each gait has its observer."""
        from mujoco.rollout import Rollout

        data = [self._mujoco.MjData(self._model) for _ in range(threads)]
        kind = self._mujoco.mjtState.mjSTATE_FULLPHYSICS
        start = np.empty(self._mujoco.mj_stateSize(self._model, kind))
        self._mujoco.mj_getState(self._model, data[0], start, kind)
        found = np.tile(start, (len(signals), len(wanted), 1))
        for own, observer in zip(signals, observers, strict=True):
            observer.add(0.0, self.states(start[np.newaxis])[0], own[0])
        latest = dict.fromkeys(range(len(signals)), start)  # of gaits that have not failed
        failures: dict[int, Diverged] = {}
        with Rollout(nthread=threads if threads > 1 else 0) as rollout:
            for first in range(0, len(signals[0]), _STRETCH):
                chosen = [signals[i][first : first + _STRETCH, self._motors] for i in latest]
                if not chosen:
                    break
                check_time()
                initial = np.array(list(latest.values()))
                stretches, _ = rollout.rollout(self._model, data, initial, np.array(chosen))
                here = (first < wanted) & (wanted <= first + len(chosen[0]))
                for i, states in zip(list(latest), stretches, strict=True):
                    found[i, here] = states[wanted[here] - first - 1]
                    latest[i] = states[-1]
                    self._observe(observers[i], states, signals[i], first)
                    if failure := self._failure(states, first):
                        failures[i] = failure
                        del latest[i]
        return [failures.get(i, states) for i, states in enumerate(found)]

    def _observe(self, observer: Observer, states: Array, signals: Array, first: int) -> None:
        """Shows an observer every _OBSERVED-th of the states after step `first` and the next."""
        chosen = np.arange(_OBSERVED - 1, len(states), _OBSERVED)
        if not chosen.size:
            return
        steps = np.minimum(first + chosen + 1, len(signals) - 1)
        step = self._robot.scenario.settings_of(Mujoco).step
        for k, (at, state) in enumerate(zip(steps, self.states(states[chosen]), strict=True)):
            observer.add(step * (first + chosen[k] + 1), state, signals[at])

    def _failure(self, states: Array, first: int) -> Diverged | None:
        """Failure that the states after step `first` and the next ones show, if any."""
        step = self._robot.scenario.settings_of(Mujoco).step
        v_WB = states[:, 1 + self._model.nq :].reshape(len(states), -1, 6)[:, :, :3]
        fast = ~(np.abs(v_WB).max(axis=(1, 2)) <= MAX_SPEED)
        if fast.any():
            reason = f"a body's velocity exceeds the limit of {MAX_SPEED:g} m/s"
            return Diverged(time=float(states[fast.argmax(), 0]), reason=reason)
        # Where MuJoCo warns of instability, it starts again from time 0, or stops.
        times = step * (first + 1.0 + np.arange(len(states)))
        warned = np.abs(states[:, 0] - times) > 0.5 * step
        if warned.any():
            reason = "MuJoCo warns of instability"
            return Diverged(time=float(times[warned.argmax()]), reason=reason)
        return None

    def states(self, found: Array) -> Array:
        """[q; v] (rows, 13 bodies) of MuJoCo's states, where w is given in the body's frame."""
        rows, nq = len(found), 1 + self._model.nq
        pose, velocity = found[:, 1:nq].reshape(rows, -1, 7), found[:, nq:].reshape(rows, -1, 6)
        scalar, vector, w_WB_B = pose[..., 3:4], pose[..., 4:], velocity[..., 3:]
        turn = 2.0 * np.cross(vector, w_WB_B)
        w_WB = w_WB_B + scalar * turn + np.cross(vector, turn)
        parts = (pose[..., 3:], pose[..., :3]), (w_WB, velocity[..., :3])
        return np.hstack([np.concatenate(part, axis=2).reshape(rows, -1) for part in parts])

    def motion(self, times: Array, found: Array, signals: Array) -> Motion:
        """The motion in MuJoCo's states at `times` (s), driven by the signals."""
        data = self._mujoco.MjData(self._model)
        rows = zip(found, signals, strict=True)
        pushes = np.array([self._ground_forces(data, *row) for row in rows])
        modes = np.zeros((*pushes.shape[:2], MODE_COLUMNS))  # of friction: 0, as there are none
        modes[:, :, CONTACT] = pushes[:, :, 2] > 0.0
        return Motion(times, self.states(found), signals, modes, pushes)

    def _ground_forces(self, data: Any, found: Array, signals: Array) -> Array:
        """(contacts, 3): MuJoCo's contact forces on the nodes along t1, t2 and n, in N."""
        mujoco, model = self._mujoco, self._model
        mujoco.mj_setState(model, data, found, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        data.ctrl[:] = signals[self._motors]
        mujoco.mj_forward(model, data)
        forces, wrench = np.zeros((len(self._robot.structure.contacts), 3)), np.zeros(6)
        for i, contact in enumerate(data.contact):
            mujoco.mj_contactForce(model, data, i, wrench)
            # The floor is geom 0; those of the contact nodes follow in their order.
            forces[contact.geom[1] - 1] += contact.frame.reshape(3, 3).T @ wrench[:3]
        nodes = data.site_xpos[self._robot.structure.contacts]
        axes = ground_axes(nodes, self._robot.ground)
        return (axes @ forces[:, :, None])[:, :, 0]


def check_mujoco(scenario: Scenario) -> None:
    """Raises InputError if MuJoCo cannot simulate the scenario."""
    if not installed():
        raise InputError(scenario.name, "engine", f"mujoco is not installed: {INSTALL}")
    if scenario.cpg.feedback:
        problem = f"found {scenario.cpg.feedback}; mujoco computes signals beforehand"
        raise InputError(scenario.name, "cpg.feedback", problem)
    if not _is_plane(scenario.terrain):
        kind = type(scenario.terrain).__name__
        problem = f"found !{kind}, but mujoco simulates planes: !Flat, !Incline without start"
        raise InputError(scenario.name, "terrain", problem)
    if scenario.cables.slack:
        raise InputError(scenario.name, "cables.slack", "found true, which mujoco cannot simulate")
    if isinstance(law := scenario.friction, Coulomb):
        possible = {"static": law.kinetic, "stiffness": 0.0}
        possible |= {"forward": 1.0, "backward": 1.0, "lateral": 1.0}
        for name, value in possible.items():
            if (found := getattr(law, name)) != value:
                problem = f"found {found:g}, but mujoco can simulate only {value:g}"
                raise InputError(scenario.name, f"friction.{name}", problem)


def _is_plane(terrain: Terrain) -> bool:
    return isinstance(terrain, Flat) or (isinstance(terrain, Incline) and terrain.start is None)


def _add_floor(world: Element, robot: Robot) -> None:
    """The floor, a plane, which is geom 0."""
    slope = getattr(robot.scenario.terrain, "slope", 0.0)
    pos = [_POINT * math.sin(slope), 0.0, -_POINT * math.cos(slope)]
    turned = {"pos": pos, "quat": robot.structure.q_WB}
    _add(world, "geom", name="floor", type="plane", size="0 0 1", **turned, **_ALONE)


def _add_bodies(model: Element, world: Element, robot: Robot) -> None:
    """The tetrahedra, with a site at each node, and spheres on those that touch the floor."""
    structure, contact = robot.structure, _contact(robot)
    pairs, names = _add(model, "contact"), iter(enumerate(structure.node_names))
    mass, moment = robot.model.body.mass[0], robot.model.body.moment[0]
    for body_name, p_WB in zip(structure.bodies, structure.p_WB, strict=True):
        body = _add(world, "body", name=body_name, pos=p_WB, quat=structure.q_WB)
        _add(body, "freejoint")
        _add(body, "inertial", pos="0 0 0", mass=mass, diaginertia=3 * [moment])
        for p_BN in structure.p_BN:
            node, name = next(names)
            _add(body, "site", name=name, pos=p_BN)
            if node in structure.contacts:
                _add(body, "geom", name=name, pos=p_BN, size=_POINT, **_ALONE)
                _add(pairs, "pair", geom1="floor", geom2=name, **contact)


def _contact(robot: Robot) -> dict:
    """Contact settings of the floor."""
    ground, law = robot.scenario.ground, robot.scenario.friction
    if isinstance(law, Coulomb):
        friction, stiction_damping = law.kinetic, law.damping
    else:
        friction, stiction_damping = MUJOCO_FRICTION, law.stiction_damping
    mass, bodies = robot.model.body.mass[0], len(robot.structure.bodies)
    borne = robot.weight / (2 * bodies + 1)  # by a foot of the thesis's
    rest_damping = ground.damping * borne / ground.stiffness
    # MuJoCo takes accelerations for forces, and divides them by 1 - impedance. The minus says
    # that the numbers are stiffness and damping.
    per_mass = -(1.0 - _IMPEDANCE) / mass
    return {
        "condim": "3",
        "friction": [friction, friction, 0, 0, 0],
        "solref": [ground.stiffness * per_mass, rest_damping * per_mass],
        "solreffriction": [ground.stiffness * per_mass, stiction_damping * per_mass],
        "solimp": [_IMPEDANCE, _IMPEDANCE, 1, 0.5, 1],
    }


def _add_cables(model: Element, structure: Structure) -> None:
    """A tendon for each cable, and a motor for each that is driven."""
    tendons, actuators = _add(model, "tendon"), _add(model, "actuator")
    for name, cable in zip(structure.cable_names, structure.cables, strict=True):
        law = {"stiffness": cable["stiffness"], "damping": cable["damping"]}
        tendon = _add(tendons, "spatial", name=name, springlength=cable["free_length"], **law)
        for node in (cable["node_a"], cable["node_b"]):
            _add(tendon, "site", site=structure.node_names[node])
        if cable["signal"] != PASSIVE:  # a motor's force lengthens its tendon, ours shortens it
            _add(actuators, "motor", name=name, tendon=name, gear="-1")


def _add(parent: Element, tag: str, **attributes: Any) -> Element:
    """A new element; its attributes are text, numbers or arrays of numbers."""
    text = {
        name: value if isinstance(value, str) else " ".join(map(repr, np.ravel(value).tolist()))
        for name, value in attributes.items()
    }
    return SubElement(parent, tag, text)
