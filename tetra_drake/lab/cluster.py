"""Executors for evolve() on the workers of a Dask cluster."""

from __future__ import annotations

import contextlib
import importlib.util
import logging
from collections.abc import Iterator
from importlib import metadata
from typing import TYPE_CHECKING, Any

from tetra_drake.errors import InputError
from tetra_drake.evolution.evaluators import LentExecutor, check_guard, deaf_to_ctrl_c
from tetra_drake.machine import available_cores, check_package

if TYPE_CHECKING:
    from distributed import Client, LocalCluster

_LOG = logging.getLogger("tetra_drake")


@contextlib.contextmanager
def dask_cluster(cluster: Any = None, *, workers: int | None = None) -> Iterator[LentExecutor]:
    """Context manager: executor on all workers of a Dask cluster, for evolve().

    Args:
        cluster: a cluster object, such as an SSHCluster, or the address of a scheduler. By default
            a new cluster on this machine, which ends with the block.
        workers: number of worker processes of a new cluster; one per core by default.

    Raises:
        InputError: if Dask is missing, no scheduler answers, workers do not start, or a worker has
            another version of this package or of Drake.
    """
    check_package("distributed", extra="cluster", source="executor")
    import distributed

    check_guard()
    with contextlib.ExitStack() as stack:
        try:
            if cluster is None:
                cluster = stack.enter_context(local_cluster(workers or available_cores()))
            # A default client would stay Dask's default even if its scheduler does not answer.
            client = stack.enter_context(distributed.Client(cluster, set_as_default=False))
        except RuntimeError as error:
            raise InputError("executor", "", f"Dask's workers do not start: {error}") from error
        except (OSError, ValueError) as error:
            problem = f"no Dask scheduler answers at '{cluster}': {error}"
            raise InputError("executor", "", problem) from error
        yield executor_of(client)


def executor_of(client: Client) -> LentExecutor:
    """Executor on the workers of a Dask client. Raises InputError if the client is closed or
    asynchronous, or a worker has another version of this package or of Drake."""
    if client.asynchronous or client.status != "running":
        found = "asynchronous" if client.asynchronous else client.status
        raise InputError("executor", "", f"found a Dask client that is {found}, expected running")
    for name in ("tetra_drake", "drake"):
        ours = metadata.version(name)
        for worker, theirs in client.run(metadata.version, name, on_error="return").items():
            if theirs != ours:
                problem = f"{name} on worker {worker}: found {theirs!r}, expected '{ours}' as here"
                raise InputError("executor", "", problem)
    # Dask refuses a key that has killed its worker. Without `pure`, a resumed run has new keys.
    return LentExecutor(client.get_executor(pure=False), sum(client.nthreads().values()))


def local_cluster(workers: int) -> LocalCluster:
    """A Dask cluster of worker processes on this machine. A worker that dies is replaced."""
    import dask
    from distributed import LocalCluster

    has_tls = importlib.util.find_spec("cryptography") is not None
    if not has_tls:
        _LOG.warning(
            "other users of this machine can run code on Dask's ports on 127.0.0.1; "
            "pip install cryptography closes them"
        )
    # Drake before 1.56 leaks memory. Dask's nanny replaces a worker at its limit; a worker that
    # only pauses or spills would not get its memory back.
    memory = {f"distributed.worker.memory.{level}": False for level in ("target", "spill", "pause")}
    with dask.config.set(memory), deaf_to_ctrl_c():
        cluster = LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            dashboard_address="localhost:0",
            silence_logs=logging.CRITICAL,  # dead workers are replaced; no need to log them
            security=has_tls or None,
        )
    cluster.adapt(minimum=workers, maximum=workers)  # even if they die at their start
    return cluster
