"""Stepper of the compiled engine: robots that share lanes, in several threads."""

from __future__ import annotations

import math
import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from tetra_drake.engines.gait_simulation import GaitSimulation
from tetra_drake.engines.lanes import loop
from tetra_drake.engines.lanes.lane_engine import LaneEngine
from tetra_drake.engines.lanes.prepared import Prepared
from tetra_drake.engines.stepper import Stepper
from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.readings import Readings


class LaneStepper(Stepper):
    """Robots on several engines, an engine in each thread."""

    def __init__(self, first: GaitSimulation, *, count: int, threads: int) -> None:
        """A stepper for `count` robots like the first one, in at most `threads` threads."""
        self.readings = Readings.empty(first.robot.structure, count)
        prepared = self._first = Prepared.of(first)
        self._share = math.ceil(count / threads)
        self._shares = [slice(i, i + self._share) for i in range(0, count, self._share)]
        self._engines = [
            LaneEngine(prepared, readings=self.readings.rows(share)) for share in self._shares
        ]
        self._start_threads()

    def _start_threads(self) -> None:
        """Starts a pool of threads for this process: a fork has none of its parent's."""
        self._pool, self._process = ThreadPoolExecutor(len(self._engines)), os.getpid()

    def begin(self, place: int, simulation: GaitSimulation) -> None:
        prepared, (engine, row) = self._first.begun_by(simulation), self._row(place)
        if not engine.accepts(prepared):
            problem = "a disturbed robot has other kinds of laws, or more heights of its terrain"
            raise InputError(simulation.robot.scenario.name, "disturbances", problem)
        engine.load(row, prepared)

    def advance(self, signals: np.ndarray, marks: np.ndarray) -> None:
        tasks = [
            (engine, signals[share], marks[share])
            for engine, share in zip(self._engines, self._shares, strict=True)
        ]
        if self._process != os.getpid():
            self._start_threads()
        others = [self._pool.submit(LaneEngine.advance_to_pause, *task) for task in tasks[1:]]
        LaneEngine.advance_to_pause(*tasks[0])
        for other in others:
            other.result()

    def failed(self) -> np.ndarray:
        return np.concatenate([engine.status for engine in self._engines]) > loop.DONE

    def failure(self, place: int) -> SimulationFailure | None:
        engine, row = self._row(place)
        return engine.failure(row)

    def result(self, place: int) -> SimulationResult:
        engine, row = self._row(place)
        return engine.result(row)

    def _row(self, place: int) -> tuple[LaneEngine, int]:
        """The engine of a robot, and its place there."""
        return self._engines[place // self._share], place % self._share
