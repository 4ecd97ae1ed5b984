"""A Dask cluster of two processes: the records of local workers, whatever happens to its own."""

import importlib
import os
import signal
import socket
import time
from concurrent.futures import ThreadPoolExecutor
from importlib import metadata
from unittest.mock import Mock
from urllib.parse import urlsplit

import numpy as np
import pytest
from helpers import analytic

from tetra_drake import cli
from tetra_drake.evolution.evaluators import evaluate_all, on_executor
from tetra_drake.lab.cluster import dask_cluster, local_cluster

dask, distributed = pytest.importorskip("dask"), pytest.importorskip("distributed")


@pytest.fixture(scope="module")
def one_cluster():
    with local_cluster(2) as cluster:
        yield cluster


@pytest.fixture
def cluster(one_cluster):
    """The cluster with both workers: what a test has killed comes back."""
    with distributed.Client(one_cluster) as client:
        client.wait_for_workers(2)
    return one_cluster


@pytest.mark.slow
def test_a_gait_that_ends_its_worker_ends_the_run(cluster, tasks, monkeypatch, refused):
    monkeypatch.setattr(cluster.scheduler, "allowed_failures", 1)
    with (
        refused("worker processes", "", "died"),
        dask_cluster(cluster) as make,
        on_executor(analytic.Dying(12), make, 2) as evaluator,
    ):
        for task, evaluation in evaluate_all(evaluator, tasks):
            assert evaluation == analytic.Bowl()(task)


@pytest.mark.slow
def test_only_this_machine_can_reach_the_cluster(cluster):
    for address in (cluster.scheduler_address, cluster.dashboard_link):
        port = urlsplit(address).port
        socket.create_connection(("localhost", port)).close()
        with pytest.raises(OSError):  # as another of the machine's addresses
            socket.create_connection(("127.0.0.2", port), timeout=5.0)


@pytest.mark.slow
def test_killed_workers_leave_no_trace(cluster, tmp_path):
    """Of two trials of 28 evaluations among draws, a worker is killed after every 20."""
    scenario, bowl = analytic.drawn_scenario(iterations=8), analytic.DrawnBowl(delay=0.05)
    analytic.record_run(tmp_path / "whole", scenario, evaluate=bowl)
    killed = []

    def kill(statuses):
        up = [nanny.pid for nanny in list(cluster.workers.values()) if nanny.pid]
        if up and sum(status.evaluations for status in statuses) >= 20 * (len(killed) + 1):
            killed.append(np.random.default_rng().choice(up))
            os.kill(killed[-1], signal.SIGKILL)

    with dask_cluster(cluster) as make:
        evaluator = on_executor(bowl, make, 2)
        analytic.record_run(tmp_path / "run", scenario, evaluator=evaluator, show=kill)
    assert killed
    assert analytic.read_record(tmp_path / "run") == analytic.read_record(tmp_path / "whole")


@pytest.mark.slow
def test_an_interrupted_run_leaves_nothing_in_the_queue(cluster, tasks):
    with (
        pytest.raises(KeyboardInterrupt),
        dask_cluster(cluster) as make,
        on_executor(analytic.Bowl(delay=1.0), make, 2) as evaluator,
    ):
        for _ in evaluate_all(evaluator, tasks[:8]):
            assert cluster.scheduler.tasks
            raise KeyboardInterrupt
    deadline = time.monotonic() + 10.0
    while cluster.scheduler.tasks:
        assert time.monotonic() < deadline
        time.sleep(0.05)


@pytest.mark.slow
def test_workers_with_other_versions_are_refused(cluster, refused):
    with distributed.Client(cluster) as client:
        client.run(setattr, metadata, "version", str.upper)
        with refused("executor", "", "found 'TETRA_DRAKE'"), dask_cluster(cluster):
            pass
        client.run(importlib.reload, metadata)
    with dask_cluster(cluster) as executor:
        assert executor.workers == 2


def cluster_of_a_thread(workers):
    """In place of local_cluster(): its worker is a thread of this process."""
    options = {"threads_per_worker": 1, "dashboard_address": None, "processes": False}
    return distributed.LocalCluster(n_workers=workers, **options)


@pytest.mark.parametrize(
    "make", [cluster_of_a_thread, pytest.param(local_cluster, marks=pytest.mark.slow)]
)
def test_the_command_starts_a_cluster_or_says_why_not(make, tmp_path, monkeypatch, capsys):
    made = Mock(wraps=make)
    monkeypatch.setattr("tetra_drake.lab.cluster.local_cluster", made)

    def evaluator_of(evaluate, *, executor, **_):
        return on_executor(analytic.Bowl(), executor or ThreadPoolExecutor, 1)

    for module in ("experiment", "evolution.reevaluation"):
        monkeypatch.setattr(f"tetra_drake.{module}.evaluator_of", evaluator_of)
    monkeypatch.setattr("tetra_drake.report.run_page.write_report", lambda directory: None)
    monkeypatch.setattr("tetra_drake.lab.spread.record_spread", lambda *_, **__: None)
    command = ["evolve", "--scenario", "quick", "--evaluations", "16", "--workers", "1"]
    for name, executor in (("dask", ("--dask",)), ("local", ())):
        assert cli.main([*command, "--out", str(tmp_path / name), *executor]) == 0
    made.assert_called_once_with(1)
    assert analytic.read_record(tmp_path / "dask") == analytic.read_record(tmp_path / "local")
    with dask.config.set({"distributed.comm.timeouts.connect": "0.2s"}):
        for wrong in ("slurm", "tcp://127.0.0.1:1", "gopher://here"):
            assert cli.main([*command, "--out", str(tmp_path / "no"), "--dask", wrong]) == 2
            assert "executor: " in capsys.readouterr().err
    assert not (tmp_path / "no").exists()
    assert dask.config.get("scheduler", None) is None, "others in this process are left alone"
