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

PROGRAMS = Path(__file__).parents[1] / "helpers"


def start(program, *arguments):
    """The program in a session of its own: what it leaves behind can be told from all else."""
    return subprocess.Popen(
        [sys.executable, PROGRAMS / program, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    )


def run_and_kill(directory, executor, *, after=None, sign=signal.SIGKILL, delay=0.0):
    """Starts the run, ends it `after` s; its exit status."""
    with start("killed_run.py", directory, executor, str(delay)) as process:
        assert process.stdout.readline() == "begun\n"
        if after is not None:
            time.sleep(after)
            os.killpg(process.pid, sign) if sign == signal.SIGINT else process.send_signal(sign)
        process.communicate(timeout=60)
    wait_until_gone(process.pid)
    return process.returncode


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
    ("executor", "sign", "kills", "longest"),
    [
        ("threads", signal.SIGKILL, 1, 0.6),
        pytest.param("threads", signal.SIGKILL, 20, 0.4, marks=pytest.mark.slow),
        pytest.param("processes", signal.SIGKILL, 5, 1.5, marks=pytest.mark.slow),
        pytest.param("processes", signal.SIGINT, 1, 0.8, marks=pytest.mark.slow),
    ],
)
def test_a_killed_run_ends_alike_and_leaves_no_process(
    tmp_path, uninterrupted, executor, sign, kills, longest
):
    moments = np.random.default_rng().uniform(0.0, longest, kills)
    options = {"sign": sign, "delay": 0.04}
    hits = sum(run_and_kill(tmp_path, executor, after=after, **options) != 0 for after in moments)
    assert hits >= (kills + 1) // 2
    # The rest in threads, which start faster; the record must not depend on it.
    assert run_and_kill(tmp_path, "threads") == 0
    assert read_record(tmp_path) == uninterrupted


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["drake", "compiled"])
def test_sigterm_ends_the_command_as_ctrl_c_does(tmp_path, engine):
    options = ["--engine", engine, "--workers", "2", "--out", tmp_path / "run"]
    with start("terminated_run.py", *options) as process:
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
