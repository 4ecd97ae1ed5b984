"""Batch: robots that an engine simulates side by side."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Protocol, Self

import numpy as np
import numpy.typing as npt

from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.readings import Readings
from tetra_drake.robot.robot import Phase, Robot
from tetra_drake.robot.signals import DrivenRobot
from tetra_drake.robot.structure import Structure

if TYPE_CHECKING:
    import xarray


_SAME_TIME = 1e-9
"""Largest difference (s) of two times that are the same except for rounding."""


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
        self._phases: list[tuple[Phase, ...]] = [()] * places
        """The present phase of the robot in each place, and the phases after coming events."""

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
        Robots change at the times of their scenario's events.

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
        while True:
            events = self._pass_events()
            self._advance(np.minimum(times, events), signals, briefly)
            goes_on = np.isfinite(events) & (events <= times)
            goes_on &= [failure is None for failure in self.failures]
            if briefly or not goes_on.any():
                return
            signals = None  # held from now on

    def _pass_events(self) -> np.ndarray:
        """Changes the robots that are at the time of an event. Returns the time (s) of the next
        event in each place (N,), infinite if there is none."""
        following = np.full(len(self.failures), math.inf)
        for place, phases in enumerate(self._phases):
            while len(phases) > 1 and self.readings.time[place] >= phases[1].begins - _SAME_TIME:
                before, after, *_ = phases
                self._become(place, after.robot, after.p_BC - before.p_BC)
                self._phases[place] = phases = phases[1:]
            if len(phases) > 1:
                following[place] = phases[1].begins
        return following

    def _become(self, place: int, robot: Robot, p_BC: np.ndarray) -> None:
        """Replaces the robot in a place by another one of the same structure, whose nodes move on
        in the same way. The origins of its bodies' frames are at p_BC (bodies, 3) in m in the
        frames of the old one."""
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

    def become(self, robot: Robot, p_BC: np.ndarray) -> Self:
        """The simulation that continues with another robot in place of this one; see
        Batch._become()."""


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
        self._phases[place] = robot.robot.phases
        self.failures[place], self.readings.time[place] = None, 0.0
        self._reached[place], self._ends[place] = 0.0, robot.robot.scenario.simulation.duration
        return True

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

    def _become(self, place: int, robot: Robot, p_BC: np.ndarray) -> None:
        before = self._robots[place]
        assert before is not None
        self._robots[place] = before.become(robot, p_BC)

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
        self._phases[to] = self._phases[place]
        self.failures[to] = self.failures[place]
        self._reached[to], self._ends[to] = self._reached[place], self._ends[place]
        self.readings.put(to, self.readings.rows(place))

    def stop(self, place: int) -> float:
        robot, self._robots[place] = self._robots[place], None
        self.failures[place], self._phases[place] = None, ()
        return 0.0 if robot is None else robot.wall_time


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
