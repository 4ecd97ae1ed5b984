"""Evaluators: order, recycled workers, tasks that end their workers, programs of all kinds."""

import importlib
import os
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from types import ModuleType

import pytest
import yaml
from helpers import analytic
from helpers.converged import shortly

import tetra_drake
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
PROGRAM_FROM_STDIN = ModuleType("__main__")
PROGRAM_FROM_STDIN.__file__ = "<stdin>"


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


PROGRAMS = [
    (ModuleType("__main__"), "what is defined interactively"),
    (PROGRAM_FROM_STDIN, "'<stdin>' is no file"),
    (None, "define it in a module"),
]


@pytest.mark.parametrize(("program", "problem"), PROGRAMS)
def test_gaits_are_evaluated_here_if_others_cannot_import_it(
    program, problem, tmp_path, monkeypatch
):
    def objective(result):
        return result.metrics.twist

    if program:
        monkeypatch.setitem(sys.modules, "__main__", program)
        monkeypatch.setattr(program, "objective", objective, raising=False)
        objective.__module__, objective.__qualname__ = "__main__", "objective"
    scenario = shortly(analytic.small_scenario(population=4, iterations=1, trials=1), 0.02)
    quick = {"reevaluate": False, "report": False}
    with pytest.warns(RuntimeWarning, match=f"one by one in this process.* {problem}"):
        run = tetra_drake.evolve(scenario, tmp_path / "run", objective=objective, **quick)
    assert len(run.evaluations) == 6 and run.evaluations["fitness"].notna().all()


OF_NO_FILE = [("argument", "evolve(objective=objective)", True), ("stdin", "evolve()", True)]


@pytest.mark.slow
@pytest.mark.parametrize(("how", "call", "alone"), [*OF_NO_FILE, ("argument", "evolve()", False)])
def test_evolution_works_where_processes_cannot_import_the_program(how, call, alone, tmp_path):
    ended = run_program(tmp_path, call, how=how)
    assert ended.stdout == "6 0\n", ended.stderr
    assert ended.stderr.count("in this process") == alone
