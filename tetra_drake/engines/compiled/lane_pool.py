"""Threads that simulate many gaits at a time, each thread several in lanes."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Sequence
from concurrent.futures import CancelledError, Future
from dataclasses import dataclass, field

from tetra_drake.engines.compiled.lane_engine import LaneEngine, lanes_for
from tetra_drake.engines.compiled.prepared import Prepared
from tetra_drake.errors import InputError, TimeBudgetExceeded
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.scenario import Scenario

_GATHERING = 1e-3
"""Time (s) that a thread without work waits for more than one gait to come."""

_BODY_STEPS = 25_000
"""Iterations times bodies, some 30 ms, after which a thread looks for time budgets and the pool's
end."""

_ROBOTS = 32
"""Robots that are kept, for gaits that are simulated on the same scenario."""


@dataclass(eq=False)
class _Job:
    scenario: Scenario
    gait: Gait
    record: bool
    time_budget: float
    future: Future[SimulationResult] = field(default_factory=Future)
    deadline: float = math.inf


class LanePool:
    """Simulates gaits on the compiled engine, in so many threads and as many lanes in each as the
    waiting gaits fill. At the end of its `with` block, what is under way is cancelled."""

    def __init__(self, threads: int) -> None:
        """Raises InputError without threads."""
        if threads < 1:
            raise InputError("workers", "", f"found {threads}, expected at least 1")
        self._waiting: deque[_Job] = deque()
        self._changed = threading.Condition()
        self._closing = False
        self._robots = _Robots()
        self._threads = [threading.Thread(target=self._work, daemon=True) for _ in range(threads)]
        for thread in self._threads:
            thread.start()

    def __enter__(self) -> LanePool:
        return self

    def __exit__(self, *_: object) -> None:
        with self._changed:
            self._closing = True
            self._changed.notify_all()
        for thread in self._threads:
            thread.join()
        for job in self._waiting:
            job.future.set_exception(CancelledError())

    def submit(
        self,
        gaits: Sequence[tuple[Scenario, Gait]],
        *,
        record: bool = False,
        time_budget: float = math.inf,
    ) -> list[Future[SimulationResult]]:
        """Puts gaits, each with its scenario, in the queue; a future raises as simulate() does.

        A gait that is not done after `time_budget` (s) fails with TimeBudgetExceeded. Callbacks of
        futures are called in the threads of the pool.
        """
        jobs = [_Job(scenario, gait, record, time_budget) for scenario, gait in gaits]
        with self._changed:
            self._waiting.extend(jobs)
            self._changed.notify_all()
        return [job.future for job in jobs]

    def _work(self) -> None:
        """Loop of a thread: fills idle lanes, simulates, hands over results."""
        crew = _Crew(self._robots)
        while (jobs := self._take(crew)) is not None:
            for job in jobs:
                if not crew.load(job, among=len(jobs)):
                    with self._changed:
                        self._waiting.appendleft(job)
            try:
                crew.advance()
            except Exception as error:  # those who wait for the lanes are told
                crew.give_up(error)
        crew.give_up(CancelledError())

    def _take(self, crew: _Crew) -> list[_Job] | None:
        """Jobs for the idle lanes of a thread; None at the pool's end."""
        with self._changed:
            while not (self._closing or self._waiting or crew.jobs):
                self._changed.wait()
            if not crew.jobs and len(self._waiting) == 1:
                self._changed.wait(_GATHERING)
            if self._closing:
                return None
            room = crew.room
            if not crew.jobs:
                share = math.ceil(len(self._waiting) / len(self._threads))
                room = min(share, lanes_for(share))
            return [self._waiting.popleft() for _ in range(min(room, len(self._waiting)))]


class _Robots:
    """Makes robots, each once for all threads that need it at a time."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._latest: dict[int, Robot] = {}
        """Robots by the identity of their scenario, the one last used at the end."""

    def __call__(self, scenario: Scenario) -> Robot:
        with self._lock:
            robot = self._latest.pop(id(scenario), None) or Robot.of(scenario)
            self._latest[id(scenario)] = robot  # with its scenario, so no other one gets its id
            if len(self._latest) > _ROBOTS:
                del self._latest[next(iter(self._latest))]
        return robot


class _Crew:
    """The lanes of one thread and the jobs in them."""

    def __init__(self, robots: _Robots) -> None:
        self.jobs: dict[int, _Job] = {}
        """Jobs by lane."""
        self._robots = robots
        self._engine: LaneEngine | None = None
        self._engines: dict[int, LaneEngine] = {}
        """Engines by width."""

    @property
    def room(self) -> int:
        """The number of idle lanes."""
        return len(self._engine.idle) if self._engine else 0

    def load(self, job: _Job, *, among: int) -> bool:
        """Puts a job in an idle lane; False if it has to wait until all lanes are idle.

        If they are, there will be lanes for as many jobs as it is `among`.
        """
        try:
            robot = self._robots(job.scenario)
            prepared = Prepared.of(robot, job.gait, record=job.record)
            engine = self._engine if self.jobs else self._engine_for(prepared, lanes_for(among))
            if engine is None or not engine.accepts(prepared):
                return False
            self._engine, lane = engine, engine.idle[0]
            engine.load(lane, prepared)
        except Exception as error:  # such as a gait that does not fit the scenario
            job.future.set_exception(error)
            return True
        job.deadline = time.perf_counter() + job.time_budget
        self.jobs[lane] = job
        return True

    def advance(self) -> None:
        """Simulates for a while; jobs that have ended leave."""
        engine = self._engine
        if engine is None or not self.jobs:
            return
        for lane in engine.advance(_BODY_STEPS):
            future = self.jobs.pop(lane).future
            try:
                result = engine.result(lane)
            except Exception as failure:  # such as one that has diverged
                future.set_exception(failure)
            else:
                future.set_result(result)
        now = time.perf_counter()
        for lane in [lane for lane, job in self.jobs.items() if now > job.deadline]:
            job = self.jobs.pop(lane)
            error = TimeBudgetExceeded(f"not done after {job.time_budget:g} s")
            error.wall_time = engine.stop(lane)
            job.future.set_exception(error)

    def give_up(self, error: Exception) -> None:
        """Ends all jobs with an error."""
        for job in self.jobs.values():
            job.future.set_exception(error)
        self.jobs, self._engine, self._engines = {}, None, {}

    def _engine_for(self, prepared: Prepared, width: int) -> LaneEngine:
        engine = self._engines.get(width)
        if engine is None or not engine.accepts(prepared):
            engine = self._engines[width] = LaneEngine(prepared, width=width)
        return engine
