"""kill -9 at random moments, Ctrl-C, SIGTERM: what is resumed ends as if nothing had happened."""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import yaml
from helpers.analytic import DrawnBowl, drawn_scenario, read_record, record_run

import tetra_drake as td
from tetra_drake.evolution.manifest import MANIFEST

PROGRAM = Path(__file__).parents[1] / "helpers" / "killed_run.py"


KILLS_OF_COMMANDS = int(os.environ.get("KILLS", "3"))
GIVEN = yaml.safe_load(Path(__file__).with_name("killed.yaml").read_text("utf-8"))
"""A scenario, and a program that evolves it."""


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


def records_of(folder):
    """Scenario, manifest and evaluations of a run, without wall times."""
    run = td.load_run(folder)
    table = run.evaluations.drop(columns=[c for c in run.evaluations if "wall" in c])
    return run.manifest.seed, table.to_csv()


def worker_of(process):
    """A process that a process of ours has started, or its own number while it has none."""
    for name in Path(f"/proc/{process.pid}/task").iterdir():
        for child in map(int, (name / "children").read_text().split()):
            if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes():
                return child
    return process.pid


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["overwrite", "worker", "video"])
def test_a_killed_command_can_be_given_again(kind, tmp_path):
    engine = "!Drake {accuracy: 1e-2}" if kind == "worker" else "!Compiled"
    (tmp_path / "a.yaml").write_text(GIVEN["scenario"].replace("ENGINE", engine))
    (tmp_path / "evolve.py").write_text(GIVEN["program"])
    paths = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    given = {"cwd": tmp_path, "env": paths, "start_new_session": True, "stderr": subprocess.PIPE}
    again = [sys.executable, "evolve.py", "2", "run"]
    if kind == "video":
        again = [sys.executable, "-m", "tetra_drake", "video", "old", "--out", "walk.gif"]
        again += ["--size", "160x120"]
    subprocess.run([sys.executable, "evolve.py", "1", "old"], **given, check=True)
    shutil.copytree(tmp_path / "old", tmp_path / "run")
    began = time.monotonic()
    subprocess.run(again, **given, check=True)
    longest, rng = time.monotonic() - began, np.random.default_rng()
    whole = records_of(tmp_path / "run")
    old = records_of(tmp_path / "old")
    assert kind == "video" or old[0] != whole[0]
    film = tmp_path / "walk.gif"
    size = film.stat().st_size if kind == "video" else 0
    for number in range(KILLS_OF_COMMANDS):
        film.unlink(missing_ok=True)
        if kind != "video":
            shutil.rmtree(tmp_path / "run")
            shutil.copytree(tmp_path / "old", tmp_path / "run")
        with subprocess.Popen(again, **given) as process:
            time.sleep(rng.uniform(0.2, 1.0) * longest)
            if kind == "worker":
                with contextlib.suppress(OSError):
                    os.kill(worker_of(process), signal.SIGKILL)
            else:
                sign = [signal.SIGKILL, signal.SIGTERM][number % 2]
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(process.pid, sign)
            _, messages = process.communicate(timeout=60)
        assert process.returncode != 1 or b"InputError: worker" in messages
        assert not film.exists() or film.stat().st_size == size
        subprocess.run(again, **given, check=True)
        assert records_of(tmp_path / "run") == whole
        left = {path.name for path in tmp_path.iterdir()} - {"a.yaml", "evolve.py", "old", "run"}
        assert left <= {"walk.gif"}
        assert [path.name for path in (tmp_path / "run").glob(".*")] == [".lock"]
