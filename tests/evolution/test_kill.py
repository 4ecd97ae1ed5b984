"""kill -9 at random moments, Ctrl-C, SIGTERM: what is resumed ends as if nothing had happened."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from helpers.analytic import DrawnBowl, drawn_scenario, read_record, record_run

from tetra_drake.evolution.manifest import MANIFEST

PROGRAM = Path(__file__).parents[1] / "helpers" / "killed_run.py"


def run_and_kill(directory, executor, *, after=None, sign=signal.SIGKILL, delay=0.0):
    """Starts the run, ends it `after` s; its exit status."""
    # A session of its own: what the run leaves behind can be told from everything else.
    command = [sys.executable, PROGRAM, directory, executor, str(delay)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    paths = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(command, start_new_session=True, env=paths, **pipes) as process:
        assert process.stdout.readline() == "begun\n"
        if after is not None:
            time.sleep(after)
            os.killpg(process.pid, sign) if sign == signal.SIGINT else process.send_signal(sign)
        _, messages = process.communicate(timeout=60)
    assert "leaked" not in messages or sign == signal.SIGKILL
    deadline = time.monotonic() + 10.0
    with contextlib.suppress(ProcessLookupError):
        while True:
            os.killpg(process.pid, 0)
            assert time.monotonic() < deadline, "processes are left over"
            time.sleep(0.05)
    return process.returncode


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory):
    directory = tmp_path_factory.mktemp("uninterrupted") / "whole"
    record_run(directory, drawn_scenario(iterations=100), seed=9, evaluate=DrawnBowl())
    return read_record(directory)


KILLS = [("threads", signal.SIGKILL, 20, 0.4), ("processes", signal.SIGKILL, 5, 1.5)]
KILLS += [("processes", sign, 1, 0.8) for sign in (signal.SIGINT, signal.SIGTERM)]
MANY = [pytest.param(*kills, marks=pytest.mark.slow) for kills in KILLS]


@pytest.mark.parametrize(
    ("executor", "sign", "kills", "longest"), [("threads", signal.SIGKILL, 1, 0.6), *MANY]
)
def test_killed_runs_resume_and_end_alike(tmp_path, uninterrupted, executor, sign, kills, longest):
    """And leave no process."""
    moments = np.random.default_rng().uniform(0.0, longest, kills)
    options = {"sign": sign, "delay": 0.04}
    hits = sum(run_and_kill(tmp_path, executor, after=after, **options) != 0 for after in moments)
    assert hits >= (kills + 1) // 2
    # The rest in threads of this process; the record must not depend on it.
    scenario = None if (tmp_path / MANIFEST).exists() else drawn_scenario(iterations=100)
    record_run(tmp_path, scenario, seed=9, evaluate=DrawnBowl())
    assert read_record(tmp_path) == uninterrupted
