"""Stepper of the compiled engine: robots in lanes, and lanes in threads."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from tetra_drake.engines.compiled.lane_engine import LaneEngine, lanes_for
from tetra_drake.engines.compiled.prepared import Prepared
from tetra_drake.engines.gait_simulation import GaitSimulation
from tetra_drake.engines.stepper import Stepper
from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.readings import Readings
from tetra_drake.simd.packed import Packed


class LaneStepper(Stepper):
    """Robots in the lanes of several engines. A lane that pauses waits for the other lanes of its
    engine; each thread simulates some of the engines."""

    def __init__(self, first: GaitSimulation, *, count: int, threads: int) -> None:
        """A stepper for `count` robots like the first one, in at most `threads` threads."""
        self._count, self._width = count, lanes_for(math.ceil(count / threads))
        prepared = Prepared.of(first)
        places = [slice(i, i + self._width) for i in range(0, count, self._width)]
        self._engines = [LaneEngine(prepared, width=self._width) for _ in places]
        self.readings = Readings.empty(first.robot.structure, count)
        rows = [Packed(self.readings.rows(some)) for some in places]
        self._parts = list(zip(self._engines, places, rows, strict=True))
        self._threads = min(threads, len(places))
        self._pool = ThreadPoolExecutor(self._threads)

    def begin(self, place: int, simulation: GaitSimulation) -> None:
        prepared, (engine, lane) = Prepared.of(simulation), self._lane(place)
        if not engine.accepts(prepared):
            problem = "a disturbed robot has other kinds of laws, or more heights of its terrain"
            raise InputError(simulation.robot.scenario.name, "disturbances", problem)
        engine.load(lane, prepared)

    def advance(self, signals: np.ndarray, marks: np.ndarray) -> None:
        shares = range(1, self._threads)  # the first one is of this thread
        others = [self._pool.submit(self._advance, share, signals, marks) for share in shares]
        self._advance(0, signals, marks)
        for other in others:
            other.result()

    def failed(self) -> np.ndarray:
        return np.concatenate([engine.failed for engine in self._engines])[: self._count]

    def failure(self, place: int) -> SimulationFailure | None:
        engine, lane = self._lane(place)
        return engine.failure(lane)

    def result(self, place: int) -> SimulationResult:
        engine, lane = self._lane(place)
        return engine.result(lane)

    def _advance(self, share: int, signals: np.ndarray, marks: np.ndarray) -> None:
        """Advances the engines of one thread."""
        for engine, places, rows in self._parts[share :: self._threads]:
            engine.hold(signals[places], marks[places])
            engine.run()
            engine.read(rows)

    def _lane(self, place: int) -> tuple[LaneEngine, int]:
        return self._engines[place // self._width], place % self._width
