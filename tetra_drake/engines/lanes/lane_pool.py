"""Pool of threads that simulate many gaits; each thread simulates several in lanes."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Sequence
from concurrent.futures import CancelledError, Future
from dataclasses import dataclass, field

from tetra_drake.engines.gait_simulation import Driver, GaitSimulation
from tetra_drake.engines.lanes.lane_engine import LaneEngine, processor_lanes
from tetra_drake.engines.lanes.prepared import Prepared
from tetra_drake.errors import InputError, TimeBudgetExceeded
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.command import Command
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.scenario import Scenario

_GATHERING = 1e-3
"""Time (s) that an idle thread waits for a second gait before it starts with one."""
_BODY_STEPS = 25_000
"""Iterations times bodies per call of the kernel, about 30 ms. Between calls a thread checks time
budgets and the end of the pool."""
_ROBOTS = 32
"""Size of the cache of robots."""


@dataclass(eq=False)
class _Job:
    scenario: Scenario
    driver: Driver
    record: bool
    time_budget: float
    future: Future[SimulationResult] = field(default_factory=Future)
    deadline: float = math.inf


class LanePool:
    """Simulates gaits on the compiled engine in several threads, each in lanes of its own. The end
    of the `with` block cancels unfinished gaits."""

    def __init__(self, threads: int) -> None:
        """Starts the threads. Raises InputError if `threads` is less than 1."""
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
        drivers: Sequence[tuple[Scenario, Driver]],
        *,
        record: bool = False,
        time_budget: float = math.inf,
    ) -> list[Future[SimulationResult]]:
        """Queues gaits or commands with their scenarios. Returns futures of the results.

        A future raises the same errors as simulate(), and TimeBudgetExceeded if the gait takes
        longer than `time_budget` (s). Callbacks of futures run in the threads of the pool.
        """
        jobs = [_Job(scenario, driver, record, time_budget) for scenario, driver in drivers]
        with self._changed:
            self._waiting.extend(jobs)
            self._changed.notify_all()
        return [job.future for job in jobs]

    def _work(self) -> None:
        """Main loop of a thread: fills idle lanes, simulates, sets results."""
        crew = _Crew(self._robots)
        while (jobs := self._take(crew)) is not None:
            for job in jobs:
                if not crew.load(job):
                    with self._changed:
                        self._waiting.appendleft(job)
            try:
                crew.advance()
            except Exception as error:  # all jobs in the lanes fail with it
                crew.give_up(error)
        crew.give_up(CancelledError())

    def _take(self, crew: _Crew) -> list[_Job] | None:
        """Waits for jobs for the idle lanes of a thread; None at the end of the pool."""
        with self._changed:
            while not (self._closing or self._waiting or crew.jobs):
                self._changed.wait()
            if not crew.jobs and len(self._waiting) == 1:
                self._changed.wait(_GATHERING)
            if self._closing:
                return None
            count = crew.idle_lanes
            if not crew.jobs:
                share = math.ceil(len(self._waiting) / len(self._threads))
                count = min(share, processor_lanes())
            return [self._waiting.popleft() for _ in range(min(count, len(self._waiting)))]


class _Robots:
    """Cache of robots by scenario, shared by all threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._latest: dict[int, Robot] = {}
        """Robots by the id() of their scenario; the last used one is at the end."""

    def __call__(self, scenario: Scenario) -> Robot:
        with self._lock:
            robot = self._latest.pop(id(scenario), None) or Robot.of(scenario)
            self._latest[id(scenario)] = robot  # keeps the scenario alive, so its id stays unique
            if len(self._latest) > _ROBOTS:
                del self._latest[next(iter(self._latest))]
        return robot


class _Crew:
    """Lanes of one thread, and the jobs in them."""

    def __init__(self, robots: _Robots) -> None:
        self.jobs: dict[int, _Job] = {}
        """Jobs by place."""
        self._robots = robots
        self._engine: LaneEngine | None = None

    @property
    def idle_lanes(self) -> int:
        """Number of idle lanes."""
        return len(self._engine.idle) if self._engine else 0

    def load(self, job: _Job) -> bool:
        """Puts a job in an idle lane. Returns False if the job must wait until all lanes are
        idle."""
        try:
            prepared = Prepared.of(self._simulation(job))
            engine = self._engine
            if engine is None or not engine.accepts(prepared):
                if self.jobs:
                    return False
                engine = self._engine = LaneEngine(prepared)
            place = engine.idle[0]
            engine.load(place, prepared)
        except Exception as error:  # a gait may not fit its scenario
            job.future.set_exception(error)
            return True
        job.deadline = time.perf_counter() + job.time_budget
        self.jobs[place] = job
        return True

    def _simulation(self, job: _Job) -> GaitSimulation:
        if isinstance(job.driver, Command):  # its robot has the command's signals
            return GaitSimulation.of(job.scenario, job.driver, record=job.record)
        return GaitSimulation(self._robots(job.scenario), job.driver, record=job.record)

    def advance(self) -> None:
        """Simulates for a short time and removes finished jobs."""
        engine = self._engine
        if engine is None or not self.jobs:
            return
        for place in engine.advance(_BODY_STEPS):
            future = self.jobs.pop(place).future
            try:
                result = engine.result(place)
            except Exception as failure:  # the simulation may have diverged
                future.set_exception(failure)
            else:
                future.set_result(result)
            engine.stop(place)
        now = time.perf_counter()
        for place in [place for place, job in self.jobs.items() if now > job.deadline]:
            job = self.jobs.pop(place)
            error = TimeBudgetExceeded(f"not done after {job.time_budget:g} s")
            error.wall_time = engine.stop(place)
            job.future.set_exception(error)

    def give_up(self, error: Exception) -> None:
        """Ends all jobs with the same error."""
        for job in self.jobs.values():
            job.future.set_exception(error)
        self.jobs, self._engine = {}, None
