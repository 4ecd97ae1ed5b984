"""Evaluators: a task in, a future of its evaluation out.

    InLanes        threads of the compiled engine, each with several gaits side by side
    InProcesses    worker processes, for engines that keep Python to themselves
    OnExecutor     any executor of concurrent.futures: threads, Dask, MPI

Whatever dies, a run goes on from its record. An evaluator keeps nothing.
"""

from __future__ import annotations

import contextlib
import functools
import itertools
import multiprocessing
import os
import pickle
import signal
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent import futures
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from multiprocessing import resource_tracker
from multiprocessing.connection import wait as wait_for_any
from multiprocessing.context import SpawnContext, SpawnProcess
from typing import TYPE_CHECKING, Protocol, Self

from tetra_drake.errors import InputError
from tetra_drake.machine import available_cores
from tetra_drake.optimizers.base import Evaluate, Evaluation, Task

if TYPE_CHECKING:
    from tetra_drake.engines.compiled.lane_pool import LanePool
    from tetra_drake.evolution.evaluation import GaitEvaluation

MakeExecutor = Callable[[int], Executor]
"""Makes an executor with this many workers. One that cannot choose their number has an attribute
`workers`: the current number."""

TASKS_PER_WORKER = 150
"""Tasks after which a worker process is replaced: Drake before 1.56 keeps about 2 MB of every
diagram that holds Python systems."""


class Evaluator(Protocol):
    """Evaluates tasks, in any order, within its `with` block; at its end, what is under way is
    cancelled."""

    def __enter__(self) -> Self: ...

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None: ...

    def submit(self, task: Task) -> Future[Evaluation]:
        """Future of a task's evaluation. If the worker dies, it raises what its executor raises
        then, such as BrokenExecutor."""


def evaluator_of(
    evaluate: GaitEvaluation,
    *,
    workers: int | None = None,
    executor: MakeExecutor | None = None,
    warn: Callable[[str], None],
) -> Evaluator:
    """The evaluator for gaits on a scenario's engine, compiled: on an executor if one is given,
    else in lanes or processes of this machine, one per core by default.

    If worker processes cannot get the evaluation, it takes place in this one, and `warn` is told.
    """
    from tetra_drake.engines.interface import engine_of
    from tetra_drake.engines.simulate import prepare

    scenario, workers = evaluate.scenario, workers or available_cores()
    lane_pool = engine_of(scenario).lane_pool
    if executor is None and lane_pool is not None:
        return InLanes(evaluate, lane_pool(workers))
    prepare(scenario)
    if executor is not None:
        return OnExecutor(evaluate, executor, workers)
    if problem := _why_not_sent(evaluate):
        warn(f"gaits are evaluated one by one in this process: worker processes {problem}")
        return OnExecutor(evaluate, futures.ThreadPoolExecutor, 1)
    return InProcesses(evaluate, workers)


class InLanes:
    """Evaluates gaits in the lanes of the compiled engine."""

    def __init__(self, evaluate: GaitEvaluation, lanes: LanePool) -> None:
        self._evaluate, self._lanes = evaluate, lanes

    def __enter__(self) -> Self:
        self._lanes.__enter__()
        return self

    def __exit__(self, *error: object) -> None:
        self._lanes.__exit__(*error)

    def submit(self, task: Task) -> Future[Evaluation]:
        """See Evaluator.submit(). All draws of a task are simulated side by side."""
        evaluate, evaluated, ended = self._evaluate, Future[Evaluation](), itertools.count(1)
        simulations = evaluate.simulations(task)
        results = self._lanes.submit(
            simulations,
            record=evaluate.records,
            time_budget=evaluate.scenario.evolution.time_budget,
        )

        def end(_: object) -> None:
            if next(ended) < len(results):
                return
            try:
                draws = [
                    evaluate.judged(scenario, result.result)
                    for (scenario, _), result in zip(simulations, results, strict=True)
                ]
                evaluated.set_result(evaluate.combined(task, draws))
            except BaseException as error:
                evaluated.set_exception(error)

        for result in results:
            result.add_done_callback(end)
        return evaluated


class InProcesses:
    """Evaluates in worker processes, which start from scratch and end with this one."""

    def __init__(self, evaluate: Evaluate, workers: int) -> None:
        self._threads = futures.ThreadPoolExecutor(workers)
        self._workers = [_Worker(evaluate) for _ in range(workers)]
        self._idle = deque(self._workers)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._threads.shutdown(wait=False, cancel_futures=True)
        for worker in self._workers if kind is not None else ():
            worker.kill()
        self._threads.shutdown()
        for worker in self._workers:
            worker.end()

    def submit(self, task: Task) -> Future[Evaluation]:
        """See Evaluator.submit()."""
        return self._threads.submit(self._in_process, task)

    def _in_process(self, task: Task) -> Evaluation:
        worker = self._idle.pop()  # one for each thread
        try:
            return worker.evaluate(task)
        finally:
            self._idle.append(worker)


class _Worker:
    """A worker process, which is replaced if it dies and after TASKS_PER_WORKER tasks.

    It has an executor of its own, as processes of one executor die together.
    """

    def __init__(self, evaluate: Evaluate) -> None:
        self._evaluate = evaluate
        self._executor: Executor | None = None
        self._process, self._tasks_left, self._killed = 0, 0, False

    def evaluate(self, task: Task) -> Evaluation:
        """The evaluation of a task; BrokenExecutor if the process dies."""
        if self._executor is None or self._tasks_left == 0:
            self.end()
            self._executor = self._start()
        self._tasks_left -= 1
        try:
            return self._executor.submit(self._evaluate, task).result()
        except BrokenExecutor:
            self._tasks_left = 0
            raise

    def _start(self) -> Executor:
        executor = futures.ProcessPoolExecutor(1, _Context(), initializer=_end_with_parent)
        try:
            self._process = executor.submit(_load, self._evaluate).result()
        except BrokenExecutor as error:
            problem = f"do not start, as they say above; it may be that {_UNGUARDED}"
            raise InputError(_SOURCE, "", problem) from error
        self._tasks_left = TASKS_PER_WORKER
        if self._killed:
            executor.shutdown()
            raise CancelledError
        return executor

    def end(self) -> None:
        """Lets the process end."""
        if self._executor is not None:
            self._executor.shutdown()

    def kill(self) -> None:
        """Ends the process at once; no other one takes its place."""
        self._killed = True
        for process in multiprocessing.active_children():
            if process.pid == self._process:
                process.terminate()


def _load(evaluate: Evaluate) -> int:
    """First task of a worker process, which loads the function: its process number."""
    return os.getpid()


class _DeafProcess(SpawnProcess):
    """A process that a Ctrl-C at the terminal does not reach, not even while it starts."""

    def start(self) -> None:
        with deaf_to_ctrl_c():
            super().start()


class _Context(SpawnContext):
    Process = _DeafProcess


@contextlib.contextmanager
def deaf_to_ctrl_c() -> Iterator[None]:
    """A block whose new threads and processes, and theirs, no Ctrl-C reaches, from birth."""
    resource_tracker.ensure_running()  # it starts with the first process, and unblocks signals
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _end_with_parent() -> None:
    """Ends this worker when its parent ends; it would wait for work for ever otherwise."""

    def watch() -> None:
        wait_for_any([multiprocessing.parent_process().sentinel])  # type: ignore[union-attr]
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


class OnExecutor:
    """Evaluates on an executor of concurrent.futures, which is made again where it breaks."""

    def __init__(self, evaluate: Evaluate, make: MakeExecutor, workers: int) -> None:
        self._evaluate, self._make = evaluate, functools.partial(make, workers)
        self._executor = self._make()
        self._submitted: set[Future[Evaluation]] = set()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        for future in list(self._submitted):
            future.cancel()
        self._executor.shutdown(wait=kind is None)

    def submit(self, task: Task) -> Future[Evaluation]:
        """See Evaluator.submit()."""
        try:
            future = self._executor.submit(self._evaluate, task)
        except BrokenExecutor:
            self._executor.shutdown(wait=False)
            self._executor = self._make()
            future = self._executor.submit(self._evaluate, task)
        self._submitted.add(future)
        future.add_done_callback(self._submitted.discard)
        return future


class Evaluations:
    """Evaluations under way.

    A task whose worker dies is tried once more when nothing else is under way, as memory may have
    been short. If that worker dies, too, an InputError names the task.
    """

    def __init__(self, evaluator: Evaluator) -> None:
        self._evaluator = evaluator
        self._waiting: deque[Task] = deque()
        self._running: dict[Future[Evaluation], Task] = {}
        self._died: deque[Task] = deque()
        """Tasks whose workers died; while there are any, no other task begins."""

    @property
    def busy(self) -> bool:
        """True if anything is under way or waits."""
        return any((self._waiting, self._running, self._died))

    def add(self, tasks: Iterable[Task]) -> None:
        """Adds tasks."""
        self._waiting.extend(tasks)

    def wait(self, timeout: float | None = None) -> list[tuple[Task, Evaluation]]:
        """Tasks that are done, as soon as there is one or time (s) is up."""
        if self._died and not self._running:
            return [self._try_alone(self._died.popleft())]
        while self._waiting and not self._died:
            task = self._waiting.popleft()
            self._running[self._evaluator.submit(task)] = task
        done, _ = futures.wait(self._running, timeout, return_when=futures.FIRST_COMPLETED)
        evaluated, failed = [], None
        for future in done:
            try:
                evaluated.append((self._running[future], _result(future)))
            except _WorkerDied:
                self._died.append(self._running[future])
            except Exception:
                failed = future
                continue
            del self._running[future]
        if failed is not None and not evaluated:
            _result(failed)  # raises, as soon as all that is done has been taken
        return evaluated

    def _try_alone(self, task: Task) -> tuple[Task, Evaluation]:
        try:
            return task, _result(self._evaluator.submit(task))
        except _WorkerDied as error:
            problem = (
                "its worker died, and once more when nothing else ran, as if memory is short; it "
                "is not recorded, and the run can be resumed"
            )
            raise InputError(task, "", problem) from error


class _WorkerDied(Exception):
    pass


def _result(future: Future[Evaluation]) -> Evaluation:
    """The result of a future, where all executors tell of deaths alike."""
    try:
        return future.result()
    except CancelledError as error:
        problem = "has dropped evaluations, as if its scheduler had ended; the run can be resumed"
        raise InputError("executor", "", problem) from error
    except Exception as error:
        dask = sys.modules.get("distributed")
        if isinstance(error, BrokenExecutor) or (dask and isinstance(error, dask.KilledWorker)):
            raise _WorkerDied from error
        raise


def evaluate_all(evaluator: Evaluator, tasks: Iterable[Task]) -> Iterator[tuple[Task, Evaluation]]:
    """Evaluates tasks and yields each with its evaluation as soon as it is ready."""
    evaluations = Evaluations(evaluator)
    evaluations.add(tasks)
    while evaluations.busy:
        yield from evaluations.wait()


_SOURCE = "worker processes"
_UNGUARDED = 'the program lacks `if __name__ == "__main__":` around what it does'


def check_guard() -> None:
    """Raises InputError in a worker that is importing the program and so runs it."""
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        raise InputError(_SOURCE, "", _UNGUARDED)


def _why_not_sent(evaluate: object) -> str:
    """Why worker processes cannot get a function; empty if they can."""
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
