"""Batches: robots side by side on an engine, each in a place of its own."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Protocol, Self

import numpy as np
import numpy.typing as npt

from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.driven import DrivenRobot
from tetra_drake.robot.readings import Readings

if TYPE_CHECKING:
    import xarray


class Viewer(Protocol):
    """Observer that shows a simulation while it runs."""

    def wants(self, time: float) -> bool:
        """True if the viewer needs the state at this time (s)."""

    def show(self, frame: xarray.Dataset) -> None:
        """Shows one sample of a trajectory (see results.trajectory.make_dataset)."""


class Batch:
    """Robots side by side. A place without a robot is idle."""

    readings: Readings
    """Readings of all robots at their last pause. At the start only the times are set."""
    failures: list[SimulationFailure | None]
    """Failure of the robot in each place; None if it has not failed."""
    signals: int
    """Number m of signals of each robot."""

    def _begin_all(self, robots: Sequence[DrivenRobot]) -> None:
        """Puts robots in the first places. Raises InputError if one does not fit."""
        for place, robot in enumerate(robots):
            if not self.begin(place, robot):
                problem = "a robot has another structure, kind of law, or size than the first"
                raise InputError(robot.name, f"robot {place}", problem)

    def begin(self, place: int, robot: DrivenRobot) -> bool:
        """Puts a robot at its start. Returns False if its tables do not fit beside the others'.

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
        """Simulates until each robot has reached a time, its end, or a failure.

        Calls time_limit.check_time() often, which raises TimeBudgetExceeded.

        Args:
            until: times (s), for each place (N,) or for all. A robot that is not before its time
                pauses.
            signals: signals (N, m) in N that controllers hold from now on. A change takes one
                `cpg.listing_step`. A robot that pauses, or has a gait or a command, ignores them.
            briefly: returns earlier: as soon as a robot has ended, or after some 30 ms. An engine
                without lanes simulates at least one robot to its time.

        Raises:
            InputError: if an argument has another shape.
        """
        places = len(self.failures)
        times = checked_numbers(until, (), (places,), source="Batch", key="until")
        if signals is not None:
            shape = places, self.signals
            signals = checked_numbers(signals, shape, source="Batch", key="signals")
        self._advance(np.broadcast_to(times, places), signals, briefly)

    def _advance(self, until: np.ndarray, signals: np.ndarray | None, briefly: bool) -> None:
        raise NotImplementedError

    def ended(self, place: int) -> bool:
        """True if the robot in a place has failed, or reached the end of its simulation."""
        raise NotImplementedError

    def result(self, place: int) -> SimulationResult:
        """The result of the robot in a place, at the end of its simulation. Raises its failure if
        it failed, and InputError if it has not ended."""
        if failure := self.failures[place]:
            raise failure
        if not self.ended(place):
            raise InputError("Batch", f"place {place}", "has no robot that has reached its end")
        return self._result(place)

    def _result(self, place: int) -> SimulationResult:
        raise NotImplementedError

    def copy(self, place: int, to: int) -> None:
        """Makes the robot in place `to` a copy of the one in `place`: it goes on as that one
        does."""
        raise NotImplementedError

    def stop(self, place: int) -> float:
        """Empties a place, which then has no failure. Returns the wall time of its robot in s."""
        raise NotImplementedError


class LoneRobot(Protocol):
    """A robot that an engine without lanes simulates."""

    driven: DrivenRobot
    wall_time: float

    def hold(self, signals: np.ndarray) -> None:
        """Sets the signals (m,) in N from now on."""

    def advance_to(self, time: float) -> None:
        """Simulates to a time (s). Raises Diverged or StepBudgetExceeded."""

    def readings(self) -> Readings:
        """The readings of the robot now."""

    def result(self) -> SimulationResult:
        """The result, at the end."""

    def copied(self) -> Self:
        """A copy of the robot, which goes on by itself."""


class SerialBatch(Batch):
    """Robots that an engine simulates one after another."""

    def __init__(
        self, start: Callable[[DrivenRobot], LoneRobot], robots: Sequence[DrivenRobot], places: int
    ) -> None:
        """Robots in the first of the places. `start` puts a robot at its start."""
        self.readings = Readings.empty(robots[0].robot.structure, places)
        self.failures, self.signals = [None] * places, robots[0].robot.structure.signals
        self._start, self._sizes = start, _sizes(robots[0])
        self._robots: list[LoneRobot | None] = [None] * places
        self._reached, self._ends = np.zeros(places), np.zeros(places)
        self._begin_all(robots)

    def begin(self, place: int, robot: DrivenRobot) -> bool:
        if _sizes(robot) != self._sizes:
            return False
        self._robots[place] = self._start(robot)
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
        self._reached[to], self._ends[to] = self._reached[place], self._ends[place]
        self.readings.put(to, self.readings.rows(place))

    def stop(self, place: int) -> float:
        robot, self._robots[place] = self._robots[place], None
        self.failures[place] = None
        return 0.0 if robot is None else robot.wall_time


def checked_numbers(
    given: npt.ArrayLike, *shapes: tuple[int, ...], source: str, key: str
) -> np.ndarray:
    """Real numbers of one of these shapes, as floats. Raises InputError, naming source and key, for
    anything else."""
    found = ""
    with contextlib.suppress(TypeError, ValueError):
        numbers = np.asarray(given)
        if numbers.dtype.kind in "iuf" and not np.ma.is_masked(given):
            if numbers.shape in shapes:
                return numbers.astype(float)
            found = f"the shape {numbers.shape}"
    problem = f"found {found or repr(given):.60}, expected real numbers of shape {shapes[0]}"
    raise InputError(source, key, problem)


def _sizes(robot: DrivenRobot) -> tuple[int, ...]:
    """Sizes of a robot's signals and readings."""
    structure = robot.robot.structure
    contacts, nodes = len(structure.contacts), len(structure.node_names)
    return structure.signals, len(structure.cables), contacts, len(structure.bodies), nodes
