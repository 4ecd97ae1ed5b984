"""Executors whose workers are those of a Dask cluster."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Iterator
from concurrent.futures import Executor
from importlib import metadata
from typing import TYPE_CHECKING, Any

from tetra_drake.errors import InputError
from tetra_drake.evolution.evaluators import check_guard, deaf_to_ctrl_c
from tetra_drake.machine import available_cores

if TYPE_CHECKING:
    from distributed import Client, LocalCluster


class DaskExecutors:
    """Makes executors of a Dask client; all have the workers of its cluster."""

    def __init__(self, client: Client) -> None:
        self._client = client

    def __call__(self, workers: int) -> Executor:
        # Not pure: a task that has killed its worker gets another chance under another key.
        return self._client.get_executor(pure=False)

    @property
    def workers(self) -> int:
        """The cluster's threads."""
        return sum(self._client.nthreads().values())


@contextlib.contextmanager
def dask_cluster(cluster: Any = None, *, workers: int | None = None) -> Iterator[DaskExecutors]:
    """Executors for evolve(), for as long as the block lasts, on a Dask cluster: an object, such as
    an SSHCluster, or its scheduler's address. By default one of its own on this machine, with as
    many worker processes (one per core by default).

    Raises InputError if Dask is missing, no scheduler answers, workers do not start, or have
    another version of this package or of Drake.
    """
    try:
        import distributed
    except ImportError as error:
        problem = "Dask is not installed: pip install 'tetra_drake[cluster]'"
        raise InputError("executor", "", problem) from error
    check_guard()
    with contextlib.ExitStack() as stack:
        try:
            if cluster is None:
                cluster = stack.enter_context(local_cluster(workers or available_cores()))
            # Not the default client: where none answers, Dask would still be the default scheduler.
            client = distributed.Client(cluster, set_as_default=False)
            stack.enter_context(client)
        except RuntimeError as error:
            raise InputError("executor", "", f"Dask's workers do not start: {error}") from error
        except (OSError, ValueError) as error:
            problem = f"no Dask scheduler answers at '{cluster}': {error}"
            raise InputError("executor", "", problem) from error
        for name in ("tetra_drake", "drake"):
            _check_version(client, name)
        yield DaskExecutors(client)


def _check_version(client: Client, name: str) -> None:
    """Raises InputError if a worker that is up has another version of a package, or none."""
    ours = metadata.version(name)
    for worker, theirs in client.run(metadata.version, name, on_error="return").items():
        if theirs != ours:
            problem = f"{name} on worker {worker}: found {theirs!r}, expected '{ours}' as here"
            raise InputError("executor", "", problem)


def local_cluster(workers: int) -> LocalCluster:
    """A Dask cluster of so many worker processes on this machine, which replaces those that die."""
    import dask
    from distributed import LocalCluster

    # Drake before 1.56 keeps memory: a worker that has too much is replaced, and never paused.
    memory = {f"distributed.worker.memory.{level}": False for level in ("target", "spill", "pause")}
    with dask.config.set(memory), deaf_to_ctrl_c():
        cluster = LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            dashboard_address="localhost:0",
            silence_logs=logging.CRITICAL,  # of workers that die: the pool copes
        )
    cluster.adapt(minimum=workers, maximum=workers)  # also replaces one that died as it started
    return cluster
