"""kill -9 at random moments, and Ctrl-C: what is resumed ends as if nothing had happened."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from helpers.analytic import DrawnBowl, drawn_scenario, read_record, record_run

from tetra_drake.evolution.run_record import RunRecord

PROGRAM = Path(__file__).parents[1] / "helpers" / "killed_run.py"


def run_and_kill(directory, executor, *, after=None, sign=signal.SIGKILL, delay=0.006):
    """Starts the run, ends it `after` s; its exit status and its session's number."""
    # A session of its own: what the run leaves behind can be told from everything else.
    with subprocess.Popen(
        [sys.executable, PROGRAM, directory, executor, str(delay)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    ) as process:
        assert process.stdout.readline() == b"begun\n"
        if after is not None:
            time.sleep(after)
            os.killpg(process.pid, sign) if sign == signal.SIGINT else process.send_signal(sign)
        process.communicate(timeout=60)
    return process.returncode, process.pid


def wait_until_gone(session):
    """Waits for all processes of a session to end."""
    deadline = time.monotonic() + 10.0
    while time.monotonic() < deadline:
        try:
            os.killpg(session, 0)
        except ProcessLookupError:
            return
        time.sleep(0.05)
    raise AssertionError("processes are left over")


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory):
    directory = tmp_path_factory.mktemp("uninterrupted") / "whole"
    record_run(directory, drawn_scenario(iterations=150), seed=9, evaluate=DrawnBowl())
    return read_record(directory)


@pytest.mark.parametrize(
    ("executor", "kills", "longest"),
    [
        ("threads", 1, 0.6),
        pytest.param("threads", 20, 0.4, marks=pytest.mark.slow),
        pytest.param("processes", 5, 1.5, marks=pytest.mark.slow),
    ],
)
def test_a_killed_run_ends_alike_and_leaves_no_process(
    tmp_path, uninterrupted, executor, kills, longest
):
    generator = np.random.default_rng()
    hits = 0
    for _ in range(kills):
        after = generator.uniform(0.0, longest)
        status, session = run_and_kill(tmp_path / "run", executor, after=after, delay=0.04)
        hits += status == -signal.SIGKILL
        wait_until_gone(session)
    assert hits >= kills // 2
    # The rest in threads, which start faster; the record must not depend on it.
    assert run_and_kill(tmp_path / "run", "threads", delay=0.0)[0] == 0
    assert read_record(tmp_path / "run") == uninterrupted


def test_a_ctrl_c_ends_the_run_at_once_and_it_can_be_resumed(tmp_path, uninterrupted):
    interrupted = {"after": 0.8, "sign": signal.SIGINT, "delay": 0.04}
    status, session = run_and_kill(tmp_path / "run", "processes", **interrupted)
    assert status != 0
    wait_until_gone(session)
    assert run_and_kill(tmp_path / "run", "threads")[0] == 0
    assert read_record(tmp_path / "run") == uninterrupted


@pytest.mark.parametrize("engine", ["drake", pytest.param("compiled", marks=pytest.mark.slow)])
def test_sigterm_ends_the_command_as_ctrl_c_does(tmp_path, engine):
    program = PROGRAM.with_name("terminated_run.py")
    options = ["--engine", engine, "--workers", "2", "--out", tmp_path / "run"]
    with subprocess.Popen(
        [sys.executable, program, *options],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    ) as process:
        progress, deadline = tmp_path / "run/trial_00/in_progress.jsonl", time.monotonic() + 60.0
        while not progress.exists() and time.monotonic() < deadline:
            time.sleep(0.05)
        process.terminate()
        _, messages = process.communicate(timeout=60)
    wait_until_gone(process.pid)
    assert process.returncode == 130
    assert "--resume" in messages
    assert "leaked" not in messages and "Traceback" not in messages
    with RunRecord.resume(tmp_path / "run"):
        pass
