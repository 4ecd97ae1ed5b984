"""Simulation of robots in control periods: `reset`, `step`, and their readings."""

from __future__ import annotations

import dataclasses
import math
import numbers
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from tetra_drake.engines.gait_simulation import MARK_DECIMALS, GaitSimulation, Viewer
from tetra_drake.engines.interface import check_can_be_watched, engine_of
from tetra_drake.engines.time_limit import check_time
from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.machine import available_cores
from tetra_drake.physics.cable import CableLaw
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.command import controlled_robot
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.readings import Readings, first_readings
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.disturbances import disturbed, draw_disturbances
from tetra_drake.scenario.load import GivenScenario, given_scenario
from tetra_drake.scenario.scenario import Scenario

Controller = Callable[[float, Readings], npt.ArrayLike]
"""Function from the time (s) and the readings of one robot to its actions (actions,)."""


class Simulation:
    """Robots side by side that are advanced by control periods.

        >>> simulation = td.Simulation(td.load_scenario("quick"), count=4)
        >>> driven, readings = simulation.robot.driven, simulation.reset(seed=1)
        >>> while not simulation.ended.all():
        ...     readings = simulation.step(simulation.rest + 3.0 * readings.rates[:, driven])
        >>> inches = [simulation.result(place).metrics.distance_in for place in range(4)]

    Each driven cable has an action: the setpoint of its actuator, by the kind of `actuation`. It is
    a force (N) of !Force, a free length (m) of a !Winch, a tension (N) of a !TensionMotor. The
    order is the same as in `robot.driven`, oscillator by oscillator. An action is held for a
    control period. Like a sample of a command, it begins with a linear change that takes one
    `cpg.listing_step`; the first action acts from the start on. There is no network and no start-up
    time. On all engines, steps with the samples of a command give the motion of
    simulate(command=...), if each sample differs from the one before.
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
        """Robots at their start; see reset().

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
        workers = available_cores() if workers is None else workers
        _check_whole("count", count, least=1)
        _check_whole("workers", workers, least=1)
        if viewer is not None:
            check_can_be_watched(scenario)
        self._listing_steps = _listing_steps(control_period, scenario)
        self._gait = Gait(name=name, weights=(), tau_a=1.0, tau_b=1.0)
        self._record, self._viewer = record, viewer
        first = self._gait_simulation(self.robot)
        self._stepper = engine_of(scenario).stepper(first, count=count, threads=workers)
        self._robots = [self.robot] * count
        shape = count, self.robot.driven.size
        self._law: Any = CableLaw._make(np.empty((len(CableLaw._fields), *shape)))
        self._signals = np.empty(shape)
        self._steps = np.zeros(count, dtype=int)
        self.failures: list[SimulationFailure | None] = [None] * count
        """Failure of each robot (N,): Diverged or StepBudgetExceeded; None if there is none. Its
        readings are the last ones, and its actions have no effect, until it is reset."""
        self.rest: np.ndarray = np.empty(shape)
        """Actions (N, actions) with which the robots start; they rest."""
        self.reset()

    @property
    def count(self) -> int:
        """Number of robots."""
        return len(self._robots)

    @property
    def state(self) -> Readings:
        """The readings of all robots now."""
        return self._stepper.readings.copied()

    @property
    def ended(self) -> np.ndarray:
        """True for each robot (N,) that has failed, or reached `simulation.duration`."""
        failed = np.array([failure is not None for failure in self.failures])
        return failed | (self._time_after(self._steps) >= self.scenario.simulation.duration)

    def reset(
        self, *, seed: int | None = None, indices: Sequence[int] | np.ndarray | None = None
    ) -> Readings:
        """Puts robots at their start, and returns the readings of all robots.

        Args:
            seed: seed of the scenario's disturbances; each robot has a draw of its own. None for
                robots without disturbances.
            indices: the robots; all by default.

        Raises:
            InputError: if the seed or an index is wrong.
        """
        for place in self._places(indices):
            scenario = self.scenario
            if seed is not None and scenario.disturbances is not None:
                _check_whole("seed", seed, least=0)
                scenario = disturbed(scenario, draw_disturbances(scenario, (seed, place)))
            same = scenario is self.scenario
            self._put(place, self.robot if same else controlled_robot(scenario))
        return self.state

    def step(self, actions: npt.ArrayLike) -> Readings:
        """Simulates one control period, and returns the readings of all robots.

        The last period ends at `simulation.duration`.

        Args:
            actions: the actions (N, actions); of a single robot also (actions,).

        Raises:
            InputError: if the shape is wrong, an action is not finite, or a robot has reached the
                end.
        """
        goes = np.array([failure is None for failure in self.failures])
        signals = np.where(goes[:, np.newaxis], self._to_signals(actions, goes), 0.0)
        now, until = self._time_after(self._steps), self._time_after(self._steps + 1)
        duration = self.scenario.simulation.duration
        if (late := goes & (now >= duration)).any():
            problem = f"robot {late.argmax()} has reached the end at {duration:g} s; reset it"
            raise InputError("Simulation", "step", problem)
        for place in np.flatnonzero(goes & (self._steps == 0)).tolist():
            begun = dataclasses.replace(
                self._robots[place], commanded=signals[place : place + 1].copy()
            )
            self._stepper.begin(place, self._gait_simulation(begun))
        marks = self._marks(now, until, changed=(signals != self._signals).any(axis=1))
        marks[~goes] = math.inf
        self._stepper.advance(signals, marks)
        self._signals = signals
        self._steps[goes] += 1
        for place in np.flatnonzero(goes & self._stepper.failed()).tolist():
            self.failures[place] = self._stepper.failure(place)
        return self.state

    def result(self, place: int = 0) -> SimulationResult:
        """The result of a robot that has reached the end. Raises its failure if it failed, and
        InputError if it has not ended."""
        (place,) = self._places([place])
        if not self.ended[place]:
            time = float(self._stepper.readings.time[place])
            problem = f"robot {place} is at {time:g} s; its result exists at the end"
            raise InputError("Simulation", "result", problem)
        return dataclasses.replace(self._stepper.result(place), scenario=self.scenario)

    def _put(self, place: int, robot: Robot) -> None:
        """Puts a robot at its start."""
        cables = robot.starting_cables()
        for values, given in zip(self._law, cables.law, strict=True):
            values[place] = given
        self.rest[place] = robot.scenario.actuation.commands(cables)
        self._robots[place], self.failures[place], self._steps[place] = robot, None, 0
        self._stepper.readings.put(
            place, self._first_readings if robot is self.robot else first_readings(robot)
        )

    def _gait_simulation(self, robot: Robot) -> GaitSimulation:
        return GaitSimulation(robot, self._gait, record=self._record, viewer=self._viewer)

    def _to_signals(self, actions: npt.ArrayLike, goes: np.ndarray) -> np.ndarray:
        """Signals (N, m) in N of actions. Actions of robots that do not go may be anything."""
        given = checked_actions(actions, self.rest.shape, source="Simulation")
        bad = goes & ~np.isfinite(given).all(axis=1)
        if bad.any():
            robot = int(bad.argmax())
            action = int((~np.isfinite(given[robot])).argmax())
            problem = f"found {given[robot, action]}, expected a number"
            key = f"actions[{robot}], {self.robot.structure.oscillators[action]}"
            raise InputError("Simulation", key, problem)
        signals: np.ndarray = self.scenario.actuation.signals(given, self._law)
        return signals

    def _time_after(self, steps: np.ndarray) -> np.ndarray:
        """Time (N,) in s after a number of control periods (N,), at most the duration."""
        step, duration = self.scenario.cpg.listing_step, self.scenario.simulation.duration
        times = (step * (self._listing_steps * steps)).round(MARK_DECIMALS)
        return np.where(times > duration - 0.5 * step, duration, times)

    def _marks(self, now: np.ndarray, until: np.ndarray, *, changed: np.ndarray) -> np.ndarray:
        """Times (N, marks) in s at which steps must end in the control period from `now` to
        `until`: the same as for a command."""
        simulation, starts = self.scenario.simulation, self._steps == 0
        change_ends = (now + self.scenario.cpg.listing_step).round(MARK_DECIMALS)
        is_change = changed & ~starts & (change_ends < until)
        change_ends = np.where(is_change, change_ends, math.inf)
        steady = np.full(self.count, simulation.settling_time).round(MARK_DECIMALS)
        is_within = (now < steady) & (steady < until) & (steady != change_ends)
        start, steady = np.where(starts, 0.0, math.inf), np.where(is_within, steady, math.inf)
        return np.sort(np.stack([start, change_ends, steady, until], axis=1), axis=1)

    def _places(self, indices: Sequence[int] | np.ndarray | None) -> list[int]:
        """The places of robots. Raises InputError for an index that is none."""
        if indices is None:
            return list(range(self.count))
        places = np.asarray(indices)
        valid = places.ndim == 1 and np.issubdtype(places.dtype, np.integer)
        if places.size and not (valid and ((places >= 0) & (places < self.count)).all()):
            problem = f"found {indices}, expected a list of integers from 0 to {self.count - 1}"
            raise InputError("Simulation", "indices", problem)
        found: list[int] = places.astype(int).tolist()
        return found


def checked_actions(actions: npt.ArrayLike, shape: tuple[int, ...], *, source: str) -> np.ndarray:
    """Actions of a shape (N, actions); of a single robot also (actions,). Raises InputError, naming
    `source`, if they have another shape."""
    least = shape[1:] if shape[0] == 1 else shape
    try:
        given = np.asarray(actions, dtype=float)
    except (TypeError, ValueError) as error:
        problem = f"found {actions!r:.60}, expected numbers of shape {least}"
        raise InputError(source, "actions", problem) from error
    if given.shape not in (shape, least):
        raise InputError(source, "actions", f"found the shape {given.shape}, expected {least}")
    return given.reshape(shape)


def simulate_controlled(
    scenario: Scenario,
    controller: Controller,
    *,
    control_period: float | None,
    record: bool,
    viewer: Viewer | None,
) -> SimulationResult:
    """Simulates a robot that follows a controller. Raises the same errors as simulate()."""
    simulation = Simulation(
        scenario,
        control_period=control_period,
        record=record,
        viewer=viewer,
        name=getattr(controller, "__name__", "controller"),
    )
    while not simulation.ended[0]:
        check_time()
        readings = simulation.state.rows(0)
        simulation.step(controller(float(readings.time), readings))
    return simulation.result()


def _listing_steps(period: float | None, scenario: Scenario) -> int:
    """Number of steps of the listing in a control period (s), by default the scenario's. Raises
    InputError unless it is a whole number."""
    source, key, step = "Simulation", "control_period", scenario.cpg.listing_step
    if period is None:
        period = scenario.simulation.control_period
        source, key = f"scenario {scenario.name}", "simulation.control_period"
    is_number = isinstance(period, numbers.Real) and math.isfinite(period)
    steps = round(period / step) if is_number else 0
    if steps < 1 or abs(period - steps * step) > 1e-6 * step:
        expected = f"a multiple of cpg.listing_step, {step:g} s"
        raise InputError(source, key, f"found {period!r}, expected {expected}")
    return steps


def _check_whole(key: str, number: object, *, least: int) -> None:
    """Raises InputError unless a number is whole, `least` or more."""
    if not isinstance(number, numbers.Integral) or int(number) < least:
        problem = f"found {number!r}, expected an integer, {least} or more"
        raise InputError("Simulation", key, problem)
