"""Simulation of robots in control periods: robots are reset, stepped, and read."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import hashlib
import json
import threading
from collections.abc import Iterator, Sequence
from typing import Any, NoReturn, TypeGuard

import numpy as np
import numpy.typing as npt

from tetra_drake.engines.engine import check_engine
from tetra_drake.engines.lanes.batch import LaneBatch
from tetra_drake.errors import (
    InputError,
    SimulationFailure,
    check_type,
    check_whole,
    checked_numbers,
)
from tetra_drake.lab.stepping.states import States
from tetra_drake.laws.cable import NUMBERS, CableLaw
from tetra_drake.machine import threads_for
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.command import checked_actions, checked_period, controlled_robot
from tetra_drake.robot.readings import Readings, first_readings
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.sensors import Sensors, shown
from tetra_drake.robot.signals import MARK_DECIMALS, DrivenRobot
from tetra_drake.scenario.disturbances import disturbed, draw_disturbances
from tetra_drake.scenario.events import Event, check_taken
from tetra_drake.scenario.load import GivenScenario, dump_scenario, given_scenario

MOST_ROBOTS = 100_000
"""Largest number of robots side by side."""

Indices = Sequence[int] | np.ndarray | None
"""Indices of robots; None for all."""

_UNDISTURBED = json.dumps({"seed": None, "damage": []})
"""Identity of a robot without disturbances and damage; see Simulation._robot_of()."""


class Simulation:
    """Robots side by side that a program controls: it reads them and sets their actuators. The
    compiled engine simulates them.

        >>> simulation = td.Simulation(td.load_scenario("coulomb"), count=4)
        >>> driven, readings = simulation.robot.driven, simulation.reset(seed=1)
        >>> while not simulation.ended.all():
        ...     readings = simulation.step(simulation.rest + 3.0 * readings.rates[:, driven])
        >>> inches = [simulation.result(place).metrics.distance_in for place in range(4)]

    Each driven cable has an action: the setpoint of its actuator, by the kind of `actuation`. It is
    a force (N) of !Force, a free length (m) of a !Winch, a tension (N) of a !TensionMotor. The
    order is the same as in `robot.driven`, oscillator by oscillator. An action is held for a
    control period. Like a sample of a command, it begins with a linear change from the last action
    that takes one `cpg.listing_step`; the first action acts from the start on. There is no network
    and no start-up time. Steps with the samples of a command give the motion of
    simulate(command=...), if each sample differs from the one before.

    The readings that methods return are what the sensors show, with the errors of `sensing`;
    `state` is exact.

    One thread at a time may use a simulation. If a step is interrupted, as by Ctrl-C, reset() puts
    all robots at their start; until then the other methods refuse. A simulation can be used after a
    fork of the process. It cannot be copied or pickled.
    """

    def __init__(
        self,
        scenario: GivenScenario,
        *,
        count: int = 1,
        control_period: float | None = None,
        record: bool = False,
        workers: int | None = None,
        name: str = "controller",
    ) -> None:
        """Puts robots at their start; see reset().

        Args:
            scenario: a scenario of the compiled engine, its name or file, or a run.
            count: number N of robots.
            control_period: time (s) between actions, a multiple of `cpg.listing_step`; by default
                `simulation.control_period`.
            record: records the trajectories, for result().
            workers: number of threads; one per core by default.
            name: name of the results.

        Raises:
            InputError: if an argument does not fit the scenario, or its engine is another one.
        """
        self.scenario = scenario = given_scenario(scenario)
        advice = "use on_engine('compiled'), or simulate(controller=...)"
        check_engine(scenario, "compiled", f"no other engine steps robots; {advice}")
        self.robot: Robot = controlled_robot(scenario)
        """The robot without disturbances. Its structure has the names of nodes and cables."""
        self._first_readings = first_readings(self.robot)
        check_whole("Simulation", "count", count, least=1, most=MOST_ROBOTS)
        threads = threads_for(workers, source="Simulation")
        check_type("Simulation", "record", record, bool)
        check_type("Simulation", "name", name, str)
        self.control_period = checked_period(control_period, scenario)
        """Time (s) between actions."""
        self._listing_steps = round(self.control_period / scenario.cpg.listing_step)
        self.count = count
        """Number of robots."""
        self._name, self._record = name, record
        self._robots, self._identities = [self.robot] * count, [_UNDISTURBED] * count
        self._new_batch = functools.partial(
            LaneBatch, self._driven(self.robot), places=count, record=record, threads=threads
        )
        self._batch = self._new_batch()
        self._owner, self._is_whole = threading.RLock(), True
        shape = count, self.robot.driven.size
        self._law: Any = CableLaw(*np.empty((len(NUMBERS), *shape)))
        self._steps = np.zeros(count, dtype=int)
        self._sensors: dict[int, Sensors] = {}
        """Sensors of the robots by their places; none without a section `sensing`."""
        self.rest: np.ndarray = np.empty(shape)
        """Actions (N, actions) at the start, where the robots rest."""
        self.reset()

    @property
    def failures(self) -> list[SimulationFailure | None]:
        """Failure of each robot (N,): Diverged or StepBudgetExceeded; None if there is none.

        A robot that has failed keeps its last readings and ignores actions until it is reset.
        """
        return self._batch.failures

    @property
    def state(self) -> Readings:
        """The exact readings of all robots now."""
        with self._used("state"):
            return self._batch.readings.copied()

    def _seen(self) -> Readings:
        """What the sensors of all robots show now; without a section `sensing`, the state."""
        return shown(self.state, self._sensors)

    @property
    def ended(self) -> np.ndarray:
        """True for each robot (N,) that has failed, or reached `simulation.duration`."""
        return self._batch.ended

    @property
    def rolled(self) -> np.ndarray:
        """Angle (N,) in rad by which each robot has rolled forward since its start, whole turns
        included, as in the metric of this name."""
        return np.where(self._steps > 0, self._batch.rolled, 0.0)

    def reset(
        self,
        *,
        seed: int | Sequence[int] | None = None,
        indices: Indices = None,
    ) -> Readings:
        """Puts robots at their start, and returns the readings of all robots.

        Args:
            seed: seed of the scenario's disturbances and of the errors of its sensors, which are
                different for each robot. Or a seed for each robot, as for a robot alone. None for
                robots without disturbances.
            indices: the robots; all by default.

        Raises:
            InputError: if the seed or an index is wrong.
        """
        places = self._places(indices)
        given: Sequence[Any] = seed if is_list(seed) else [seed] * len(places)
        if len(given) != len(places):
            problem = f"found {len(given)} seeds, expected one, or one for each of {len(places)}"
            raise InputError("Simulation", "seed", problem)
        if seed is not None:
            given = [check_whole("Simulation", "seed", each, least=0) for each in given]

        with self._used("reset", is_whole=self._is_whole or len(set(places)) == self.count):
            identities = [_UNDISTURBED] * len(places)
            if seed is not None and (self.scenario.disturbances or self.scenario.sensing):
                numbers_of_robots = [0] * len(places) if is_list(seed) else places
                seeds = zip(given, numbers_of_robots, strict=True)
                identities = [json.dumps({"seed": each, "damage": []}) for each in seeds]
            robots = [self._robot_of(identity) for identity in identities]
            if not self._is_whole:
                self._batch = self._new_batch()
            self._is_whole = False
            for place, identity, robot in zip(places, identities, robots, strict=True):
                self._put(place, identity, robot)
                if robot.scenario.sensing:
                    self._sensors[place] = Sensors(robot.scenario, self.control_period)
                self._batch.stop(place)
                self._steps[place] = 0
                first = self._first_readings if robot is self.robot else first_readings(robot)
                self._batch.readings.put(place, first)
            self._is_whole = True
            return self._seen()

    def step(self, actions: npt.ArrayLike, *, indices: Indices = None) -> Readings:
        """Simulates one control period, and returns the readings of all robots.

        The last period ends at `simulation.duration`.

        Args:
            actions: the actions (N, actions); of a single robot also (actions,).
            indices: the robots that go on; all by default. The others pause, and their actions may
                be anything.

        Raises:
            InputError: if the shape is wrong, an action is not finite, or a robot has reached the
                end.
        """
        with self._used("step"):
            goes = np.zeros(self.count, dtype=bool)
            goes[self._places(indices)] = True
            goes &= [failure is None for failure in self.failures]
            given = checked_actions(actions, self.rest.shape, source="Simulation")
            given[~goes] = 0.0
            checked_actions(given, given.shape, source="Simulation", finite=True)
            if (late := goes & self.ended).any():
                end = f"the end at {self.scenario.simulation.duration:g} s"
                problem = f"robot {late.argmax()} has reached {end}; reset it"
                raise InputError("Simulation", "step", problem)

            signals = np.asarray(self.scenario.actuation.signals(given, self._law))
            for place in np.flatnonzero(goes & (self._steps == 0)).tolist():
                robot, first = self._robots[place], signals[place].copy()
                self._begin(place, self._driven(dataclasses.replace(robot, first_signals=first)))
            self._is_whole = False
            self._batch.advance(np.where(goes, self._time_after(self._steps + 1), 0.0), signals)
            self._steps[goes] += 1
            self._is_whole = True
            return self._seen()

    def result(self, place: int = 0) -> SimulationResult:
        """Result of robot number `place`, after it has reached the end. Raises its failure if it
        failed, and InputError if it has not ended."""
        (place,) = self._places([place])
        if not self.ended[place]:
            time = float(self._batch.readings.time[place])
            problem = f"robot {place} is at {time:g} s; its result exists at the end"
            raise InputError("Simulation", "result", problem)
        with self._used("result"):
            return self._batch.result(place)

    def save(self, places: Indices = None, *, history: bool = False) -> States:
        """States of robots, from which they or others can go on; see restore() and States.

            >>> simulation = td.Simulation(td.load_scenario("coulomb"))
            >>> now = simulation.save()
            >>> pull = simulation.rest + 3.0
            >>> one = simulation.step(pull)
            >>> other = simulation.restore(now)
            >>> same = simulation.step(pull)

        A state is all that a robot is: positions and velocities, stick points and contact modes,
        states of the actuators, held signals, sums for metrics, its disturbances, damage and passed
        events. A robot that has failed keeps its failure. The recorded motion and the wall time are
        not in it.

        Args:
            places: the robots, by their indices; all by default.
            history: also saves the motion so far, which result() needs after restore().

        Raises:
            InputError: if an index is wrong, or a motion is not known.
        """
        which = self._places(places)
        check_type("Simulation", "history", history, bool)
        with self._used("save"):
            for place in which:
                if self._steps[place] == 0:
                    self._begin(place, self._driven(self._robots[place]))
            tables = self._batch.save(which, history=history)
            for name in Readings._fields if self._sensors else ():
                rows = [[getattr(one, name) for one in self._sensors[k].recent] for k in which]
                tables[f"sensors.{name}"] = np.array(rows)
            return States(
                scenario=self.scenario.name,
                identity=self._identity,
                robots=tuple(self._identities[place] for place in which),
                tables=tables | {"pause": self._time_after(self._steps[which])},
                record=self._record if history else None,
            )

    def restore(self, states: States, places: Indices = None) -> Readings:
        """Puts robots into saved states, and returns the readings of all robots.

        A restored robot goes on bit for bit as if it had not stopped, in any place, also of another
        simulation of the same scenario.

        Args:
            states: states of save(): one for each robot, or a single one for all.
            places: the robots, by their indices; all by default.

        Raises:
            InputError: if the states are of another scenario, version or control period, if their
                number or an index is wrong, or if they have a motion with other samples.
        """
        which = self._places(places)
        check_type("Simulation", "states", states, States)
        states.check_version("Simulation")
        if states.identity != self._identity:
            problem = f"found states of another scenario, {states.scenario}"
            raise InputError("Simulation", "states", f"{problem}, expected {self.scenario.name}")
        if states.record not in (None, self._record):
            problem = f"have a motion of record={states.record}, expected {self._record}"
            raise InputError("Simulation", "states", problem)
        if len(states) not in (1, len(which)):
            problem = f"found {len(states)} states, expected one, or one for each of {len(which)}"
            raise InputError("Simulation", "states", problem)
        for name, table in {**self._batch.save([0], history=False), "pause": np.zeros(1)}.items():
            given = states.tables.get(name, np.zeros(0))
            if (given.dtype, given.shape) != (table.dtype, (len(states), *table.shape[1:])):
                raise InputError("Simulation", f"states.{name}", "is no table of states")
        states = states[[0] * len(which)] if len(states) == 1 else states
        own, identities = states.tables, states.robots
        steps = self._steps_until(own["pause"])
        with self._used("restore"):
            known = dict(zip(self._identities, self._robots, strict=True))
            robots = {each: known.get(each) or self._robot_of(each) for each in {*identities}}
            driven = {identity: self._driven(robot) for identity, robot in robots.items()}
            self._is_whole = False
            for place, identity in zip(which, identities, strict=True):
                is_other = identity != self._identities[place]
                if is_other:
                    self._put(place, identity, robots[identity])
                if is_other or self._steps[place] == 0 or self.failures[place]:
                    self._begin(place, driven[identity])
            self._batch.restore(which, own)
            for row, place in enumerate(which if self._sensors else ()):
                sensors = Sensors(self._robots[place].scenario, self.control_period)
                self._sensors[place] = sensors
                recent = [own[f"sensors.{name}"][row] for name in Readings._fields]
                sensors.recent = [Readings(*each) for each in zip(*recent, strict=True)]
            self._steps[which] = steps
            self._is_whole = True
            return self._seen()

    def copy(self, place: int, *, to: Indices, history: bool = False) -> Readings:
        """Puts robots into the state of robot number `place`, and returns the readings of all.

            >>> simulation = td.Simulation(td.load_scenario("coulomb"), count=8)
            >>> one = simulation.step(simulation.rest, indices=[0])
            >>> readings = simulation.copy(0, to=range(1, 8))

        Args:
            place: index of the robot that is copied.
            to: indices of the robots that become like it.
            history: also copies the motion so far, which result() needs.

        Raises:
            InputError: if an index is wrong.
        """
        return self.restore(self.save([place], history=history), to)

    def damage(self, place: int, *, cables: Sequence[str]) -> None:
        """Cuts cables of a robot now, like an event of a scenario.

            >>> simulation = td.Simulation(td.load_scenario("coulomb"))
            >>> one = simulation.step(simulation.rest)
            >>> simulation.damage(0, cables=["T1-T2 outer top"])

        A cut cable has no tension, and its actuator turns freely. The damage is a part of the
        robot's state; see save(). reset() repairs the robot.

        Args:
            place: index of the robot.
            cables: names of the cables.

        Raises:
            InputError: if the robot has ended, or a name is wrong or the cable cut already.
        """
        (place,) = self._places([place])
        check_type("Simulation", "cables", cables, list, tuple)
        if self.ended[place]:
            problem = f"robot {place} has failed, or reached the end; reset it"
            raise InputError("Simulation", "damage", problem)
        with self._used("damage"):
            at = float(self._batch.readings.time[place])
            robot = _damaged(self._robots[place], at, cables)
            identity = json.loads(self._identities[place])
            identity["damage"].append([at, list(cables)])
            self._put(place, json.dumps(identity), robot)
            if self._steps[place] > 0:
                self._batch.change(place, self._driven(robot))

    def damage_of(self, place: int) -> list[str]:
        """Names of the cables of a robot that damage() has cut since its start."""
        (place,) = self._places([place])
        return [name for _, cut in json.loads(self._identities[place])["damage"] for name in cut]

    def assume(self, readings: Readings, *, place: int = 0) -> None:
        """Puts a robot into the motion of given readings, for example of a robot on another engine,
        or of a real one.

        The readings have no axis of robots, and a time that is a multiple of the control period.
        Positions and velocities are as in the readings. The contact nodes that touch the ground
        stick where they are, as at the start: the bending of their bristles is not known. The
        actuators keep the states that they have.

        Raises:
            InputError: if the robot is another one, or the index or the time is wrong.
        """
        (place,) = self._places([place])
        for name, given, own in zip(Readings._fields, readings, self._batch.readings, strict=True):
            checked_numbers(given, own.shape[1:], source="Simulation", key=f"readings.{name}")
        steps = self._steps_until(np.array([readings.time]))[0]
        if steps == 0:
            problem = f"found the time {readings.time} s, expected one after the start"
            raise InputError("Simulation", "assume", problem)
        with self._used("assume"):
            if self._steps[place] == 0 or self.failures[place]:
                self._begin(place, self._driven(self._robots[place]))
            self._batch.assume(place, float(self._time_after(steps)), readings)
            self._steps[place] = steps

    def __reduce__(self) -> NoReturn:
        problem = "cannot be copied or pickled: make another one from the same arguments"
        raise InputError("Simulation", "", problem)

    @contextlib.contextmanager
    def _used(self, method: str, *, is_whole: bool | None = None) -> Iterator[None]:
        """Context manager: this thread alone uses the robots. Raises InputError, which names
        `method`, if another thread does, or if a step was interrupted. After that only a reset of
        all robots is allowed: it passes `is_whole` True."""
        if not self._owner.acquire(blocking=False):
            problem = "another thread uses these robots; give each thread its own Simulation"
            raise InputError("Simulation", method, problem)
        try:
            if not (self._is_whole if is_whole is None else is_whole):
                problem = "a step was interrupted; reset() all robots first"
                raise InputError("Simulation", method, problem)
            yield
        finally:
            self._owner.release()

    def _driven(self, robot: Robot) -> DrivenRobot:
        return DrivenRobot(robot=robot, name=self._name, samples=robot.first_signals[np.newaxis])

    @functools.cached_property
    def _identity(self) -> str:
        """Digest of the scenario."""
        return hashlib.sha256(dump_scenario(self.scenario).encode()).hexdigest()

    def _robot_of(self, identity: str) -> Robot:
        """The robot with an identity: the seed of its disturbances and its damage, as JSON."""
        if identity == _UNDISTURBED:
            return self.robot
        robot, own = self.robot, json.loads(identity)
        if own["seed"] is not None:
            draw = draw_disturbances(self.scenario, own["seed"])
            robot = controlled_robot(disturbed(self.scenario, draw))
        for at, cables in own["damage"]:
            robot = _damaged(robot, at, cables)
        return robot

    def _put(self, place: int, identity: str, robot: Robot) -> None:
        """Makes a robot the one of a place, before it begins there."""
        cables = robot.starting_cables()
        for values, its in zip(self._law[:-1], cables.law[:-1], strict=True):
            values[place] = its
        self.rest[place] = robot.scenario.actuation.commands(cables)
        self._robots[place], self._identities[place] = robot, identity

    def _begin(self, place: int, driven: DrivenRobot) -> None:
        """Puts a robot at its start into the batch."""
        if not self._batch.begin(place, driven):
            problem = "a disturbed robot has other kinds of laws, or more heights of its terrain"
            raise InputError(self.scenario.name, "disturbances", problem)

    def _steps_until(self, times: np.ndarray) -> np.ndarray:
        """Numbers of control periods (N,) up to times (N,) in s. Raises InputError if one does not
        end there."""
        steps = np.ceil(times / self.control_period - 1e-6).astype(int)
        if not np.allclose(self._time_after(steps), times, rtol=0.0, atol=1e-8):
            expected = f"expected multiples of the control period, {self.control_period:g} s"
            raise InputError("Simulation", "states", f"found the times {times} s, {expected}")
        return steps

    def _time_after(self, steps: np.ndarray) -> np.ndarray:
        """Time (N,) in s that robots have reached after a number of control periods (N,), at most
        the duration."""
        step, duration = self.scenario.cpg.listing_step, self.scenario.simulation.duration
        times = (step * (self._listing_steps * steps)).round(MARK_DECIMALS)
        return np.where(times > duration - 0.5 * step, duration, times)

    def _places(self, indices: Indices) -> list[int]:
        """The given indices of robots as a list, or all indices for None. Raises InputError for an
        index without a robot."""
        if indices is None:
            return list(range(self.count))
        places = np.asarray(indices)
        are_whole = places.size == 0 or np.issubdtype(places.dtype, np.integer)
        fit = places.ndim == 1 and are_whole and ((places >= 0) & (places < self.count)).all()
        if not fit:
            problem = f"found {indices}, expected a list of integers from 0 to {self.count - 1}"
            raise InputError("Simulation", "indices", problem)
        return [int(place) for place in places]


def _damaged(robot: Robot, at: float, cables: Sequence[str]) -> Robot:
    """A robot whose cables are cut at a time (s). Raises InputError for a wrong name."""
    events = [*robot.scenario.events, Event(at=at, cut=list(cables))]
    try:
        check_taken(events, robot.structure)
    except InputError as error:
        raise InputError("Simulation", "cables", error.problem) from error
    return dataclasses.replace(robot, scenario=robot.scenario.with_sections(events=events))


def is_list(values: object) -> TypeGuard[Sequence[Any]]:
    """True if a value is a list, a tuple, or a NumPy array of one dimension."""
    return isinstance(values, list | tuple) or (isinstance(values, np.ndarray) and values.ndim == 1)
