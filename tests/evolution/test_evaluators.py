"""Evaluators: order, recycled workers, tasks that end their workers, programs of all kinds."""

import importlib
import os
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import pytest
import yaml
from helpers import analytic

from tetra_drake.evolution.evaluators import WorkerProcesses, on_executor
from tetra_drake.evolution.run import load_run


@pytest.mark.parametrize(("make", "workers"), [(WorkerProcesses, 1), (ProcessPoolExecutor, 2)])
def test_a_run_whose_worker_dies_says_so_and_is_resumed(make, workers, tmp_path, refused):
    run, scenario = tmp_path / "run", analytic.small_scenario(trials=1)
    analytic.record_run(tmp_path / "whole", scenario)
    with refused("worker processes", "", "died"):
        evaluator = on_executor(analytic.Dying(17), make, workers)
        analytic.record_run(run, scenario, evaluator=evaluator)
    assert load_run(run).evaluations["failure"].isin([None, "fell off the table"]).all()
    analytic.record_run(run)
    assert analytic.read_record(run) == analytic.read_record(tmp_path / "whole")


def test_a_function_that_workers_cannot_load_is_told(tasks, monkeypatch, capfd, refused):
    monkeypatch.delenv("TETRA_DRAKE_LOADED_IN", raising=False)
    evaluate = importlib.import_module("helpers.unloadable").evaluate
    with (
        refused("worker processes", "", "do not start", "__main__"),
        on_executor(evaluate, WorkerProcesses, 1) as processes,
    ):
        analytic.evaluated(processes, tasks)
    assert "only one process can load this" in capfd.readouterr().err


PROGRAM = yaml.safe_load(Path(__file__).with_name("program.yaml").read_text("utf-8"))


def run_program(folder, call, *, how):
    """A program that is a file, read from standard input or given by -c, as it has ended."""
    program = PROGRAM["program"] + call
    (folder / "program.py").write_text(program)
    source = {"file": [folder / "program.py"], "stdin": ["-"], "argument": ["-c", program]}[how]
    options = {"input": program if how == "stdin" else None, "text": True, "cwd": folder}
    options["env"] = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    return subprocess.run([sys.executable, *source], capture_output=True, timeout=300, **options)


@pytest.mark.slow
def test_a_program_without_guard_is_told(tmp_path):
    ended = run_program(tmp_path, PROGRAM["evaluate"], how="file")
    assert ended.returncode == 1 and ended.stdout == ""
    error = ended.stderr.splitlines()[-1]
    assert "InputError" in error and "__main__" in error


OWN = "evolve(objective=objective)"
LOCAL = 'if __name__ == "__main__":\n    evolve(objective=lambda result: 1.0)'
SENT = [("stdin", "evolve()", True), ("file", LOCAL, True), ("argument", "evolve()", False)]
SLOW = [pytest.param(*each, marks=pytest.mark.slow) for each in SENT]


@pytest.mark.parametrize(("how", "call", "alone"), [("argument", OWN, True), *SLOW])
def test_evolution_works_where_processes_cannot_import_the_program(how, call, alone, tmp_path):
    ended = run_program(tmp_path, call, how=how)
    assert ended.stdout == "6 0\n", ended.stderr
    assert ended.stderr.count("in this process") == alone
