"""Batch: robots that an engine simulates side by side."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Protocol, Self

import numpy as np
import numpy.typing as npt

from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.command import policy_signals
from tetra_drake.robot.readings import Readings
from tetra_drake.robot.signals import MARK_DECIMALS, DrivenRobot
from tetra_drake.robot.structure import Structure

if TYPE_CHECKING:
    import xarray


BRIEF = 0.03
"""Wall time (s) after which Batch.advance() returns with `briefly`."""


class Viewer(Protocol):
    """Display of a simulation while it runs."""

    def wants(self, time: float) -> bool:
        """True if the viewer wants to show the robot at this simulated time (s). The engine asks
        after each step, and calls show() if it is True."""

    def show(self, frame: xarray.Dataset) -> None:
        """Shows the robot. `frame` is a trajectory with a single sample; see
        results.trajectory.make_dataset."""


class Batch:
    """Robots that an engine simulates side by side.

    A batch has a fixed number N of places, numbered from 0. Each robot is in a place; a place
    without a robot is idle.
    """

    def __init__(self, structure: Structure, places: int) -> None:
        """Makes a batch of robots of one structure. `places` is its number of places, which are
        idle at first."""
        self.readings = Readings.empty(structure, places)
        """Readings of all robots at their last pause. At the start only the times are set."""
        self.failures: list[SimulationFailure | None] = [None] * places
        """Failure of the robot in each place; None if it has not failed."""
        self.signals = structure.signals
        """Number m of actuator signals of each robot."""
        self._due, self._held = np.full(places, math.inf), np.zeros((places, self.signals))
        """Next time (s) at which the policy of each robot acts, infinite without one; and the
        signals (N, m) in N that it holds until then."""

    def _begin_all(self, robots: Sequence[DrivenRobot]) -> None:
        """Puts robots in the first places, in their order. Raises InputError if one differs too
        much from the first robot; see begin()."""
        for place, robot in enumerate(robots):
            if not self.begin(place, robot):
                problem = "a robot has another structure, kind of law, or size than the first"
                raise InputError(robot.name, f"robot {place}", problem)

    def begin(self, place: int, robot: DrivenRobot) -> bool:
        """Puts a robot at its start into a place of the batch.

        Returns False, and changes nothing, if the robot differs too much from the first one of the
        batch: it has another structure or kind of law, or needs larger tables, such as of terrain
        heights.

        Raises InputError if the engine cannot simulate it, and SimulationFailure if it fails before
        its first step.
        """
        raise NotImplementedError

    def advance(
        self,
        until: npt.ArrayLike = math.inf,
        signals: npt.ArrayLike | None = None,
        *,
        briefly: bool = False,
    ) -> None:
        """Simulates each robot until its time in `until`, the end of its simulation, or a failure.

        Calls time_limit.check_time() often, which raises TimeBudgetExceeded.

        Args:
            until: simulated times (s), for each place (N,) or for all. A robot that has reached its
                time pauses.
            signals: m actuator signals (N, m) of each robot, which are forces in newtons. They
                change linearly from the old ones within one network step, `cpg.listing_step`, and
                are then constant. A robot that pauses, or has a gait or a command, ignores them.
            briefly: returns as soon as a robot has ended, or after some 30 ms of wall time. Engines
                that simulate one robot after another ignore it.

        Raises:
            InputError: if an argument has another shape.
        """
        places = len(self.failures)
        times = checked_numbers(until, (), (places,), source="Batch", key="until")
        if signals is not None:
            shape = places, self.signals
            signals = checked_numbers(signals, shape, source="Batch", key="signals")
        until, started = np.broadcast_to(times, places), time.perf_counter()
        while True:
            has_policy = bool(np.isfinite(self._due).any())
            held = self._held if has_policy else signals
            self._advance(np.minimum(until, self._due), held, briefly and not has_policy)
            over = [place for place in range(places) if self.ended(place)]
            self._due[over] = math.inf
            due = np.flatnonzero(np.isfinite(self._due) & (self._due <= until)).tolist()
            if due:
                self._act(due)
            is_enough = bool(over) or time.perf_counter() - started > BRIEF
            if not due or (briefly and is_enough):
                return

    def _set_policy(self, place: int, robot: DrivenRobot) -> None:
        """Sets when the policy of a robot at its start acts next, if it has one, and its first
        signals."""
        self._due[place] = math.inf if robot.pilot is None else _next_action(robot, 0.0)
        self._held[place] = robot.robot.first_signals

    def _act(self, places: list[int]) -> None:
        """Lets the policies of the robots in `places`, which have reached their time, act."""
        robots = [self._driven(place) for place in places]
        self._held[places] = policy_signals(robots, self.readings.rows(places))
        for place, robot in zip(places, robots, strict=True):
            self._due[place] = _next_action(robot, self._due[place])

    def _driven(self, place: int) -> DrivenRobot:
        """The robot in a place that is not idle."""
        raise NotImplementedError

    def _advance(self, until: np.ndarray, signals: np.ndarray | None, briefly: bool) -> None:
        raise NotImplementedError

    def ended(self, place: int) -> bool:
        """True if the robot in a place has failed, or reached the end of its simulation. False if
        it has only paused, or the place is idle."""
        raise NotImplementedError

    def result(self, place: int) -> SimulationResult:
        """Result of the robot in a place, after its simulation has ended. Raises its failure if it
        failed, and InputError if it has not ended."""
        if failure := self.failures[place]:
            raise failure
        if not self.ended(place):
            raise InputError("Batch", f"place {place}", "has no robot that has reached its end")
        return self._result(place)

    def _result(self, place: int) -> SimulationResult:
        raise NotImplementedError

    def copy(self, place: int, to: int) -> None:
        """Replaces the robot in place `to` by a copy of the one in `place`. Both continue
        independently."""
        raise NotImplementedError

    def stop(self, place: int) -> float:
        """Removes the robot and its failure from a place, which becomes idle. Returns the wall time
        (s) that the robot has taken."""
        raise NotImplementedError


class LoneRobot(Protocol):
    """Simulation of a single robot, as a part of a SerialBatch, which simulates one robot after
    another."""

    driven: DrivenRobot
    wall_time: float
    """Wall time (s) that the simulation has taken."""

    def hold(self, signals: np.ndarray) -> None:
        """Sets the actuator signals (m,) in N that hold from now on. They change linearly from the
        old ones, within one `cpg.listing_step`."""

    def advance_to(self, time: float) -> None:
        """Simulates to a time (s). Raises Diverged or StepBudgetExceeded."""

    def readings(self) -> Readings:
        """The readings of the robot at its present time, without the axis of robots."""

    def result(self) -> SimulationResult:
        """The result at the end of the simulation."""

    def copied(self) -> Self:
        """Copy of the simulation, which continues independently."""


class SerialBatch(Batch):
    """Batch of robots that are simulated one after another, each by its own LoneRobot."""

    def __init__(
        self, start: Callable[[DrivenRobot], LoneRobot], robots: Sequence[DrivenRobot], places: int
    ) -> None:
        """Starts robots in the first of `places` places; the other places are idle. `start` puts a
        robot at its start and returns its simulation."""
        super().__init__(robots[0].robot.structure, places)
        self._start = start
        self._robots: list[LoneRobot | None] = [None] * places
        self._reached, self._ends = np.zeros(places), np.zeros(places)
        self._begin_all(robots)

    def begin(self, place: int, robot: DrivenRobot) -> bool:
        structure = robot.robot.structure
        like, ours = Readings.empty(structure, 1), self.readings
        fits = all(a.shape[1:] == b.shape[1:] for a, b in zip(like, ours, strict=True))
        if structure.signals != self.signals or not fits:
            return False
        self._robots[place] = self._start(robot)
        self.failures[place], self.readings.time[place] = None, 0.0
        self._reached[place], self._ends[place] = 0.0, robot.robot.scenario.simulation.duration
        self._set_policy(place, robot)
        return True

    def _driven(self, place: int) -> DrivenRobot:
        robot = self._robots[place]
        assert robot is not None
        return robot.driven

    def _advance(self, until: np.ndarray, signals: np.ndarray | None, briefly: bool) -> None:
        until = np.minimum(until, self._ends)
        for place in np.flatnonzero(until > self._reached).tolist():
            robot = self._robots[place]
            if robot is None or self.failures[place] is not None:
                continue
            if signals is not None and robot.driven.is_controlled:
                robot.hold(signals[place])
            try:
                robot.advance_to(float(until[place]))
            except SimulationFailure as failure:
                failure.wall_time = robot.wall_time
                self.failures[place] = failure
            else:
                self.readings.put(place, robot.readings())
                self._reached[place] = until[place]

    def ended(self, place: int) -> bool:
        is_over = self.failures[place] is not None or self._reached[place] >= self._ends[place]
        return bool(is_over) and self._robots[place] is not None

    def _result(self, place: int) -> SimulationResult:
        robot = self._robots[place]
        assert robot is not None
        return robot.result()

    def copy(self, place: int, to: int) -> None:
        robot = self._robots[place]
        self._robots[to] = None if robot is None else robot.copied()
        self.failures[to] = self.failures[place]
        for table in (self._reached, self._ends, self._due, self._held):
            table[to] = table[place]
        self.readings.put(to, self.readings.rows(place))

    def stop(self, place: int) -> float:
        robot, self._robots[place] = self._robots[place], None
        self._due[place] = math.inf
        self.failures[place] = None
        return 0.0 if robot is None else robot.wall_time


def _next_action(robot: DrivenRobot, time: float) -> float:
    """Time (s) at which a robot's policy acts next after an action at `time` (s)."""
    scenario = robot.robot.scenario
    step = scenario.cpg.listing_step
    steps = round(scenario.simulation.control_period / step)
    return round(step * (steps * (round(time / (steps * step)) + 1)), MARK_DECIMALS)


def checked_numbers(
    given: npt.ArrayLike, *shapes: tuple[int, ...], source: str, key: str
) -> np.ndarray:
    """Converts an argument to real numbers (floats) of one of the given shapes. Raises InputError
    for anything else. Its message names `source`, the class or function, and `key`, the
    argument."""
    found = ""
    with contextlib.suppress(TypeError, ValueError):
        numbers = np.asarray(given)
        if numbers.dtype.kind in "iuf" and not np.ma.is_masked(given):
            if numbers.shape in shapes:
                return numbers.astype(float)
            found = f"the shape {numbers.shape}"
    problem = f"found {found or repr(given):.60}, expected real numbers of shape {shapes[0]}"
    raise InputError(source, key, problem)
