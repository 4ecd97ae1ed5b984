"""Queue of simulations: several threads work it off, each with a batch that it keeps full."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Iterable
from concurrent.futures import CancelledError, Future
from dataclasses import dataclass, field

from tetra_drake.engines.batch import Batch
from tetra_drake.engines.engine import Engine, engine_of
from tetra_drake.errors import InputError, TimeBudgetExceeded
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.command import Driver, driven_robot
from tetra_drake.robot.driven import DrivenRobot
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.scenario import Scenario

_GATHERING = 1e-3
"""Time (s) that an idle thread waits for a second simulation before it starts with one."""
_ROBOTS = 32
"""Size of the cache of robots."""


@dataclass(eq=False)
class _Job:
    scenario: Scenario
    driver: Driver
    time_budget: float
    future: Future[SimulationResult] = field(default_factory=Future)
    deadline: float = math.inf


class SimulationQueue:
    """Queue of gaits and commands. Each thread simulates as many as its engine has lanes. The end
    of the `with` block cancels unfinished simulations."""

    def __init__(self, threads: int, *, record: bool = False) -> None:
        """Starts the threads. Raises InputError if `threads` is less than 1."""
        if threads < 1:
            raise InputError("workers", "", f"found {threads}, expected at least 1")
        self._record = record
        self._waiting: deque[_Job] = deque()
        self._changed = threading.Condition()
        self._closing = False
        self._robots = _Robots()
        self._threads = [threading.Thread(target=self._work, daemon=True) for _ in range(threads)]
        for thread in self._threads:
            thread.start()

    def __enter__(self) -> SimulationQueue:
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
        self, drivers: Iterable[tuple[Scenario, Driver]], *, time_budget: float = math.inf
    ) -> list[Future[SimulationResult]]:
        """Queues gaits or commands with their scenarios. Returns futures of the results.

        A future raises the same errors as simulate(), and TimeBudgetExceeded if the simulation
        takes longer than `time_budget` (s), on an engine with lanes. Callbacks of futures run in
        the threads of the queue.
        """
        jobs = [_Job(scenario, driver, time_budget) for scenario, driver in drivers]
        with self._changed:
            self._waiting.extend(jobs)
            self._changed.notify_all()
        return [job.future for job in jobs]

    def _work(self) -> None:
        """Main loop of a thread: fills idle places, simulates, sets results."""
        crew = _Crew(self._robots, record=self._record)
        while (jobs := self._take(crew)) is not None:
            refused = [job for job in jobs if not crew.begin(job)]
            with self._changed:
                self._waiting.extendleft(reversed(refused))
            try:
                crew.advance()
            except Exception as error:  # all jobs in the batch fail with it
                crew.give_up(error)
        crew.give_up(CancelledError())

    def _take(self, crew: _Crew) -> list[_Job] | None:
        """Waits for jobs for the idle places of a thread; None at the end of the queue."""
        with self._changed:
            while not (self._closing or self._waiting or crew.jobs):
                self._changed.wait()
            if not crew.jobs and len(self._waiting) == 1:
                self._changed.wait(_GATHERING)
            if self._closing:
                return None
            count = len(crew.idle)
            if not crew.jobs:
                share = math.ceil(len(self._waiting) / len(self._threads))
                lanes = engine_of(self._waiting[0].scenario).lanes if self._waiting else 0
                count = min(share, lanes)
            return [self._waiting.popleft() for _ in range(min(count, len(self._waiting)))]


class _Robots:
    """Cache of robots by scenario, shared by all threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._latest: dict[int, Robot] = {}
        """Robots by the id() of their scenario; the last used one is at the end."""

    def driven(self, job: _Job) -> DrivenRobot:
        """The robot of a job."""
        if not isinstance(job.driver, Gait):
            return driven_robot(job.scenario, job.driver)
        with self._lock:
            scenario = job.scenario
            robot = self._latest.pop(id(scenario), None) or Robot.of(scenario)
            self._latest[id(scenario)] = robot  # keeps the scenario alive, so its id stays unique
            if len(self._latest) > _ROBOTS:
                del self._latest[next(iter(self._latest))]
        return DrivenRobot.of(robot, job.driver)


class _Crew:
    """Batch of one thread, and the jobs in it."""

    def __init__(self, robots: _Robots, *, record: bool) -> None:
        self.jobs: dict[int, _Job] = {}
        """Jobs by place."""
        self.idle: list[int] = []
        """Places without a job."""
        self._robots, self._record = robots, record
        self._engine: Engine | None = None
        self._batch: Batch | None = None

    def begin(self, job: _Job) -> bool:
        """Puts a job in an idle place. Returns False if it must wait until all places are idle."""
        try:
            robot, engine = self._robots.driven(job), engine_of(job.scenario)
            place = self._placed(robot, engine)
        except Exception as error:  # a gait may not fit its scenario
            job.future.set_exception(error)
            return True
        if place is not None:
            job.deadline = time.perf_counter() + job.time_budget
            self.jobs[place] = job
        return place is not None

    def _placed(self, robot: DrivenRobot, engine: Engine) -> int | None:
        """The place that a robot takes; None if it does not fit beside the others."""
        if self._batch and engine is self._engine and self._batch.begin(self.idle[0], robot):
            return self.idle.pop(0)
        if self.jobs:
            return None
        self._batch = engine.start([robot], places=engine.lanes, record=self._record)
        self._engine, self.idle = engine, list(range(1, engine.lanes))
        return 0

    def advance(self) -> None:
        """Simulates for a short time, and removes finished jobs."""
        batch = self._batch
        if batch is None or not self.jobs:
            return
        batch.advance(briefly=True)
        now = time.perf_counter()
        for place, job in list(self.jobs.items()):
            if batch.ended(place):
                try:
                    result = batch.result(place)
                except Exception as failure:  # the simulation may have diverged
                    job.future.set_exception(failure)
                else:
                    job.future.set_result(result)
                batch.stop(place)
            elif now > job.deadline:
                error = TimeBudgetExceeded(f"not done after {job.time_budget:g} s")
                error.wall_time = batch.stop(place)
                job.future.set_exception(error)
            else:
                continue
            del self.jobs[place]
            self.idle.append(place)

    def give_up(self, error: Exception) -> None:
        """Ends all jobs with the same error."""
        for job in self.jobs.values():
            job.future.set_exception(error)
        self.jobs, self.idle, self._batch = {}, [], None
