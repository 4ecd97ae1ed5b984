"""A Dask cluster of two processes: the records of local workers, whatever happens to its own."""

import importlib
import os
import signal
import socket
import time
from concurrent.futures import ThreadPoolExecutor
from importlib import metadata
from urllib.parse import urlsplit

import numpy as np
import pytest
from helpers.analytic import (
    Bowl,
    Chunked,
    Deadly,
    DrawnBowl,
    drawn_scenario,
    is_deadly,
    read_record,
    record_run,
)

from tetra_drake import cli
from tetra_drake.evolution.cluster import dask_cluster, local_cluster
from tetra_drake.evolution.executors import evaluate_all
from tetra_drake.robot.gait import ParameterSpace

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


@pytest.fixture
def vectors(scenario):
    generator, space = np.random.default_rng(2), ParameterSpace.of(scenario)
    return [space.random(generator) for _ in range(40)]


def test_only_what_ends_its_worker_fails_and_its_chunk_does_not(cluster, vectors, monkeypatch):
    monkeypatch.setattr(cluster.scheduler, "allowed_failures", 0)
    tasks = [vector for vector in vectors if not is_deadly(vector.tolist())][:14]
    tasks.insert(12, next(vector for vector in vectors if is_deadly(vector.tolist())))
    with dask_cluster(cluster) as executor:
        evaluations = dict(evaluate_all(Chunked(Deadly()), tasks, executor=executor))
    assert evaluations.pop(12).failure == "its process died"
    assert evaluations == {i: Bowl()(task) for i, task in enumerate(tasks) if i != 12}


def test_only_this_machine_can_reach_the_cluster(cluster):
    for address in (cluster.scheduler_address, cluster.dashboard_link):
        port = urlsplit(address).port
        socket.create_connection(("localhost", port)).close()
        with pytest.raises(OSError):  # as another of the machine's addresses
            socket.create_connection(("127.0.0.2", port), timeout=5.0)


class Killer:
    """Kills one of the cluster's workers, any, after every 30 evaluations of a run."""

    def __init__(self, cluster):
        self.cluster, self.generator, self.killed = cluster, np.random.default_rng(), 0

    def __call__(self, statuses):
        up = [nanny.pid for nanny in list(self.cluster.workers.values()) if nanny.pid]
        if up and sum(status.evaluations for status in statuses) >= 30 * (self.killed + 1):
            os.kill(self.generator.choice(up), signal.SIGKILL)
            self.killed += 1


def record_on(executor, directory, **options):
    """The record of two trials of 28 evaluations among draws, in chunks."""
    evaluate = Chunked(DrawnBowl(delay=0.05))
    scenario = drawn_scenario(iterations=8)
    record_run(directory, scenario, evaluate=evaluate, executor=executor, **options)
    return read_record(directory)


def test_killed_workers_leave_no_trace(cluster, tmp_path):
    killer = Killer(cluster)
    whole = record_on(ThreadPoolExecutor, tmp_path / "whole")
    with dask_cluster(cluster) as executor:
        assert record_on(executor, tmp_path / "disturbed", show=killer) == whole
    assert killer.killed >= 1


def test_an_interrupted_run_leaves_nothing_in_the_queue(cluster, vectors):
    with dask_cluster(cluster) as executor, pytest.raises(KeyboardInterrupt):
        for _ in evaluate_all(Bowl(delay=1.0), vectors[:8], executor=executor):
            assert cluster.scheduler.tasks
            raise KeyboardInterrupt
    deadline = time.monotonic() + 10.0
    while cluster.scheduler.tasks and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not cluster.scheduler.tasks


def test_workers_with_other_versions_are_refused(cluster, refused):
    with distributed.Client(cluster) as client:
        client.run(setattr, metadata, "version", str.upper)
        with refused("executor", "", "found 'TETRA_DRAKE'"), dask_cluster(cluster):
            pass
        client.run(importlib.reload, metadata)
    with dask_cluster(cluster) as executor:
        assert executor.workers == 2


def test_the_command_starts_a_cluster_or_says_what_it_cannot_use(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("tetra_drake.experiment.GaitEvaluation", lambda scenario, objective: Bowl())
    monkeypatch.setattr("tetra_drake.report.run_page.write_report", lambda directory: None)
    monkeypatch.setattr("tetra_drake.experiment.process_executor", ThreadPoolExecutor)
    monkeypatch.setattr("tetra_drake.experiment.prepare", lambda scenario, **_: None)
    command = ["evolve", "--scenario", "quick", "--evaluations", "16", "--workers", "1"]
    for name, executor in (("dask", ("--dask",)), ("local", ())):
        assert cli.main([*command, "--out", str(tmp_path / name), *executor]) == 0
    assert read_record(tmp_path / "dask") == read_record(tmp_path / "local")
    with dask.config.set({"distributed.comm.timeouts.connect": "0.2s"}):
        for wrong in ("slurm", "tcp://127.0.0.1:1", "gopher://here"):
            assert cli.main([*command, "--out", str(tmp_path / "no"), "--dask", wrong]) == 2
            assert "executor: " in capsys.readouterr().err
    assert not (tmp_path / "no").exists()
    assert dask.config.get("scheduler", None) is None, "others in this process are left alone"
