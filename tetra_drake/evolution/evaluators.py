"""Evaluation of many gaits at once. An evaluator is a context manager; it yields a function that
takes a task and returns the future of its evaluation.

    in_lanes           threads of the compiled engine, each with several gaits side by side
    on_executor        any executor of concurrent.futures: threads, Dask, MPI
    WorkerProcesses    executor for engines that hold Python's global lock

An evaluator stores no results. After a crash, a run is resumed from its record.
"""

from __future__ import annotations

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
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Any, Union

from tetra_drake.errors import InputError, check_type
from tetra_drake.formatting import Say
from tetra_drake.machine import available_cores
from tetra_drake.on_demand import loaded
from tetra_drake.optimizers.base import Evaluate, Evaluation, Task

if TYPE_CHECKING:
    from distributed import Client

    from tetra_drake.evolution.evaluation import GaitEvaluation

Submit = Callable[[Task], Future[Evaluation]]
"""Function that begins the evaluation of a task. Tasks are evaluated in any order."""

Evaluator = contextlib.AbstractContextManager[Submit]
"""Context manager that yields a Submit. The end of its block cancels the evaluations that are not
done."""

MakeExecutor = Callable[[int], Executor]
"""Function that makes an executor with the given number of workers. If it cannot choose the number,
it has an attribute `workers`: the current number, or a text about it."""

GivenExecutor = Union[Executor, MakeExecutor, "Client"]
"""An executor, a function that makes one, or a Dask client."""

TASKS_PER_WORKER = 150
"""Number of tasks after which a worker process is replaced. Drake before 1.56 leaks about 2 MB per
diagram with Python systems."""

_SOURCE = "worker processes"
_UNGUARDED = 'the program lacks `if __name__ == "__main__":` around what it does'


def evaluator_of(
    evaluate: GaitEvaluation,
    *,
    workers: int | None = None,
    executor: MakeExecutor | None = None,
    warn: Say,
) -> Evaluator:
    """The evaluator for the engine of a scenario: a context manager that yields a function, which
    begins the evaluation of a task and returns its future.

    It uses the given executor. By default it uses SIMD lanes (compiled engine) or worker processes
    (other engines) of this machine.

    Args:
        evaluate: the fitness function; its scenario names the engine.
        workers: number of threads or processes, one per core by default.
        executor: function that makes an executor with this number of workers.
        warn: function that gets the reason if the evaluation cannot be sent to worker processes.
            Then gaits are evaluated in this process.
    """
    from tetra_drake.engines.engine import engine_of

    scenario, workers = evaluate.scenario, workers or available_cores()
    engine = engine_of(scenario)
    if executor is None and engine.lanes > 1:
        return in_lanes(evaluate, workers)
    engine.prepare(scenario)
    if executor is not None:
        return on_executor(evaluate, executor, workers)
    if problem := _why_not_sent(evaluate):
        warn(f"gaits are evaluated one by one in this process: worker processes {problem}")
        return on_executor(evaluate, futures.ThreadPoolExecutor, 1)
    return on_executor(evaluate, WorkerProcesses, workers)


@contextlib.contextmanager
def in_lanes(evaluate: GaitEvaluation, workers: int) -> Iterator[Submit]:
    """Evaluator that simulates gaits side by side, in the SIMD lanes of the compiled engine. It
    yields a function that begins the evaluation of a task. `workers` is the number of threads."""
    from tetra_drake.engines.queue import SimulationQueue

    with SimulationQueue(workers, record=evaluate.records) as queue:
        yield lambda task: evaluate.on_queue(task, queue)


@contextlib.contextmanager
def on_executor(evaluate: Evaluate, make: MakeExecutor, workers: int) -> Iterator[Submit]:
    """Evaluator on an executor of concurrent.futures, which make(workers) returns. It yields a
    function that begins the evaluation of a task. At its end it shuts the executor down, unless
    `make` is a LentExecutor.

    If a worker dies, the future of its task raises the error of the executor, such as
    BrokenExecutor. A task for an executor that is broken or shut down raises InputError.
    """
    executor, is_done = make(workers), False
    check_type("evolve", "executor", executor, Executor)
    running: set[Future[Evaluation]] = set()

    def submit(task: Task) -> Future[Evaluation]:
        try:
            future = executor.submit(evaluate, task)
        except RuntimeError as error:
            problem = f"takes no more tasks; the run can be resumed: {error}"
            raise InputError("executor", "", problem) from error
        check_type("executor", "submit()", future, Future)
        running.add(future)
        future.add_done_callback(running.discard)
        return future

    try:
        yield submit
        is_done = True
    finally:
        for future in list(running):
            future.cancel()
        if not isinstance(make, LentExecutor):
            executor.shutdown(wait=is_done)


@dataclass(frozen=True)
class LentExecutor:
    """Wrapper of an executor that belongs to the user. Evaluators expect a function that makes an
    executor; a call of the wrapper returns the user's. An evaluator does not shut it down."""

    executor: Executor
    workers: int | str = "its executor's"
    """Number of the executor's workers, or a text that is shown instead."""

    def __call__(self, workers: int) -> Executor:
        return self.executor


class WorkerProcesses(Executor):
    """Executor on processes that are spawned, not forked. They end with this process, and each is
    replaced after TASKS_PER_WORKER (150) tasks."""

    def __init__(self, workers: int) -> None:
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

    def submit(self, function: Callable[..., Any], /, *args: Any, **more: Any) -> Future[Any]:
        """See Executor.submit()."""
        with deaf_to_ctrl_c():
            return self._threads.submit(
                lambda: self._processes.submit(function, *args, **more).result()
            )

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Ends the processes: after their tasks, or at once without `wait`."""
        self._threads.shutdown(wait=False, cancel_futures=cancel_futures or not wait)
        if not wait:
            self._holder.close()
        self._threads.shutdown()
        self._processes.shutdown()
        self._holder.close()
        self._lifeline.close()


def _end_with(lifeline: Connection) -> None:
    """Makes this worker process exit once the other end of the pipe `lifeline` is closed. The end
    of the parent process closes it at the latest. The call returns at once; a thread waits."""

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


def finished(
    running: dict[Future[Evaluation], Task], timeout: float | None = None
) -> list[tuple[Task, Evaluation]]:
    """Removes finished tasks from `running` (task by future); returns them with their evaluations.

    Returns when at least one is finished, or after `timeout` seconds. If a task raised an error,
    the first call that finds no other finished task raises it. Raises InputError if a worker has
    died.
    """
    done, _ = futures.wait(running, timeout, return_when=futures.FIRST_COMPLETED)
    evaluated = [f for f in done if not f.cancelled() and f.exception() is None]
    dask = sys.modules.get("distributed")
    died = (BrokenExecutor, *([dask.KilledWorker] if dask else []))
    try:
        return [_of_task(running.pop(future), future.result()) for future in evaluated or done]
    except futures.CancelledError as error:
        problem = "has dropped evaluations, as if its scheduler had ended; the run can be resumed"
        raise InputError("executor", "", problem) from error
    except died as error:
        cause = f"it may be that memory is short, or that {_UNGUARDED}"
        problem = f"do not start or have died, as they may say above; {cause}"
        raise InputError(_SOURCE, "", f"{problem}; a run can be resumed") from error


def _of_task(task: Task, found: Any) -> tuple[Task, Evaluation]:
    """A task with its evaluation. Raises InputError if an executor gave something else."""
    if not isinstance(found, Evaluation) or found.task not in ("", str(task)):
        problem = f"found {found!r:.60}, expected the evaluation of {task}"
        raise InputError("executor", "", problem)
    return task, found


def evaluate_all(submit: Submit, tasks: Iterable[Task]) -> Iterator[tuple[Task, Evaluation]]:
    """Begins the evaluation of all tasks at once; `submit` begins one and returns its future.
    Yields each task with its evaluation as soon as it is finished."""
    running = {submit(task): task for task in tasks}
    while running:
        yield from finished(running)


def check_guard() -> None:
    """Raises InputError in a worker process if importing the main program runs the program.

    This happens if the program has no `if __name__ == "__main__"` guard.
    """
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        raise InputError(_SOURCE, "", _UNGUARDED)


def _why_not_sent(evaluate: object) -> str:
    """The reason why a function cannot be sent (pickled) to worker processes; empty if it can."""
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


def maker_of(executor: GivenExecutor | None) -> MakeExecutor | None:
    """Converts the argument `executor` of evolve() to a function that makes an executor; None stays
    None. Raises InputError if the argument is neither an executor nor a Dask client nor a
    function."""
    if isinstance(executor, Executor):
        return LentExecutor(executor)
    dask = sys.modules.get("distributed")
    if dask and isinstance(executor, dask.Client):
        made: MakeExecutor = loaded("tetra_drake.lab.cluster:executor_of")(executor)
        return made
    if executor is None or callable(executor):
        return executor
    expected = "an Executor, a Dask client, or a function that makes an Executor"
    raise InputError("evolve", "executor", f"found {executor!r:.60}, expected {expected}")
