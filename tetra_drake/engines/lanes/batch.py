"""Engine `compiled`: the same equations without Drake, with several robots in lanes."""

from __future__ import annotations

import functools
import math
import os
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numba.core import registry

from tetra_drake.engines.batch import Batch, Viewer
from tetra_drake.engines.engine import Engine
from tetra_drake.engines.lanes import loop
from tetra_drake.engines.lanes.places import LAST, NEXT, ROUND, Memory, Places, advance
from tetra_drake.engines.lanes.prepared import Prepared
from tetra_drake.engines.lanes.tables import in_lanes, numbered, numbers_of, views
from tetra_drake.engines.time_limit import check_time
from tetra_drake.errors import Diverged, SimulationFailure, StepBudgetExceeded
from tetra_drake.kernels.compiling import machine_code
from tetra_drake.kernels.lanes import FieldArray
from tetra_drake.kernels.packed import Packed, allocate
from tetra_drake.laws.actuator import DRIVE
from tetra_drake.laws.oscillator import Network
from tetra_drake.laws.terrain import SurfaceGrid
from tetra_drake.results.result import IntegratorWork, SimulationResult, make_result
from tetra_drake.results.trajectory import Motion
from tetra_drake.robot.command import driven_robot
from tetra_drake.robot.driven import MARK_DECIMALS, DrivenRobot
from tetra_drake.robot.gait import seeded_gait
from tetra_drake.robot.readings import Readings
from tetra_drake.scenario.engine_kinds import Compiled
from tetra_drake.scenario.scenario import Scenario

FIRST = SurfaceGrid._fields.index("first")
"""Column of Ground.grid with the index of the first height. It differs between robots, because one
table has the heights of all robots."""

_BODY_STEPS = 25_000
"""Iterations times bodies per call of the kernel, about 30 ms. Between calls Python handles signals
of the operating system, and limits of time."""


class LaneBatch(Batch):
    """Robots in places. Threads take them into their lanes, and put them back when they pause."""

    def __init__(
        self, robots: Sequence[DrivenRobot], *, places: int, record: bool, threads: int
    ) -> None:
        """Robots in the first of the places. Compiles the kernel if necessary."""
        first = self._first = Prepared.of(robots[0], record=record)
        self.readings = Readings.empty(first.robot.structure, places)
        self.failures, self.signals = [None] * places, first.robot.structure.signals
        self._prepared: list[Prepared | None] = [None] * places
        self._ends, self._wall_times, self._tried = np.zeros((3, places))
        self._controlled = np.zeros(places, dtype=bool)
        self._heights = np.zeros((places, first.robot.ground.heights.size))
        state, constants = numbered(first.start), numbered(first.constants)
        self._tally = int(state.tally.begins[0])
        self._first_height = int(constants.robot.ground.grid[FIRST])
        sizes = first.log_sizes | {
            "places": places,
            "lanes": processor_lanes(),
            "numbers": int(state.step.end[0]),
            "constants": numbers_of(first.constants).size,
        }
        self._log, self._places = allocate(loop.Log, sizes), allocate(Places, sizes)
        tables = self._log, self._places, self._heights, self.readings
        self._threads = [LaneThread(first, *tables) for _ in range(min(threads, places))]
        self._start_pool()
        self._begin_all(robots)

    def _start_pool(self) -> None:
        """Starts a pool of threads for this process: a fork has none of its parent's."""
        self._pool, self._process = ThreadPoolExecutor(len(self._threads)), os.getpid()

    @property
    def _status(self) -> np.ndarray:
        """Status of the robot in each place; see loop."""
        return self._places.states[:, loop.STATUS]

    @property
    def _times(self) -> np.ndarray:
        """Time (s) of the robot in each place."""
        return self._places.states[:, loop.TIME]

    def begin(self, place: int, robot: DrivenRobot) -> bool:
        prepared = self._first if robot is self._first.driven else self._first.like(robot)
        if not self._accepts(prepared):
            return False
        self._load(place, prepared)
        return True

    def _accepts(self, prepared: Prepared) -> bool:
        """True if a robot fits these tables: the same structure and kinds of laws as the first
        robot, and no more samples, marks, turns or heights."""
        log = self._log
        return (
            self._first.fits(prepared)
            and len(prepared.times) < log.times.shape[1]
            and len(prepared.driven.marks) < log.marks.shape[1]
            and prepared.recent_signals <= log.recent.shape[1]
            and len(prepared.turns) <= log.turns.shape[1]
            and prepared.robot.ground.heights.size <= self._heights.shape[1]
        )

    def _load(self, place: int, prepared: Prepared) -> None:
        """Puts a robot at its start."""
        self.stop(place)
        log, start, heights = self._log, prepared.start, prepared.robot.ground.heights
        constants, state = self._places.constants[place], self._places.states[place]
        constants[:] = numbers_of(prepared.constants)
        constants[self._first_height] = place * self._heights.shape[1]
        self._heights[place, : heights.size] = heights
        for thread in self._threads:
            thread.widen(prepared.constants.network)
        marks, turns, samples = prepared.driven.marks, prepared.turns, prepared.driven.samples
        log.times[place] = log.marks[place] = math.inf
        log.times[place, : len(prepared.times)] = prepared.times
        log.marks[place, : len(marks)] = marks
        log.turns[place], log.turns[place, : len(turns)] = turns[-1], turns
        log.states[place, 0], log.modes[place, 0] = start.step.state, start.modes
        log.signals[place, 0] = start.signals
        log.recent[place, : len(samples)] = samples
        log.drives[place, 0] = start.drives[:, DRIVE]
        log.kept[place], log.passed[place], log.change_ends[place] = 1, 0, 0.0
        state[:] = numbers_of(start)[: state.size]
        engine = prepared.robot.scenario.settings_of(Compiled)
        state[loop.STATUS], state[loop.SAMPLES] = loop.DONE, len(samples)
        state[loop.PLANNED] = min(engine.look_ahead, engine.max_step)
        state[loop.DUE] = log.times[place, 1]
        self._places.signals[place], self._places.holds[place] = start.signals, 0
        self._prepared[place], self._ends[place] = prepared, marks[-1]
        self.readings.time[place] = 0.0
        self._wall_times[place] = self._tried[place] = 0.0
        self._controlled[place] = prepared.driven.is_controlled

    def stop(self, place: int) -> float:
        for thread in self._threads:
            thread.leave(place)
        self._status[place] = loop.IDLE
        self._prepared[place] = self.failures[place] = None
        return float(self._wall_times[place])

    def copy(self, place: int, to: int) -> None:
        if place == to:
            return
        self.stop(to)
        logged = set(loop.Log._fields) - {"place"}
        tables = [getattr(self._log, name) for name in logged]
        tables += [self._places.states, self._places.constants]
        tables += [self._places.signals, self._places.holds]
        tables += [self._heights, self._ends, self._wall_times, self._tried, *self.readings]
        tables.append(self._controlled)
        for table in tables:
            table[to] = table[place]
        self._places.constants[to, self._first_height] = to * self._heights.shape[1]
        self._prepared[to], self.failures[to] = self._prepared[place], self.failures[place]

    def _advance(self, until: np.ndarray, signals: np.ndarray | None, briefly: bool) -> None:
        places, log = self._places, self._log
        log.until[:] = np.minimum(until, self._ends)
        goes = (self._status == loop.DONE) & (self._times < log.until)
        if signals is not None:
            period = self._first.constants.period
            holds = goes & self._controlled
            changes = holds & (signals != places.signals).any(axis=1)
            log.change_ends[changes] = (self._times[changes] + period).round(MARK_DECIMALS)
            places.signals[holds], places.holds[holds] = signals[holds], 1
        self._status[goes] = loop.RUNNING
        work = places.states[:, loop.TRIED] - self._tried
        self._tried += work
        longest_first = np.argsort(-work, kind="stable")  # so that the lanes end together
        self._simulate(longest_first[goes[longest_first]], briefly=briefly)
        for place in np.flatnonzero(self._status > loop.DONE).tolist():
            self.failures[place] = self.failures[place] or self._failure(place)

    def _simulate(self, places: np.ndarray, *, briefly: bool) -> None:
        """Lets robots go on, and simulates in all threads."""
        if self._process != os.getpid():
            self._start_pool()
        first, *others = self._threads
        for i, thread in enumerate(self._threads):
            thread.take(places[i :: len(self._threads)])
        simulate = functools.partial(
            LaneThread.simulate, wall_times=self._wall_times, briefly=briefly
        )
        started = [self._pool.submit(simulate, thread) for thread in others]
        simulate(first)
        for other in started:
            other.result()

    def ended(self, place: int) -> bool:
        if self._status[place] == loop.DONE:
            return bool(self._times[place] >= self._ends[place])
        return bool(self._status[place] > loop.DONE)

    def _result(self, place: int) -> SimulationResult:
        prepared, state = self._prepared[place], self._places.states[place].copy()
        assert prepared is not None
        return make_result(
            prepared.driven,
            self.motion(place),
            totals=views(prepared.start.tally, state[self._tally :]),
            work=IntegratorWork(
                scheme="ros2",
                accuracy=prepared.robot.scenario.settings_of(Compiled).tolerance,
                steps=int(state[loop.TAKEN]),
                derivative_evaluations=loop.EVALUATIONS * int(state[loop.TRIED]),
            ),
            wall_time=float(self._wall_times[place]),
            record=prepared.record,
        )

    def motion(self, place: int) -> Motion:
        """Samples of the latest simulation in a place, up to now."""
        log = self._log
        kept = slice(log.kept[place])
        return Motion(
            times=log.times[place, kept].copy(),
            states=log.states[place, kept].copy(),
            signals=log.signals[place, kept].copy(),
            modes=log.modes[place, kept].copy(),
            drives=log.drives[place, kept].copy(),
        )

    def _failure(self, place: int) -> SimulationFailure:
        """The failure of the robot in a place, by its status."""
        prepared, time = self._prepared[place], float(self._times[place])
        assert prepared is not None
        failure: SimulationFailure
        if self._status[place] == loop.TOO_MANY_EVALUATIONS:
            budget = prepared.robot.scenario.simulation.max_evaluations
            reason = f"force evaluations exceed the budget of {budget}"
            failure = StepBudgetExceeded(time=time, reason=reason)
        elif self._status[place] == loop.TOO_FAST:
            limit = float(prepared.constants.max_speed[0])
            failure = Diverged.too_fast(time=time, limit=limit)
        else:
            failure = Diverged(time=time, reason="no step is small enough for the tolerance")
        failure.wall_time = float(self._wall_times[place])
        return failure


class LaneThread:
    """Lanes of one thread, and its queue of robots that wait for a lane."""

    def __init__(
        self,
        first: Prepared,
        log: loop.Log,
        places: Places,
        heights: np.ndarray,
        readings: Readings,
    ) -> None:
        """Lanes for robots like `first`. All threads share the tables of the places."""
        self._lane_places = np.zeros_like(log.place)
        self._queue, self._waiting = np.zeros_like(places.queue), np.zeros_like(places.waiting)
        self._constants, constants = _constants_in_lanes(first.constants, heights)
        lanes, states = in_lanes(first.start, processor_lanes())
        self._status = lanes.clock.array[loop.STATUS]
        self._status[:] = loop.IDLE
        parts = (
            self._constants,
            lanes,
            log._replace(place=self._lane_places),
            Memory(states, constants),
            places._replace(queue=self._queue, waiting=self._waiting),
            readings,
            first.driven.is_live,
        )
        self._parts = Packed(parts)
        self._advance = machine_code(advance, self._parts, 0)
        self._rounds = max(1, _BODY_STEPS // (ROUND * len(first.robot.structure.bodies)))

    def widen(self, network: Network) -> None:
        """Widens the range of inhibiting neurons, which is one for all lanes, for a network."""
        own: Any = self._constants.network
        own.first.array[:] = np.minimum(own.first.array, network.first)
        own.beyond.array[:] = np.maximum(own.beyond.array, network.beyond)

    def take(self, places: Sequence[int] | np.ndarray) -> None:
        """Appends places to those whose robots wait."""
        self._set_waiting([*self._left(), *places])

    def leave(self, place: int) -> None:
        """Takes the robot of a place out of its lane, or out of the queue."""
        self._set_waiting([other for other in self._left() if other != place])
        self._status[self._lane_places == place] = loop.IDLE

    def simulate(self, wall_times: np.ndarray, *, briefly: bool) -> None:
        """Simulates until all robots have ended; or `briefly`, see Batch.advance(). Adds the time
        (s) that it takes to the wall times of the robots."""
        while robots := self._robots():
            started = time.perf_counter()
            self._advance(self._parts, self._rounds)
            wall_times[robots] += (time.perf_counter() - started) / len(robots)
            if briefly:
                return
            check_time()

    def _robots(self) -> list[int]:
        """The places of the robots in the lanes and in the queue."""
        return [*self._lane_places[self._status == loop.RUNNING].tolist(), *self._left()]

    def _left(self) -> list[int]:
        """The places in the queue."""
        left: list[int] = self._waiting[self._queue[NEXT] : self._queue[LAST]].tolist()
        return left

    def _set_waiting(self, places: Sequence[int]) -> None:
        self._waiting[: len(places)] = places
        self._queue[NEXT], self._queue[LAST] = 0, len(places)


def processor_lanes() -> int:
    """Number of lanes on this processor, for any number of robots, so that one kernel is compiled.

    The results do not depend on it. Eight doubles fill a register of AVX-512. With narrower
    registers, eight lanes would need more registers than there are, so four are faster.
    """
    return 8 if "+avx512f" in processor_features() else 4


def processor_features() -> str:
    """Instruction sets that numba compiles for, such as "+avx2": from its settings or the
    machine."""
    return registry.cpu_target.target_context.codegen().magic_tuple()[2]


def _constants_in_lanes(
    constants: loop.Constants, heights: np.ndarray
) -> tuple[loop.Constants, np.ndarray]:
    """Tables in lanes for constants like the given ones, and their memory (numbers, lanes)."""
    width = processor_lanes()
    lanes, memory = in_lanes(constants, width)
    # A field of any size: one compiled kernel serves robots of any size.
    inhibition = FieldArray(lanes.network.inhibition.array, width, any_size=True)
    ground = lanes.robot.ground._replace(heights=FieldArray(heights.ravel()))
    robot, network = lanes.robot._replace(ground=ground), lanes.network
    return lanes._replace(robot=robot, network=network._replace(inhibition=inhibition)), memory


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
