"""Evaluating many vectors at once, on any concurrent.futures executor."""

from __future__ import annotations

import contextlib
import math
import multiprocessing
import os
import pickle
import signal
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent import futures
from concurrent.futures import BrokenExecutor, Executor, Future
from multiprocessing import resource_tracker
from multiprocessing.connection import wait as wait_for_any
from multiprocessing.context import SpawnContext, SpawnProcess
from typing import Any, Generic, TypeVar

from tetra_drake.errors import InputError
from tetra_drake.machine import available_cores
from tetra_drake.optimizers.base import Evaluation

MakeExecutor = Callable[[int], Executor]
"""Makes an executor with this many workers; if they are not its to choose, its attribute `workers`
says how many there are, which may change."""

TASKS_PER_WORKER = 150
"""After as many a fresh worker takes its place: Drake before 1.56 keeps about 2 MB of every
diagram that holds Python systems."""


@contextlib.contextmanager
def deaf_to_ctrl_c() -> Iterator[None]:
    """A block whose new threads and processes, and theirs, no Ctrl-C reaches, from birth."""
    resource_tracker.ensure_running()  # it starts with the first process, and unblocks signals
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class _Worker(SpawnProcess):
    """A process that a Ctrl-C at the terminal does not reach, not even while it starts."""

    def start(self) -> None:
        with deaf_to_ctrl_c():
            super().start()


class _WorkerContext(SpawnContext):
    Process = _Worker


def process_executor(workers: int) -> futures.ProcessPoolExecutor:
    """Worker processes that start from scratch, are recycled, and end with their parent."""
    executor = futures.ProcessPoolExecutor(
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


thread_executor: MakeExecutor = futures.ThreadPoolExecutor
"""Threads, for evaluations that let other threads run meanwhile, as the compiled engine."""


def _do_nothing(*_: object) -> None:
    """The first task of each worker."""


def _end_with_parent() -> None:
    """Ends this worker when its parent ends; it would wait for work for ever otherwise."""

    def watch() -> None:
        wait_for_any([multiprocessing.parent_process().sentinel])  # type: ignore[union-attr]
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


JobT = TypeVar("JobT")
TaskT = TypeVar("TaskT")

_HOPELESS = 3
"""Workers that tasks end before any task has succeeded: then no task can run."""


class EvaluationImpossible(InputError):
    """No evaluation can run: workers do not start, or cannot load the function."""


class EvaluationPool(Generic[JobT]):
    """Evaluates tasks (mostly vectors), at most `workers` at a time; `job` identifies each.

    An evaluation that has `many(tasks)` and `side_by_side`, the number of tasks for which that is
    fastest, gets tasks in chunks of up to that number.

    If a worker dies, what was under way there runs again, one at a time; a task that ends its
    worker when alone counts as failed. Before any task has succeeded it waits for another try
    instead, as the cause may be that none can run: then EvaluationImpossible is raised.
    """

    # The queue is kept here, and an executor never has more chunks than workers: with a backlog,
    # Python's process pool can forget to replace recycled workers and then hangs.

    def __init__(
        self,
        evaluate: Callable[[Any], Evaluation],
        *,
        workers: int,
        executor: MakeExecutor = process_executor,
    ) -> None:
        check_sendable(evaluate, executor)
        self._evaluate = evaluate
        self._workers = workers
        self._make_executor = executor
        self._executor = executor(workers)
        self._queue: deque[tuple[JobT, Any]] = deque()
        self._suspects: deque[tuple[JobT, Any]] = deque()
        """Tasks that were under way when a worker died."""
        self._running: dict[Future[list[Evaluation]], list[tuple[JobT, Any]]] = {}
        self._deaths_before_success: int | None = 0
        """Tasks that ended a worker of their own; None once any task has succeeded."""

    def __enter__(self) -> EvaluationPool[JobT]:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        for future in self._running:
            future.cancel()
        self._executor.shutdown(wait=kind is None)
        if kind is not None:
            _terminate_workers()

    @property
    def busy(self) -> bool:
        """True if anything is under way or waiting."""
        return any((self._running, self._queue, self._suspects))

    def submit(self, job: JobT, task: object) -> None:
        """Puts a task in the queue."""
        self._queue.append((job, task))

    def wait(self, timeout: float | None = None) -> list[tuple[JobT, Evaluation]]:
        """Evaluations that are done, as soon as there is one or time (s) is up."""
        if not self._suspects:
            self._send_chunks()
        elif not self._running:
            return self._try_suspect()
        return self._collect(timeout)

    def _send_chunks(self) -> None:
        """Keeps the workers busy."""
        while self._queue and (size := self._chunk_size()):
            chunk = [self._queue.popleft() for _ in range(size)]
            try:
                self._running[self._send(self._executor, chunk)] = chunk
            except BrokenExecutor:
                self._queue.extendleft(reversed(chunk))
                self._renew()

    def _chunk_size(self) -> int:
        """Number of tasks for the next idle worker: its share of those that wait, but not more than
        are fast side by side; 0 if none is idle."""
        idle = getattr(self._make_executor, "workers", self._workers) - len(self._running)
        if idle <= 0:
            return 0
        return min(math.ceil(len(self._queue) / idle), getattr(self._evaluate, "side_by_side", 1))

    def _collect(self, timeout: float | None) -> list[tuple[JobT, Evaluation]]:
        """Evaluations that are done; if the executor has broken, there is a new one."""
        done, _ = futures.wait(self._running, timeout, return_when=futures.FIRST_COMPLETED)
        evaluated: list[tuple[JobT, Evaluation]] = []
        broken = False
        for future in done:
            chunk = self._running.pop(future)
            if future.cancelled():
                raise EvaluationImpossible("executor", "", _DROPPED)
            error = future.exception()
            if _is_death(error):
                self._suspects.extend(chunk)
                broken = broken or isinstance(error, BrokenExecutor)
                continue
            self._deaths_before_success = None
            for (job, _), evaluation in zip(chunk, future.result(), strict=True):
                evaluated.append((job, evaluation))
        if broken:
            for chunk in self._running.values():
                self._suspects.extend(chunk)
            self._running.clear()
            self._renew()
        return evaluated

    def _try_suspect(self) -> list[tuple[JobT, Evaluation]]:
        """Evaluates a suspect in a worker of its own: if that dies, the suspect is the cause."""
        job, task = self._suspects.popleft()
        alone = self._make_executor(1)
        try:
            (evaluation,) = self._send(alone, [(job, task)]).result()
        except Exception as error:
            if not _is_death(error):
                raise
            if self._deaths_before_success is None:
                return [(job, Evaluation.failed("its process died"))]
            self._deaths_before_success += 1
            if self._deaths_before_success == _HOPELESS or not self.busy:
                problem = "every evaluation ends its worker process"
                raise EvaluationImpossible(_SOURCE, "", problem) from error
            self.submit(job, task)
            return []
        finally:
            alone.shutdown(wait=False)
        self._deaths_before_success = None
        return [(job, evaluation)]

    def _send(self, executor: Executor, chunk: list[tuple[JobT, Any]]) -> Future[list[Evaluation]]:
        return executor.submit(_evaluate_chunk, self._evaluate, [task for _, task in chunk])

    def _renew(self) -> None:
        self._executor.shutdown(wait=False)
        _terminate_workers()  # a broken pool may wait for ever for one it has not told to end
        if self._deaths_before_success is not None and self._make_executor is process_executor:
            _check_worker(self._evaluate)
        self._executor = self._make_executor(self._workers)


def _evaluate_chunk(
    evaluate: Callable[[Any], Evaluation], tasks: Sequence[Any]
) -> list[Evaluation]:
    """Task of a worker."""
    if hasattr(evaluate, "many"):
        return evaluate.many(tasks)
    return [evaluate(task) for task in tasks]


def _is_death(error: BaseException | None) -> bool:
    """True if a worker died: one of Python's or MPI's, with its executor, or one of Dask's."""
    if isinstance(error, BrokenExecutor):
        return True
    dask = sys.modules.get("distributed")
    return dask is not None and isinstance(error, dask.KilledWorker)


def evaluate_all(
    evaluate: Callable[[TaskT], Evaluation],
    tasks: Sequence[TaskT],
    *,
    workers: int | None = None,
    executor: MakeExecutor = process_executor,
) -> Iterator[tuple[int, Evaluation]]:
    """Evaluates tasks (mostly vectors) and yields each one's index and evaluation when ready.

    `workers`: one per core by default. Raises EvaluationImpossible, and what `evaluate` raises.
    """
    if not tasks:
        return
    workers = workers or available_cores()
    with EvaluationPool[int](evaluate, workers=workers, executor=executor) as pool:
        for index, task in enumerate(tasks):
            pool.submit(index, task)
        while pool.busy:
            yield from pool.wait()


_SOURCE = "worker processes"
_DROPPED = "has dropped evaluations, as if its scheduler had ended; the run can be resumed"
_INSTEAD = "or use threads: executor=concurrent.futures.ThreadPoolExecutor"
_UNGUARDED = 'the program lacks `if __name__ == "__main__":` around what it does'


def check_guard() -> None:
    """Raises EvaluationImpossible in a worker that is importing the program and so runs it."""
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        raise EvaluationImpossible(_SOURCE, "", _UNGUARDED)


def check_sendable(evaluate: object, executor: MakeExecutor) -> None:
    """Raises EvaluationImpossible if worker processes are to get the function and cannot."""
    check_guard()
    if executor is not process_executor:
        return
    try:
        pickled = pickle.dumps(evaluate)
    except Exception as error:
        problem = f"cannot be sent the evaluation ({error}): define it in a module, {_INSTEAD}"
        raise EvaluationImpossible(_SOURCE, "", problem) from error
    program = sys.modules["__main__"]
    file = getattr(program, "__file__", None)
    if file is None and b"__main__" in pickled:
        problem = f"cannot import what is defined interactively: use a module, {_INSTEAD}"
        raise EvaluationImpossible(_SOURCE, "", problem)
    if file is not None and program.__spec__ is None and not os.path.exists(file):
        problem = f"have to import the program, and '{file}' is no file: save it, {_INSTEAD}"
        raise EvaluationImpossible(_SOURCE, "", problem)


def _check_worker(evaluate: object) -> None:
    """Raises EvaluationImpossible if a new worker, which says why, ends before it can evaluate."""
    worker = _Worker(target=_do_nothing, args=(evaluate,))
    worker.start()
    worker.join()
    if worker.exitcode:
        problem = f"do not start, as they say above; it may be that {_UNGUARDED}"
        raise EvaluationImpossible(_SOURCE, "", problem)


def _terminate_workers() -> None:
    for process in multiprocessing.active_children():
        if isinstance(process, _Worker):
            process.terminate()
