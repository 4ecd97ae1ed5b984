"""Simulation of robots in control periods: robots are reset, stepped, and read."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import numbers
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NoReturn, TypeGuard

import numpy as np
import numpy.typing as npt

from tetra_drake.engines.batch import Batch, Viewer, checked_numbers
from tetra_drake.engines.engine import check_can_be_watched, engine_of
from tetra_drake.errors import InputError, SimulationFailure, check_type, check_whole
from tetra_drake.laws.cable import CableLaw
from tetra_drake.machine import threads_for
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.command import controlled_robot
from tetra_drake.robot.readings import Readings, first_readings
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.signals import MARK_DECIMALS, DrivenRobot
from tetra_drake.scenario.disturbances import disturbed, draw_disturbances
from tetra_drake.scenario.load import GivenScenario, given_scenario
from tetra_drake.scenario.scenario import Scenario

MOST_ROBOTS = 100_000
"""Largest number of robots side by side."""

Controller = Callable[[float, Readings], npt.ArrayLike]
"""Function from the time (s) and the readings of one robot to its actions (actions,)."""


class Simulation:
    """Robots side by side that a program controls: it reads them and sets their actuators.

        >>> simulation = td.Simulation(td.load_scenario("quick"), count=4)
        >>> driven, readings = simulation.robot.driven, simulation.reset(seed=1)
        >>> while not simulation.ended.all():
        ...     readings = simulation.step(simulation.rest + 3.0 * readings.rates[:, driven])
        >>> inches = [simulation.result(place).metrics.distance_in for place in range(4)]

    Each driven cable has an action: the setpoint of its actuator, by the kind of `actuation`. It is
    a force (N) of !Force, a free length (m) of a !Winch, a tension (N) of a !TensionMotor. The
    order is the same as in `robot.driven`, oscillator by oscillator. An action is held for a
    control period. Like a sample of a command, it begins with a linear change from the last action
    that takes one `cpg.listing_step`; the first action acts from the start on. There is no network
    and no start-up time. On all engines, steps with the samples of a command give the motion of
    simulate(command=...), if each sample differs from the one before.

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
        viewer: Viewer | None = None,
        workers: int | None = None,
        name: str = "controller",
    ) -> None:
        """Puts robots at their start; see reset().

        Args:
            scenario: a scenario, its name or file, or a run.
            count: number N of robots.
            control_period: time (s) between actions, a multiple of `cpg.listing_step`; by default
                `simulation.control_period`.
            record: records the trajectories, for result().
            viewer: observer that shows the robot, if the engine can be watched.
            workers: number of threads; one per core by default.
            name: name of the results.

        Raises:
            InputError: if an argument does not fit the scenario.
        """
        self.scenario = scenario = given_scenario(scenario)
        self.robot: Robot = controlled_robot(scenario)
        """The robot without disturbances. Its structure has the names of nodes and cables."""
        self._first_readings = first_readings(self.robot)
        check_whole("Simulation", "count", count, least=1, most=MOST_ROBOTS)
        threads = threads_for(workers, source="Simulation")
        check_type("Simulation", "record", record, bool)
        check_type("Simulation", "name", name, str)
        if viewer is not None:
            check_can_be_watched(scenario)
        self._listing_steps = _listing_steps(control_period, scenario)
        self.control_period = self._listing_steps * scenario.cpg.listing_step
        """Time (s) between actions."""
        self.count = count
        """Number of robots."""
        self._name, self._robots = name, [self.robot] * count
        start = functools.partial(engine_of(scenario).start, places=count, threads=threads)
        self._new_batch = functools.partial(start, record=record, viewer=viewer)
        self._batch: Batch = self._new_batch([self._driven(self.robot)])
        self._owner, self._is_whole = threading.RLock(), True
        shape = count, self.robot.driven.size
        self._law: Any = CableLaw._make(np.empty((len(CableLaw._fields), *shape)))
        self._steps = np.zeros(count, dtype=int)
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
        """The readings of all robots now."""
        with self._used("state"):
            return self._batch.readings.copied()

    @property
    def ended(self) -> np.ndarray:
        """True for each robot (N,) that has failed, or reached `simulation.duration`."""
        failed = np.array([failure is not None for failure in self.failures])
        return failed | (self._time_after(self._steps) >= self.scenario.simulation.duration)

    def reset(
        self,
        *,
        seed: int | Sequence[int] | None = None,
        indices: Sequence[int] | np.ndarray | None = None,
    ) -> Readings:
        """Puts robots at their start, and returns the readings of all robots.

        Args:
            seed: seed of the scenario's disturbances, which are different for each robot. Or a
                seed for each robot: it is disturbed like a robot alone with this seed. None for
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
            robots = [self.robot] * len(places)
            if seed is not None and self.scenario.disturbances is not None:
                numbers_of_robots = [0] * len(places) if is_list(seed) else places
                seeds = zip(given, numbers_of_robots, strict=True)
                draws = [draw_disturbances(self.scenario, each) for each in seeds]
                robots = [controlled_robot(disturbed(self.scenario, draw)) for draw in draws]
            if not self._is_whole:
                self._batch = self._new_batch([self._driven(self.robot)])
            self._is_whole = False
            for place, robot in zip(places, robots, strict=True):
                cables = robot.starting_cables()
                for values, its in zip(self._law, cables.law, strict=True):
                    values[place] = its
                self.rest[place] = robot.scenario.actuation.commands(cables)
                self._batch.stop(place)
                self._robots[place], self._steps[place] = robot, 0
                first = self._first_readings if robot is self.robot else first_readings(robot)
                self._batch.readings.put(place, first)
            self._is_whole = True
            return self.state

    def step(
        self, actions: npt.ArrayLike, *, indices: Sequence[int] | np.ndarray | None = None
    ) -> Readings:
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
            if (bad := goes[:, np.newaxis] & ~np.isfinite(given)).any():
                place, action = np.argwhere(bad)[0].tolist()
                key = f"actions[{place}], {self.robot.structure.oscillators[action]}"
                problem = f"found {given[place, action]}, expected a number"
                raise InputError("Simulation", key, problem)
            if (late := goes & self.ended).any():
                end = f"the end at {self.scenario.simulation.duration:g} s"
                problem = f"robot {late.argmax()} has reached {end}; reset it"
                raise InputError("Simulation", "step", problem)

            signals = np.asarray(self.scenario.actuation.signals(given, self._law))
            signals = np.where(goes[:, np.newaxis], signals, 0.0)
            for place in np.flatnonzero(goes & (self._steps == 0)).tolist():
                first_signals = signals[place].copy()
                robot = dataclasses.replace(self._robots[place], first_signals=first_signals)
                if not self._batch.begin(place, self._driven(robot)):
                    has = "other kinds of laws, or more heights of its terrain"
                    problem = f"a disturbed robot has {has}"
                    raise InputError(self.scenario.name, "disturbances", problem)
            self._is_whole = False
            self._batch.advance(np.where(goes, self._time_after(self._steps + 1), 0.0), signals)
            self._steps[goes] += 1
            self._is_whole = True
            return self.state

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
        samples = robot.first_signals[np.newaxis]
        return DrivenRobot(robot=robot, name=self._name, samples=samples)

    def _time_after(self, steps: np.ndarray) -> np.ndarray:
        """Time (N,) in s that robots have reached after a number of control periods (N,), at most
        the duration."""
        step, duration = self.scenario.cpg.listing_step, self.scenario.simulation.duration
        times = (step * (self._listing_steps * steps)).round(MARK_DECIMALS)
        return np.where(times > duration - 0.5 * step, duration, times)

    def _places(self, indices: Sequence[int] | np.ndarray | None) -> list[int]:
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


def is_list(values: object) -> TypeGuard[Sequence[Any]]:
    """True if a value is a list, a tuple, or a NumPy array of one dimension."""
    return isinstance(values, list | tuple) or (isinstance(values, np.ndarray) and values.ndim == 1)


def checked_actions(actions: npt.ArrayLike, shape: tuple[int, ...], *, source: str) -> np.ndarray:
    """Converts actions to an array of `shape` (N, actions); for a single robot they may be
    (actions,). Raises InputError, which names `source`, if they have another shape, or are not real
    numbers."""
    least = shape[1:] if shape[0] == 1 else shape
    return checked_numbers(actions, least, shape, source=source, key="actions").reshape(shape)


def _listing_steps(period: float | None, scenario: Scenario) -> int:
    """Number of steps of `cpg.listing_step` in a control period (s), by default the scenario's.
    Raises InputError unless it is a whole number, or if the period is longer than the
    simulation."""
    source, key, step = "Simulation", "control_period", scenario.cpg.listing_step
    if period is None:
        period = scenario.simulation.control_period
        source, key = f"scenario {scenario.name}", "simulation.control_period"
    is_number = isinstance(period, numbers.Real) and not isinstance(period, bool)
    within = is_number and 0.0 < period <= max(scenario.simulation.duration, step)
    steps = round(period / step) if within else 0
    if steps < 1 or abs(period - steps * step) > 1e-6 * step:
        expected = f"a multiple of cpg.listing_step, {step:g} s, up to simulation.duration"
        raise InputError(source, key, f"found {period!r:.60}, expected {expected}")
    return steps
