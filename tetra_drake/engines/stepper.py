"""Steppers: robots that an engine advances by control periods."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from tetra_drake.engines.gait_simulation import GaitSimulation
from tetra_drake.errors import SimulationFailure
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.readings import Readings
from tetra_drake.robot.structure import Structure


class Stepper(Protocol):
    """Robots side by side. Each has a place, follows signals, and pauses at marks."""

    readings: Readings
    """Readings of all robots at their last pause."""

    def begin(self, place: int, simulation: GaitSimulation) -> None:
        """Puts a robot at its start. Raises InputError if it does not fit beside the others."""

    def advance(self, signals: np.ndarray, marks: np.ndarray) -> None:
        """Simulates until each robot has reached its last mark, or failed.

        Args:
            signals: signals (N, m) in N, held from now on.
            marks: times (N, marks) in s at which a step must end, ascending; infinite after the
                last. A robot without marks pauses.
        """

    def failed(self) -> np.ndarray:
        """True for each robot (N,) that has failed."""

    def failure(self, place: int) -> SimulationFailure | None:
        """The failure of the robot in a place; None if it has not failed."""

    def result(self, place: int) -> SimulationResult:
        """The result of the robot in a place, at the end of its simulation."""


class Walk(Protocol):
    """A simulation that pauses."""

    def hold(self, signals: np.ndarray) -> None:
        """Sets the signals (m,) in N from now on."""

    def advance_to(self, time: float) -> None:
        """Simulates to a time (s). Raises Diverged or StepBudgetExceeded."""

    def readings(self) -> Readings:
        """The readings of the robot now."""

    def result(self) -> SimulationResult:
        """The result, at the end."""


class SerialStepper(Stepper):
    """Robots of an engine without lanes, simulated one after another."""

    def __init__(
        self, start: Callable[[GaitSimulation], Walk], structure: Structure, *, count: int
    ) -> None:
        self.readings = Readings.empty(structure, count)
        self._start = start
        self._walks: dict[int, Walk] = {}
        self._failures: dict[int, SimulationFailure] = {}

    def begin(self, place: int, simulation: GaitSimulation) -> None:
        self._failures.pop(place, None)
        self._walks[place] = self._start(simulation)

    def advance(self, signals: np.ndarray, marks: np.ndarray) -> None:
        for place in np.flatnonzero(np.isfinite(marks[:, 0])).tolist():
            walk, times = self._walks[place], marks[place]
            walk.hold(signals[place])
            try:
                for time in times[np.isfinite(times)].tolist():
                    walk.advance_to(time)
            except SimulationFailure as failure:
                self._failures[place] = failure
            else:
                self.readings.put(place, walk.readings())

    def failed(self) -> np.ndarray:
        return np.array([place in self._failures for place in range(len(self.readings.time))])

    def failure(self, place: int) -> SimulationFailure | None:
        return self._failures.get(place)

    def result(self, place: int) -> SimulationResult:
        if failure := self.failure(place):
            raise failure
        return self._walks[place].result()
