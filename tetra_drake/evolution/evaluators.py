"""Evaluators: take a task and return a future of its evaluation.

    InLanes        threads of the compiled engine, each with several gaits side by side
    InProcesses    worker processes, for engines that hold Python's global lock
    OnExecutor     any executor of concurrent.futures: threads, Dask, MPI

An evaluator stores no results. After a crash, a run is resumed from its record.
"""

from __future__ import annotations

import abc
import contextlib
import multiprocessing
import os
import pickle
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent import futures
from concurrent.futures import BrokenExecutor, Executor, Future
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Any

from tetra_drake.errors import InputError
from tetra_drake.formatting import Say
from tetra_drake.machine import available_cores
from tetra_drake.optimizers.base import Evaluate, Evaluation, Task

if TYPE_CHECKING:
    from tetra_drake.evolution.evaluation import GaitEvaluation

MakeExecutor = Callable[[int], Executor]
"""Function that makes an executor with the given number of workers. If it cannot choose the number,
it has an attribute `workers`: the current number, or a text about it."""

TASKS_PER_WORKER = 150
"""Number of tasks after which a worker process is replaced. Drake before 1.56 leaks about 2 MB per
diagram with Python systems."""


class Evaluator(contextlib.AbstractContextManager["Evaluator"]):
    """Evaluates tasks in any order. It is used in a `with` block; the end of the block cancels the
    evaluations that are not done."""

    @abc.abstractmethod
    def submit(self, task: Task) -> Future[Evaluation]:
        """Future of a task's evaluation. If the worker dies, the future raises the error of its
        executor, such as BrokenExecutor."""


def evaluator_of(
    evaluate: GaitEvaluation,
    *,
    workers: int | None = None,
    executor: MakeExecutor | None = None,
    warn: Say,
) -> Evaluator:
    """The evaluator for a scenario's engine; the engine's code is compiled on return.

    It uses the given executor. By default it uses lanes or processes of this machine, one per core.
    If the evaluation cannot be sent to worker processes, gaits are evaluated in this process, and
    `warn` gets the reason.
    """
    from tetra_drake.engines.engine import engine_of

    scenario, workers = evaluate.scenario, workers or available_cores()
    engine = engine_of(scenario)
    if executor is None and engine.lanes > 1:
        return InLanes(evaluate, workers)
    engine.prepare(scenario)
    if executor is not None:
        return OnExecutor(evaluate, executor, workers)
    if problem := _why_not_sent(evaluate):
        warn(f"gaits are evaluated one by one in this process: worker processes {problem}")
        return OnExecutor(evaluate, futures.ThreadPoolExecutor, 1)
    return InProcesses(evaluate, workers)


class InLanes(Evaluator):
    """Evaluates gaits in the lanes of the compiled engine, in several threads."""

    def __init__(self, evaluate: GaitEvaluation, workers: int) -> None:
        from tetra_drake.engines.queue import SimulationQueue

        self._evaluate = evaluate
        self._queue = SimulationQueue(workers, record=evaluate.records)

    def __exit__(self, *error: object) -> None:
        self._queue.__exit__(*error)

    def submit(self, task: Task) -> Future[Evaluation]:
        """See Evaluator.submit()."""
        return self._evaluate.on_queue(task, self._queue)


class InProcesses(Evaluator):
    """Evaluates in worker processes. They are spawned, not forked, and end with this process."""

    def __init__(self, evaluate: Evaluate, workers: int) -> None:
        self._evaluate = evaluate
        self._lifeline, self._holder = multiprocessing.Pipe(duplex=False)
        self._processes = futures.ProcessPoolExecutor(
            workers,
            mp_context=multiprocessing.get_context("spawn"),
            initializer=_end_with,
            initargs=(self._lifeline,),
            max_tasks_per_child=TASKS_PER_WORKER,
        )
        # An executor with more tasks than processes does not replace its processes
        # (https://github.com/python/cpython/issues/115634). So tasks wait in front of threads.
        self._threads = futures.ThreadPoolExecutor(workers)

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._threads.shutdown(wait=False, cancel_futures=True)
        if kind is not None:
            self._holder.close()
        self._threads.shutdown()
        self._processes.shutdown()
        self._holder.close()
        self._lifeline.close()

    def submit(self, task: Task) -> Future[Evaluation]:
        """See Evaluator.submit()."""
        with deaf_to_ctrl_c():
            return self._threads.submit(self._in_process, task)

    def _in_process(self, task: Task) -> Evaluation:
        return self._processes.submit(self._evaluate, task).result()


def _end_with(lifeline: Connection) -> None:
    """Ends this worker process when the other end of the pipe is closed, at the latest by the end
    of the parent process."""

    def watch() -> None:
        lifeline.poll(None)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


@contextlib.contextmanager
def deaf_to_ctrl_c() -> Iterator[None]:
    """Context manager: threads that start in the block never receive Ctrl-C, nor do processes that
    start in the block or in these threads."""
    resource_tracker.ensure_running()  # its start would unblock signals, so it starts before
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class OnExecutor(Evaluator):
    """Evaluates on an executor of concurrent.futures."""

    def __init__(self, evaluate: Evaluate, make: MakeExecutor, workers: int) -> None:
        self._evaluate, self._executor = evaluate, make(workers)
        self._submitted: set[Future[Evaluation]] = set()

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        for future in list(self._submitted):
            future.cancel()
        self._executor.shutdown(wait=kind is None)

    def submit(self, task: Task) -> Future[Evaluation]:
        """See Evaluator.submit(). Raises InputError if the executor is broken or shut down."""
        try:
            future = self._executor.submit(self._evaluate, task)
        except RuntimeError as error:
            problem = f"takes no more tasks; the run can be resumed: {error}"
            raise InputError("executor", "", problem) from error
        self._submitted.add(future)
        future.add_done_callback(self._submitted.discard)
        return future


class Lent(Executor):
    """An executor of the user, as a MakeExecutor: it is not shut down."""

    def __init__(self, executor: Executor, workers: int | str = "its executor's") -> None:
        self._executor, self.workers = executor, workers

    def __call__(self, workers: int) -> Executor:
        return self

    def submit(self, function: Callable[..., Any], /, *args: Any, **more: Any) -> Future[Any]:
        """See Executor.submit()."""
        return self._executor.submit(function, *args, **more)


Running = dict[Future[Evaluation], Task]
"""Submitted tasks, by the futures of their evaluations."""


def submitted(evaluator: Evaluator, tasks: Iterable[Task]) -> Running:
    """Submits tasks to an evaluator."""
    return {evaluator.submit(task): task for task in tasks}


def finished(running: Running, timeout: float | None = None) -> list[tuple[Task, Evaluation]]:
    """Removes finished tasks from `running`; returns them with their evaluations.

    Returns when at least one is finished, or after `timeout` seconds. An error of a task is raised
    after all finished tasks were returned. Raises InputError if a worker has died.
    """
    done, _ = futures.wait(running, timeout, return_when=futures.FIRST_COMPLETED)
    evaluated = [f for f in done if not f.cancelled() and f.exception() is None]
    return [(running.pop(future), _result(future)) for future in evaluated or done]


def _result(future: Future[Evaluation]) -> Evaluation:
    try:
        return future.result()
    except futures.CancelledError as error:
        problem = "has dropped evaluations, as if its scheduler had ended; the run can be resumed"
        raise InputError("executor", "", problem) from error
    except Exception as error:
        dask = sys.modules.get("distributed")
        if isinstance(error, BrokenExecutor) or (dask and isinstance(error, dask.KilledWorker)):
            cause = f"it may be that memory is short, or that {_UNGUARDED}"
            problem = f"do not start or have died, as they may say above; {cause}"
            raise InputError(_SOURCE, "", f"{problem}; a run can be resumed") from error
        raise


def evaluate_all(evaluator: Evaluator, tasks: Iterable[Task]) -> Iterator[tuple[Task, Evaluation]]:
    """Evaluates tasks. Yields each task with its evaluation as soon as it is finished."""
    running = submitted(evaluator, tasks)
    while running:
        yield from finished(running)


_SOURCE = "worker processes"
_UNGUARDED = 'the program lacks `if __name__ == "__main__":` around what it does'


def check_guard() -> None:
    """Raises InputError in a worker process whose import of the main program runs the program."""
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        raise InputError(_SOURCE, "", _UNGUARDED)


def _why_not_sent(evaluate: object) -> str:
    """The reason why a function cannot be sent to worker processes; empty if it can."""
    try:
        pickled = pickle.dumps(evaluate)
    except Exception as error:
        return f"cannot be sent the evaluation ({error}); define it in a module"
    program = sys.modules["__main__"]
    file = getattr(program, "__file__", None)
    if file is None and b"__main__" in pickled:
        return "cannot import what is defined interactively; define it in a module"
    if file is not None and program.__spec__ is None and not os.path.exists(file):
        return f"have to import the program, and '{file}' is no file"
    return ""
