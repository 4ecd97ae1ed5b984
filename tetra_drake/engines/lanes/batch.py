"""Engine `compiled`: several robots side by side in the registers of each core, without Drake.

A core of the processor simulates 4 or 8 robots at once, each in a lane: one number of each vector
register. A batch may have more robots than there are lanes: each robot has a place in tables, and
they take turns in the lanes.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import os
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numba.core import registry

from tetra_drake.engines.batch import Batch, Tables, Viewer
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
from tetra_drake.laws.terrain import SurfaceGrid
from tetra_drake.results.result import IntegratorWork, SimulationResult, make_result
from tetra_drake.results.trajectory import Motion
from tetra_drake.robot.command import driven_robot
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.readings import Readings, bodies_state
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.signals import MARK_DECIMALS, DrivenRobot
from tetra_drake.robot.structure import with_origins
from tetra_drake.scenario.scenario import Scenario

FIRST = SurfaceGrid._fields.index("first")
"""Column of Ground.grid with the index of a robot's first terrain height. It differs between
robots, because one table has the heights of all robots."""

_SPARE_MARKS = 4
"""Number of marks (times at which a step must end) that a robot may have more than the first robot
of the batch."""

_NEVER = 1e300
"""Time (s) of the next sample of a robot without samples. At an infinite one a motion ends."""

_BODY_STEPS = 25_000
"""Bodies times iterations of the simulation loop in one call of the kernel, about 30 ms. Between
calls Python handles signals of the operating system and checks time limits."""


class LaneBatch(Batch):
    """Batch of the compiled engine. Each thread simulates 4 or 8 robots at once, in lanes."""

    def __init__(
        self,
        robots: Sequence[DrivenRobot],
        *,
        places: int | None = None,
        record: bool = False,
        threads: int = 1,
    ) -> None:
        """Puts robots at their start; for the arguments see Engine.start(). Compiles the kernel if
        necessary."""
        places = places or len(robots)
        first = self._first = Prepared.of(robots[0], record=record)
        super().__init__(first.driven.robot.structure, places)
        self._prepared: list[Prepared | None] = [None] * places
        self._ends, self._wall_times, self._tried = np.zeros((3, places))
        self._controlled = np.zeros(places, dtype=bool)
        state, constants = numbered(first.start), numbered(first.constants)
        self._tally = int(state.tally.begins[0])
        self._first_height = int(constants.robot.ground.grid[FIRST])
        self._latest = first
        self._sizes = first.sizes | {"marks": first.sizes["marks"] + _SPARE_MARKS}
        sizes = self._sizes | {
            "places": places,
            "lanes": processor_lanes(),
            "numbers": int(state.step.end[0]),
            "constants": numbers_of(first.constants).size,
        }
        self._log, self._places = allocate(loop.Log, sizes), allocate(Places, sizes)
        self._status = self._places.states[:, loop.STATUS]
        self._times = self._places.states[:, loop.TIME]
        self._heights = np.zeros((places, sizes["heights"]))
        tables = self._log, self._places, self._heights, self.readings
        self._threads = [LaneThread(first, *tables) for _ in range(min(threads, places))]
        self._process: int | None = None
        """The process that has started the pool of threads. A fork needs a pool of its own."""
        self._begin_all(robots)

    def begin(self, place: int, robot: DrivenRobot) -> bool:
        first, log = self._first, self._log
        same = [known for known in (first, self._latest) if known.driven is robot]
        prepared = self._latest = same[0] if same else first.like(robot)
        fits = all(prepared.sizes[name] <= size for name, size in self._sizes.items())
        if not fits or prepared.kind != first.kind:
            return False
        self.stop(place)
        start, heights = prepared.start, robot.robot.ground.heights
        state = self._places.states[place]
        self._put_constants(place, prepared.constants)
        self._heights[place, : heights.size] = heights
        marks, turns, samples = robot.marks, prepared.turns, robot.samples
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
        self._places.signals[place], self._places.holds[place] = start.signals, 0
        self._prepared[place], self._ends[place] = prepared, marks[-1]
        self.readings.time[place] = 0.0
        self._wall_times[place] = self._tried[place] = 0.0
        self._controlled[place] = robot.is_controlled
        self._follow(place, robot)
        return True

    def _put_constants(self, place: int, constants: loop.Constants) -> None:
        self._places.constants[place] = numbers_of(constants)
        self._places.constants[place, self._first_height] = place * self._heights.shape[1]

    def _become(self, place: int, robot: Robot, p_BC: np.ndarray) -> None:
        prepared = self._prepared[place]
        assert prepared is not None
        model = robot.model._replace(ground=robot.ground._replace(heights=None))
        changed = prepared.constants._replace(robot=model, senses=robot.senses)
        self._put_constants(place, changed)
        bodies = self._places.states[place, -13 * len(p_BC) :]  # step.state, the last numbers
        bodies[:] = with_origins(bodies, p_BC)

    def _rename(self, place: int, driven: DrivenRobot) -> None:
        prepared = self._prepared[place]
        assert prepared is not None
        self._prepared[place] = dataclasses.replace(prepared, driven=driven)

    def _save(self, places: Sequence[int]) -> dict[str, np.ndarray]:
        states = self._places.states[places]
        states[:, loop.DUE] = _NEVER  # it depends on what is recorded
        return {"states": states, "held": self._places.signals[places]}

    def _restore(self, places: Sequence[int], saved: Tables) -> None:
        log, states = self._log, self._places.states
        states[places], self._places.signals[places] = saved["states"], saved["held"]
        self._places.holds[places], log.change_ends[places] = 0, 0.0
        self._tried[places] = states[places, loop.TRIED]
        # A mark is passed as soon as a step has ended there.
        log.passed[places] = (log.marks[places] <= states[places, loop.TIME, None]).sum(axis=1)

    def _remember(self, place: int, motion: Motion) -> None:
        kept = self._log.kept[place] = len(motion.times)
        for name in ("states", "signals", "modes", "drives"):
            getattr(self._log, name)[place, :kept] = getattr(motion, name)
        self._places.states[place, loop.DUE] = self._log.times[place, kept]

    def assume(self, place: int, time: float, readings: Readings) -> None:
        robot, prepared = self._phases[place][0].robot, self._prepared[place]
        assert prepared is not None
        start, row = prepared.start, self._places.states[place]
        clock, modes, *_, tally, state = views((*start[:7], start.step.state), row)
        state[:] = bodies_state(readings, robot.structure)
        modes[:] = 0.0  # what touches the ground touches down in the next step
        clock[loop.TIME], clock[loop.PLANNED] = time, start.clock[loop.PLANNED]
        clock[loop.TRIED], clock[loop.ACTIVE], tally.time[0] = 0.0, 1.0, time
        self._restore([place], self._save([place]))
        self.readings.put(place, readings._replace(time=time))
        self.has_history[place] = False

    def stop(self, place: int) -> float:
        for thread in self._threads:
            thread.leave(place)
        self._status[place] = loop.IDLE
        self._prepared[place] = self.failures[place] = None
        self._follow(place, None)
        return float(self._wall_times[place])

    def _hold(self, until: np.ndarray, signals: np.ndarray) -> None:
        places, period = self._places, self._first.constants.period
        holds = self._before(until) & self._controlled
        changes = holds & (signals != places.signals).any(axis=1)
        self._log.change_ends[changes] = (self._times[changes] + period).round(MARK_DECIMALS)
        places.signals[holds], places.holds[holds] = signals[holds], 1

    def _before(self, until: np.ndarray) -> np.ndarray:
        """True for each robot (N,) that pauses, and has neither ended nor reached its time (s) in
        `until`."""
        is_before = self._times < np.minimum(until, self._ends)
        return np.asarray((self._status == loop.DONE) & is_before)

    def _advance(self, until: np.ndarray, *, briefly: bool) -> None:
        places, goes = self._places, self._before(until)
        self._log.until[:] = np.minimum(until, self._ends)
        self._status[goes] = loop.RUNNING
        work = places.states[:, loop.TRIED] - self._tried
        self._tried += work
        longest_first = np.argsort(-work, kind="stable")  # so that the lanes end together
        waiting = longest_first[goes[longest_first]]

        if self._process != os.getpid():
            self._pool, self._process = ThreadPoolExecutor(len(self._threads)), os.getpid()
        first, *others = self._threads
        for i, thread in enumerate(self._threads):
            thread.waiting = [*thread.waiting, *waiting[i :: len(self._threads)]]
        simulate = functools.partial(
            LaneThread.simulate, wall_times=self._wall_times, briefly=briefly
        )
        started = [self._pool.submit(simulate, thread) for thread in others]
        simulate(first)
        for other in started:
            other.result()
        for place in np.flatnonzero(self._status > loop.DONE).tolist():
            self.failures[place] = self.failures[place] or self._failure(place)

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
                accuracy=float(prepared.constants.tolerance[0]),
                steps=int(state[loop.TAKEN]),
                derivative_evaluations=loop.EVALUATIONS * int(state[loop.TRIED]),
            ),
            wall_time=float(self._wall_times[place]),
            record=prepared.record,
        )

    def motion(self, place: int) -> Motion:
        """Recorded motion of the robot in place number `place` of the batch, up to its present
        time."""
        log, kept = self._log, slice(self._log.kept[place])
        tables = log.times, log.states, log.signals, log.modes, log.drives
        return Motion(*(table[place, kept].copy() for table in tables))

    def _failure(self, place: int) -> SimulationFailure:
        prepared, time = self._prepared[place], float(self._times[place])
        assert prepared is not None
        failure: SimulationFailure
        if self._status[place] == loop.TOO_MANY_EVALUATIONS:
            budget = prepared.driven.robot.scenario.simulation.max_evaluations
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
    """Lanes of one thread, each for one robot, and the thread's queue of waiting robots."""

    def __init__(
        self,
        first: Prepared,
        log: loop.Log,
        places: Places,
        heights: np.ndarray,
        readings: Readings,
    ) -> None:
        """Makes idle lanes for robots like `first`. The other arguments are tables with a row per
        place of the batch, which all threads share: see Log, Places and Readings. `heights`
        (places, heights) of the terrains are in m."""
        width = processor_lanes()
        self._lane_places = np.zeros_like(log.place)
        self._queue, self._waiting = np.zeros_like(places.queue), np.zeros_like(places.waiting)
        constants, constant_numbers = in_lanes(first.constants, width)
        robot = constants.robot
        ground = robot.ground._replace(heights=FieldArray(heights.ravel()))
        constants = constants._replace(robot=robot._replace(ground=ground))
        lanes, states = in_lanes(first.start, width)
        self._status = lanes.clock.array[loop.STATUS]
        self._status[:] = loop.IDLE
        parts = (
            constants,
            lanes,
            log._replace(place=self._lane_places),
            Memory(states, constant_numbers),
            places._replace(queue=self._queue, waiting=self._waiting),
            readings,
            first.driven.is_live,
        )
        self._parts = Packed(parts)
        self._advance = machine_code(advance, self._parts, 0)
        self._rounds = max(1, _BODY_STEPS // (ROUND * len(first.driven.robot.structure.bodies)))

    @property
    def waiting(self) -> list[int]:
        """Places (indices in the batch) of the robots that wait for a lane, in their order."""
        waiting: list[int] = self._waiting[self._queue[NEXT] : self._queue[LAST]].tolist()
        return waiting

    @waiting.setter
    def waiting(self, places: Sequence[int]) -> None:
        self._waiting[: len(places)] = places
        self._queue[NEXT], self._queue[LAST] = 0, len(places)

    def leave(self, place: int) -> None:
        """Takes the robot in place number `place` of the batch out of its lane, or out of the queue
        of waiting robots, wherever it is. Its state is not saved."""
        self.waiting = [other for other in self.waiting if other != place]
        self._status[self._lane_places == place] = loop.IDLE

    def simulate(self, wall_times: np.ndarray, *, briefly: bool) -> None:
        """Simulates until all robots of this thread have ended or paused. With `briefly` it returns
        after one call of the kernel, at most some 30 ms.

        The wall time (s) is divided equally among the robots and added to `wall_times` (places,).
        """
        while robots := [*self._lane_places[self._status == loop.RUNNING], *self.waiting]:
            started = time.perf_counter()
            self._advance(self._parts, self._rounds)
            wall_times[robots] += (time.perf_counter() - started) / len(robots)
            if briefly:
                return
            check_time()


def processor_lanes() -> int:
    """Number of lanes, the robots that a core of this processor simulates at once: 4 or 8.

    It is the same for any number of robots, so that one kernel is compiled. The results do not
    depend on it. Eight doubles fill a register of AVX-512. With narrower
    registers, eight lanes would need more registers than there are, so four are faster.
    """
    _, processor, features = registry.cpu_target.target_context.codegen().magic_tuple()
    return 8 if processor == "x86-64-v4" or "+avx512f" in features else 4


class CompiledEngine(Engine):
    """Engine `compiled`: simulates in compiled kernels. Other Python threads run meanwhile."""

    lanes = processor_lanes()

    def prepare(self, scenario: Scenario) -> None:
        self.start([driven_robot(scenario, seeded_gait(scenario))])

    def start(
        self, robots: Sequence[DrivenRobot], *, viewer: Viewer | None = None, **options: Any
    ) -> LaneBatch:
        return LaneBatch(robots, **options)


ENGINE = CompiledEngine()
