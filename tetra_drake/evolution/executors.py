"""Where evaluations run: any concurrent.futures executor, by default worker processes."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Hashable
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from dataclasses import dataclass
from multiprocessing.connection import wait as wait_for_any
from multiprocessing.context import SpawnContext, SpawnProcess
from typing import Generic, TypeVar

from tetra_drake.evolution.optimizers.base import Evaluate, Evaluation, Genome

TASKS_PER_WORKER = 150
"""A worker ends after this many evaluations and a fresh one takes its place: Drake before
1.56 keeps about 2 MB of every diagram that holds Python systems."""


class _Worker(SpawnProcess):
    """A process that a Ctrl-C at the terminal does not reach, not even while it starts."""

    def start(self) -> None:
        # The signal mask is inherited, so the new process has SIGINT blocked from birth.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            super().start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


class _WorkerContext(SpawnContext):
    Process = _Worker


def process_executor(workers: int) -> ProcessPoolExecutor:
    """Worker processes that start from scratch, are recycled, and end with their parent."""
    executor = ProcessPoolExecutor(
        workers,
        mp_context=_WorkerContext(),
        initializer=_end_with_parent,
        max_tasks_per_child=TASKS_PER_WORKER,
    )
    # All start now. Python's pool starts one with each task, and where another dies meanwhile,
    # the pool forgets the new one or raises OSError.
    for _ in range(workers):
        executor.submit(_do_nothing)
    return executor


def thread_executor(workers: int) -> ThreadPoolExecutor:
    """Threads, for evaluations that let other threads run meanwhile, as the compiled engine."""
    return ThreadPoolExecutor(workers)


def available_cores() -> int:
    """The cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _do_nothing() -> None:
    """The first task of each worker."""


def _end_with_parent() -> None:
    """Lets this worker die when its parent does; it would wait for work for ever otherwise."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def watch() -> None:
        wait_for_any([parent.sentinel])
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


JobT = TypeVar("JobT", bound=Hashable)


@dataclass(frozen=True)
class _Task(Generic[JobT]):
    job: JobT
    genome: Genome
    suspect: bool = False
    """Whether it was under way when a worker died."""


class EvaluationPool(Generic[JobT]):
    """Evaluates genomes, at most `workers` at a time; `job` says which is which.

    The queue is kept here, and an executor never has more tasks than workers: with a
    backlog, Python's process pool can forget to replace recycled workers and then hangs.
    If a worker dies, what was under way runs again, one at a time; what kills a worker by
    itself counts as failed.
    """

    def __init__(
        self, evaluate: Evaluate, *, workers: int, make_executor: Callable[[int], Executor]
    ) -> None:
        self._evaluate = evaluate
        self._workers = workers
        self._make_executor = make_executor
        self._executor = make_executor(workers)
        self._queue: deque[_Task[JobT]] = deque()
        self._suspects: deque[_Task[JobT]] = deque()
        self._running: dict[Future[Evaluation], _Task[JobT]] = {}

    @property
    def busy(self) -> bool:
        """Whether anything is under way or waiting."""
        return bool(self._running or self._queue or self._suspects)

    def submit(self, job: JobT, genome: Genome) -> None:
        """Puts a genome in the queue."""
        self._queue.append(_Task(job, genome))

    def wait(self, timeout: float | None = None) -> list[tuple[JobT, Evaluation]]:
        """Whatever has been evaluated, as soon as there is something or time (s) is up."""
        self._fill()
        done, _ = wait(self._running, timeout=timeout, return_when=FIRST_COMPLETED)
        finished: list[tuple[JobT, Evaluation]] = []
        broken: list[_Task[JobT]] = []
        for future in done:
            task = self._running.pop(future)
            try:
                finished.append((task.job, future.result()))
            except BrokenExecutor:
                broken.append(task)
        if broken:
            finished += self._recover(broken)
        return finished

    def close(self, *, at_once: bool) -> None:
        """Ends the workers; at once, or after what is under way."""
        self._executor.shutdown(wait=not at_once, cancel_futures=True)
        if at_once:
            _terminate_workers()

    def _fill(self) -> None:
        while self._suspects or self._queue:
            # A suspect runs alone: if a worker dies again it is known of what.
            if len(self._running) >= (1 if self._has_suspects() else self._workers):
                return
            task = self._suspects.popleft() if self._suspects else self._queue.popleft()
            try:
                future = self._executor.submit(self._evaluate, task.genome)
            except BrokenExecutor:
                self._suspects.appendleft(task)
                self._renew()
                continue
            self._running[future] = task

    def _has_suspects(self) -> bool:
        return bool(self._suspects) or any(task.suspect for task in self._running.values())

    def _recover(self, broken: list[_Task[JobT]]) -> list[tuple[JobT, Evaluation]]:
        """Starts new workers; what was under way with the old ones is suspect now."""
        broken += self._running.values()
        self._running.clear()
        self._renew()
        if len(broken) == 1 and broken[0].suspect:
            return [(broken[0].job, Evaluation.failed("its process died"))]
        self._suspects.extend(_Task(task.job, task.genome, suspect=True) for task in broken)
        return []

    def _renew(self) -> None:
        self._executor.shutdown(wait=False)
        _terminate_workers()  # a broken pool may wait for ever for one it has not told to end
        self._executor = self._make_executor(self._workers)


def _terminate_workers() -> None:
    for process in multiprocessing.active_children():
        if isinstance(process, _Worker):
            process.terminate()
