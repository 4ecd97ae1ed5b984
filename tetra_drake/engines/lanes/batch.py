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
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numba.core import registry

from tetra_drake.engines.engine import SAME_TIME, Engine, Viewer
from tetra_drake.engines.lanes import loop
from tetra_drake.engines.lanes.places import LAST, NEXT, ROUND, Memory, Places, advance
from tetra_drake.engines.lanes.prepared import Prepared
from tetra_drake.engines.lanes.tables import in_lanes, numbered, numbers_of, views
from tetra_drake.engines.time_limit import check_time
from tetra_drake.errors import Diverged, InputError, SimulationFailure, StepBudgetExceeded
from tetra_drake.kernels.compiling import machine_code
from tetra_drake.kernels.lanes import FieldArray
from tetra_drake.kernels.packed import Packed, allocate
from tetra_drake.laws.actuator import DRIVE
from tetra_drake.laws.terrain import SurfaceGrid
from tetra_drake.results.result import IntegratorWork, SimulationResult, make_result
from tetra_drake.results.trajectory import Motion
from tetra_drake.robot.command import policy_signals
from tetra_drake.robot.readings import Readings, bodies_state
from tetra_drake.robot.robot import Phase
from tetra_drake.robot.signals import MARK_DECIMALS, DrivenRobot

FIRST = SurfaceGrid._fields.index("first")
"""Column of Ground.grid with the index of a robot's first terrain height. It differs between
robots, because one table has the heights of all robots."""

_SPARE_MARKS = 4
"""Number of marks (times at which a step must end) that a robot may have more than the first robot
of the batch."""

_HISTORY = ("times", "states", "signals", "modes", "drives")
"""Tables of the log that are the recorded motion of robots, fields of Motion."""

_NEVER = 1e300
"""Time (s) of the next sample of a robot without samples. At an infinite one a motion ends."""

_BODY_STEPS = 25_000
"""Bodies times iterations of the simulation loop in one call of the kernel, about 30 ms. Between
calls Python handles signals of the operating system and checks time limits."""


class LaneBatch:
    """Robots that the compiled engine simulates side by side. Each thread simulates 4 or 8 robots
    at once, in lanes.

    A batch has a fixed number N of places, numbered from 0. Each robot is in a place; a place
    without a robot is idle. Robots pause and go on; their states can be saved and restored.
    """

    def __init__(
        self,
        robot: DrivenRobot,
        *,
        places: int = 1,
        record: bool = False,
        threads: int = 1,
    ) -> None:
        """Puts a robot at its start in the first place. Compiles the kernel if necessary.

        Args:
            robot: the first robot; all have the same structure and kinds of laws.
            places: number of robots that the batch can hold. The other places are idle until
                begin().
            record: records the trajectories, for the results.
            threads: number of threads that share the robots.
        """
        first = self._first = Prepared.of(robot, record=record)
        self.readings = Readings.empty(robot.robot.structure, places)
        """Readings of all robots at their last pause. At the start only the times are set."""
        self.failures: list[SimulationFailure | None] = [None] * places
        """Failure of the robot in each place; None if it has not failed."""
        self._prepared: dict[int, Prepared] = {}
        """Robots by their places."""
        self._phases = np.zeros(places, dtype=int)
        """Number of events that have changed the robot in each place, its index in Robot.phases."""
        self._events, self._actions = np.full((2, places), math.inf)
        """Times (s) of the next event, and of the next action of the policy, in each place;
        infinite if there is none."""
        self._ends, self._wall_times, self._tried = np.zeros((3, places))
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
        self.rolled: np.ndarray = self._places.states[:, int(state.tally.rolled[0])]
        """Angle (rad) by which the robot in each place has rolled forward; see Tally.rolled."""
        self._heights = np.zeros((places, sizes["heights"]))
        tables = self._log, self._places, self._heights, self.readings
        self._threads = [LaneThread(first, *tables) for _ in range(min(threads, places))]
        self._process: int | None = None
        """The process that has started the pool of threads. A fork needs a pool of its own."""
        self.begin(0, robot)

    def begin(self, place: int, robot: DrivenRobot) -> bool:
        """Puts a robot at its start into a place of the batch.

        Returns False, and changes nothing, if the robot differs too much from the first one of the
        batch: it has another structure or kind of law, or needs larger tables, such as of terrain
        heights.
        """
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
        self._phases[place], self._events[place] = 0, _begin(robot.robot.phases[1:])
        self._actions[place] = robot.pilot.acts_after(0.0) if robot.pilot else math.inf
        return True

    def advance(
        self,
        until: float | np.ndarray = math.inf,
        signals: np.ndarray | None = None,
        *,
        briefly: bool = False,
    ) -> None:
        """Simulates each robot until its time in `until`, the end of its simulation, or a failure.
        Robots change at the times of their scenario's events, and their policies act.

        Calls time_limit.check_time() often, which raises TimeBudgetExceeded.

        Args:
            until: simulated times (s), for each place (N,) or for all. A robot that has reached its
                time pauses.
            signals: m actuator signals (N, m) of robots without a gait or a command, which are
                forces in newtons. They change linearly from the old ones within one network step,
                `cpg.listing_step`, and are then constant. A robot that pauses ignores them.
            briefly: returns as soon as a robot has ended, after some 30 ms of wall time, or at the
                next event or action of a policy.
        """
        until = np.broadcast_to(until, len(self.failures))
        if signals is not None:
            self._hold(until, signals)
        while True:
            self._pass_events()
            self._act()
            instants = np.minimum(self._events, self._actions)
            # The policies act together: their robots wait for each other.
            waits = bool(np.isfinite(self._actions).any())
            self._advance(np.minimum(until, instants), briefly=briefly and not waits)
            self._events[self.ended] = self._actions[self.ended] = math.inf
            instants = np.minimum(self._events, self._actions)
            if briefly or not (np.isfinite(instants) & (instants <= until)).any():
                return

    def _pass_events(self) -> None:
        """Changes the robots that are at the time of an event."""
        while places := self._places_at(self._events):
            for place in places:
                self._enter(place, self._phases[place] + 1)

    def _act(self) -> None:
        """Lets the policies act whose robots are at the time of an action."""
        if not (places := self._places_at(self._actions)):
            return
        pilots = [pilot for place in places if (pilot := self._prepared[place].driven.pilot)]
        signals, until = np.zeros_like(self._places.signals), np.zeros_like(self._times)
        signals[places] = policy_signals(pilots, self.readings.rows(places))
        until[places] = math.inf
        self._hold(until, signals)
        for place, pilot in zip(places, pilots, strict=True):
            self._actions[place] = pilot.acts_after(self._actions[place])

    def _places_at(self, instants: np.ndarray) -> list[int]:
        """Places whose robots are at their time (s) in `instants`."""
        return np.flatnonzero(self.readings.time >= instants - SAME_TIME).tolist()

    def _put_constants(self, place: int, constants: loop.Constants) -> None:
        self._places.constants[place] = numbers_of(constants)
        self._places.constants[place, self._first_height] = place * self._heights.shape[1]

    def _enter(self, place: int, number: int) -> None:
        """Changes the robot in a place into what it is after this number of events; see
        Phase.entered()."""
        prepared = self._prepared[place]
        phases = prepared.driven.robot.phases
        robot, before = phases[number].robot, phases[self._phases[place]]
        model = robot.model._replace(ground=robot.ground._replace(heights=None))
        self._put_constants(place, prepared.constants._replace(robot=model, senses=robot.senses))
        if number != self._phases[place]:
            state = self._places.states[place, -13 * len(before.p_BC) :]  # step.state, at the end
            state[:] = phases[number].entered(state, before)
        self._phases[place], self._events[place] = number, _begin(phases[number + 1 :])

    def change(self, place: int, driven: DrivenRobot) -> None:
        """Lets the robot in a place go on as `driven`, which differs from it only by cuts of cables
        now."""
        phases, now = driven.robot.phases, self.readings.time[place] + SAME_TIME
        self._prepared[place] = dataclasses.replace(self._prepared[place], driven=driven)
        self._phases[place] = sum(phase.begins <= now for phase in phases) - 1
        self._enter(place, self._phases[place])

    def save(self, places: Sequence[int], *, history: bool) -> dict[str, np.ndarray]:
        """The states of controlled robots that pause, as tables; the first axis is `places`. With
        `history` they have the motion so far. Raises InputError if it is unknown."""
        states, log = self._places.states[places], self._log
        states[:, loop.DUE] = _NEVER  # it depends on what is recorded
        saved = {"states": states, "held": self._places.signals[places]}
        saved["phase"] = self._phases[places]
        for name, table in self.readings._asdict().items():
            saved[f"readings.{name}"] = table[places]
        if history:
            self._check_history(places, key="history")
            kept = saved["history.kept"] = log.kept[places]
            for name in _HISTORY:
                table = saved[f"history.{name}"] = getattr(log, name)[places, : kept.max(initial=0)]
                for row, known in enumerate(kept):
                    table[row, known:] = 0.0  # left from a robot before
        return saved

    def restore(self, places: Sequence[int], saved: Mapping[str, np.ndarray]) -> None:
        """Puts robots into states of save(). Places must have the same robots, which have not
        failed."""
        for place, number in zip(places, saved["phase"].tolist(), strict=True):
            if number != self._phases[place]:
                self._enter(place, number)
        for name, table in self.readings._asdict().items():
            table[places] = saved[f"readings.{name}"]
        self._go_on(places, saved["states"], saved["held"])
        self._note_failures()
        for row, place in enumerate(places if "history.kept" in saved else ()):
            kept = self._log.kept[place] = saved["history.kept"][row]
            for name in _HISTORY:
                getattr(self._log, name)[place, :kept] = saved[f"history.{name}"][row, :kept]
            self._places.states[place, loop.DUE] = self._log.times[place, kept]

    def _go_on(self, places: Sequence[int], states: np.ndarray, held: np.ndarray) -> None:
        """Puts robots into states (places, numbers), with the signals (places, m) in N that are
        held, without the motions before."""
        log = self._log
        self._places.states[places], self._places.signals[places] = states, held
        self._places.holds[places], log.change_ends[places], log.kept[places] = 0, 0.0, 0
        self._tried[places] = states[:, loop.TRIED]
        # A mark is passed as soon as a step has ended there.
        log.passed[places] = (log.marks[places] <= states[:, loop.TIME, None]).sum(axis=1)

    def assume(self, place: int, time: float, readings: Readings) -> None:
        """Puts the robot in a place into the motion of other readings at a time (s). Its actuators
        keep their states. A contact node that touches the ground sticks."""
        start, row = self._prepared[place].start, self._places.states[place]
        robot = self._prepared[place].driven.robot.phases[self._phases[place]].robot
        clock, modes, *_, tally, state = views((*start[:7], start.step.state), row)
        state[:] = bodies_state(readings, robot.structure)
        modes[:] = 0.0  # what touches the ground touches down in the next step
        clock[loop.TIME], clock[loop.PLANNED] = time, start.clock[loop.PLANNED]
        clock[loop.TRIED], clock[loop.ACTIVE], tally.time[0] = 0.0, 1.0, time
        clock[loop.DUE] = _NEVER
        self._go_on([place], row[np.newaxis].copy(), self._places.signals[[place]])
        self.readings.put(place, readings._replace(time=time))

    def stop(self, place: int) -> float:
        """Removes the robot and its failure from a place, which becomes idle. Returns the wall time
        (s) that the robot has taken."""
        for thread in self._threads:
            thread.leave(place)
        self._status[place] = loop.IDLE
        self._prepared.pop(place, None)
        self.failures[place], self._events[place], self._actions[place] = None, math.inf, math.inf
        return float(self._wall_times[place])

    def _hold(self, until: np.ndarray, signals: np.ndarray) -> None:
        """Sets the signals (N, m) of the robots that have not reached their time (s) in `until`;
        see advance()."""
        places, period = self._places, self._first.constants.period
        holds = self._before(until)
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
        self._note_failures()

    @property
    def ended(self) -> np.ndarray:
        """True for each place (N,) whose robot has failed, or reached the end of its simulation.
        False if it has only paused, or the place is idle."""
        is_over = (self._status == loop.DONE) & (self._times >= self._ends)
        return np.asarray(is_over | (self._status > loop.DONE))

    def result(self, place: int) -> SimulationResult:
        """Result of a robot that has ended, in a place. Raises its failure if it failed, and
        InputError if its motion is unknown."""
        if failure := self.failures[place]:
            raise failure
        self._check_history([place], key="result")
        prepared, state = self._prepared[place], self._places.states[place].copy()
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

    def _check_history(self, places: Sequence[int], *, key: str) -> None:
        for place in places:
            if not self._log.kept[place]:
                problem = f"robot {place} was restored without its motion: save(history=True)"
                raise InputError("Simulation", key, problem)

    def motion(self, place: int) -> Motion:
        """Recorded motion of the robot in a place, up to its present time."""
        kept = self._log.kept[place]
        return Motion(**{name: getattr(self._log, name)[place, :kept].copy() for name in _HISTORY})

    def _note_failures(self) -> None:
        """Puts new failures into `failures`."""
        for place in np.flatnonzero(self._status > loop.DONE).tolist():
            self.failures[place] = self.failures[place] or self._failure(place)

    def _failure(self, place: int) -> SimulationFailure:
        prepared, time = self._prepared[place], float(self._times[place])
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
        )
        self._advance = machine_code(advance, Packed(parts), 0)
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
            self._advance(self._rounds)
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

    def simulate(
        self, robot: DrivenRobot, *, record: bool = False, viewer: Viewer | None = None
    ) -> SimulationResult:
        batch = LaneBatch(robot, record=record)
        batch.advance()
        return batch.result(0)


def _begin(phases: Sequence[Phase]) -> float:
    """Time (s) at which the first of some phases begins; infinite if there is none."""
    return phases[0].begins if phases else math.inf


ENGINE = CompiledEngine()
