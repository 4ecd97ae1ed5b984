"""Engine `compiled`: the same equations without Drake, with several robots in lanes."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from tetra_drake.engines.batch import Batch, Viewer
from tetra_drake.engines.engine import Engine
from tetra_drake.engines.lanes import loop
from tetra_drake.engines.lanes.lanes import Lanes, processor_lanes
from tetra_drake.engines.lanes.prepared import Prepared
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.command import driven_robot
from tetra_drake.robot.driven import DrivenRobot
from tetra_drake.robot.gait import seeded_gait
from tetra_drake.robot.readings import Readings
from tetra_drake.scenario.scenario import Scenario


class LaneBatch(Batch):
    """Robots that share lanes; each thread has a share of the places."""

    def __init__(self, robots: Sequence[DrivenRobot], *, places: int, record: bool, threads: int):
        """Robots in the first of the places."""
        first = self._first = Prepared.of(robots[0], record=record)
        self.readings = Readings.empty(first.robot.structure, places)
        self.failures = [None] * places
        self._share = math.ceil(places / threads)
        self._shares = [slice(i, i + self._share) for i in range(0, places, self._share)]
        self._lanes = [Lanes(first, self.readings.rows(share)) for share in self._shares]
        self._start_threads()
        self._lanes[0].load(0, first)
        for place, robot in enumerate(robots[1:], start=1):
            self.begin(place, robot)

    def _start_threads(self) -> None:
        """Starts a pool of threads for this process: a fork has none of its parent's."""
        self._pool, self._process = ThreadPoolExecutor(len(self._lanes)), os.getpid()

    def begin(self, place: int, robot: DrivenRobot) -> bool:
        prepared, (lanes, row) = self._first.begun_by(robot), self._row(place)
        if not lanes.accepts(prepared):
            return False
        lanes.load(row, prepared)
        self.failures[place], self.readings.time[place] = None, 0.0
        return True

    def advance(
        self,
        until: np.ndarray | float = math.inf,
        signals: np.ndarray | None = None,
        *,
        briefly: bool = False,
    ) -> None:
        until = np.broadcast_to(until, len(self.failures))

        def advance(number: int) -> None:
            share = self._shares[number]
            held = None if signals is None else signals[share]
            self._lanes[number].advance(until[share], held, briefly=briefly)

        if self._process != os.getpid():
            self._start_threads()
        others = [self._pool.submit(advance, i) for i in range(1, len(self._lanes))]
        advance(0)
        for other in others:
            other.result()
        status = np.concatenate([lanes.status for lanes in self._lanes])
        for place in np.flatnonzero(status > loop.DONE).tolist():
            if self.failures[place] is None:
                lanes, row = self._row(place)
                self.failures[place] = lanes.failure(row)

    def ended(self, place: int) -> bool:
        lanes, row = self._row(place)
        return lanes.ended(row)

    def result(self, place: int) -> SimulationResult:
        if failure := self.failures[place]:
            raise failure
        lanes, row = self._row(place)
        return lanes.result(row)

    def copy(self, place: int, to: int) -> None:
        (source, row), (lanes, other) = self._row(place), self._row(to)
        lanes.copy(row, other, source)
        self.failures[to] = self.failures[place]
        self.readings.put(to, self.readings.rows(place))

    def stop(self, place: int) -> float:
        lanes, row = self._row(place)
        return lanes.stop(row)

    def _row(self, place: int) -> tuple[Lanes, int]:
        """The lanes of a robot, and its place there."""
        return self._lanes[place // self._share], place % self._share


class CompiledEngine(Engine):
    """Engine that simulates in compiled kernels. Other Python threads run meanwhile."""

    lanes = processor_lanes()

    def prepare(self, scenario: Scenario) -> None:
        self.start([driven_robot(scenario, seeded_gait(scenario))])

    def start(
        self,
        robots: Sequence[DrivenRobot],
        *,
        places: int | None = None,
        record: bool = False,
        viewer: Viewer | None = None,
        threads: int = 1,
    ) -> LaneBatch:
        return LaneBatch(robots, places=places or len(robots), record=record, threads=threads)


ENGINE = CompiledEngine()
