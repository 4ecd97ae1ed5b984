"""Queue of simulations for several threads. Each thread keeps a batch full of them."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import CancelledError, Future
from dataclasses import dataclass, field

from tetra_drake.engines.engine import engine_of
from tetra_drake.engines.lanes.batch import LaneBatch
from tetra_drake.errors import InputError, TimeBudgetExceeded
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.command import Command, Driver, driven_robot
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.signals import DrivenRobot
from tetra_drake.scenario.scenario import Scenario

_GATHERING = 1e-3
"""Time (s) that an idle thread waits for a second simulation before it starts with one."""
_ROUNDS = 4
"""Number of robots with a policy per lane. They pause together, so more than one per lane keep the
lanes full."""
_ROBOTS = 32
"""Largest number of robots in the cache. Gaits on the same scenario share its robot."""


@dataclass(eq=False)
class _Job:
    scenario: Scenario
    driver: Driver
    time_budget: float
    future: Future[SimulationResult] = field(default_factory=Future)
    deadline: float = math.inf


class SimulationQueue:
    """Queue of simulations, each of a gait or a command, that several threads run.

    On the compiled engine, each thread simulates as many robots side by side as there are lanes; on
    other engines, one robot after another. Use the queue in a `with` block; its end cancels
    unfinished simulations.
    """

    def __init__(self, threads: int, *, record: bool = False) -> None:
        """Starts the threads, `threads` of them. With `record`, results have trajectories. Raises
        InputError if `threads` is less than 1."""
        if threads < 1:
            raise InputError("workers", "", f"found {threads}, expected at least 1")
        self._record = record
        self._waiting: deque[_Job] = deque()
        self._changed = threading.Condition()
        self._closing = False
        self._robots: dict[int, Robot] = {}
        """Robots by the id() of their scenario; the last used one is at the end."""
        self._robots_lock = threading.Lock()
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
        """Queues pairs of a scenario and a gait or command. Returns a future of each result, in the
        same order.

        A future raises the same errors as simulate(). On the compiled engine it raises
        TimeBudgetExceeded if its thread computes for longer than `time_budget` (s); other engines
        ignore the budget. Callbacks of futures run in the threads of the queue.
        """
        jobs = [_Job(scenario, driver, time_budget) for scenario, driver in drivers]
        with self._changed:
            self._waiting.extend(jobs)
            self._changed.notify_all()
        return [job.future for job in jobs]

    def _work(self) -> None:
        crew = _Crew(self._driven, self._record)
        while True:
            with self._changed:
                while not (self._closing or self._waiting or crew.jobs):
                    self._changed.wait()
                if not crew.jobs and len(self._waiting) == 1:
                    self._changed.wait(_GATHERING)
                if self._closing:
                    break
                count = len(crew.idle)
                if not crew.jobs:
                    share = math.ceil(len(self._waiting) / len(self._threads))
                    places = _places_for(self._waiting[0].scenario) if self._waiting else 0
                    count = min(share, places)
                jobs = [self._waiting.popleft() for _ in range(min(count, len(self._waiting)))]

            refused = [job for job in jobs if not crew.begin(job)]
            with self._changed:
                self._waiting.extendleft(reversed(refused))
            try:
                crew.advance()
            except Exception as error:  # all jobs in the batch fail with it
                crew.give_up(error)
        crew.give_up(CancelledError())

    def _driven(self, job: _Job) -> DrivenRobot:
        """The robot of a job. Gaits on the same scenario share a robot."""
        scenario, driver = job.scenario, job.driver
        if isinstance(driver, Command) or driver.body:
            return driven_robot(scenario, driver)
        with self._robots_lock:
            robot = self._robots.pop(id(scenario), None) or Robot.of(scenario)
            self._robots[id(scenario)] = robot  # keeps the scenario alive, so its id stays unique
            if len(self._robots) > _ROBOTS:
                del self._robots[next(iter(self._robots))]
        return driven_robot(scenario, driver, robot=robot)


def _places_for(scenario: Scenario) -> int:
    """Number of robots like the scenario's that a thread simulates side by side."""
    lanes = engine_of(scenario).lanes
    return lanes * _ROUNDS if scenario.policy is not None and lanes > 1 else lanes


@dataclass
class _Crew:
    """Simulations of one thread of the queue: a batch of robots, and the jobs that it simulates. A
    job is a gait or a command on a scenario, with the future of its result. Other engines than
    `compiled` have no batch: a job is done as soon as it has begun."""

    driven: Callable[[_Job], DrivenRobot]
    """Function that makes the robot of a job."""
    record: bool
    jobs: dict[int, _Job] = field(default_factory=dict)
    """Jobs by their place, the index in the batch."""
    idle: list[int] = field(default_factory=list)
    """Places (indices in the batch) without a job."""
    batch: LaneBatch | None = None

    def begin(self, job: _Job) -> bool:
        """Puts a job into an idle place of the batch. Returns False if its robot does not fit the
        others: then it must wait until all places are idle. If the job cannot start, its future
        gets the error."""
        try:
            robot, engine = self.driven(job), engine_of(job.scenario)
            fits = engine.lanes > 1 and self.batch and self.batch.begin(self.idle[0], robot)
            if self.jobs and not fits:
                return False
            if engine.lanes == 1:
                job.future.set_result(engine.simulate(robot, record=self.record))
                return True
            if not fits:
                places = _places_for(job.scenario)
                self.batch = LaneBatch(robot, places=places, record=self.record)
                self.idle = list(range(places))
        except Exception as error:  # a gait may not fit its scenario
            job.future.set_exception(error)
            return True
        job.deadline = time.thread_time() + job.time_budget
        self.jobs[self.idle.pop(0)] = job
        return True

    def advance(self) -> None:
        """Simulates until a robot has ended, or for some 30 ms of wall time. Sets the futures of
        finished jobs and of jobs that took too long, and removes these jobs."""
        batch = self.batch
        if batch is None or not self.jobs:
            return
        batch.advance(briefly=True)
        now, ended = time.thread_time(), batch.ended
        for place, job in list(self.jobs.items()):
            if ended[place]:
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
        """Ends all jobs: their futures get the same error, and all places become idle."""
        for job in self.jobs.values():
            job.future.set_exception(error)
        self.jobs, self.idle, self.batch = {}, [], None
