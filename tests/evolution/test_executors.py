"""Many evaluations at once: order, recycled workers, tasks that end their workers."""

import importlib
import os
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from helpers.analytic import Bowl, Deadly, is_deadly

from tetra_drake.evolution.executors import EvaluationImpossible, evaluate_all, process_executor
from tetra_drake.optimizers.base import Evaluation
from tetra_drake.robot.gait import ParameterSpace


@pytest.fixture
def vectors(scenario):
    generator, space = np.random.default_rng(5), ParameterSpace.of(scenario)
    return [space.random(generator) for _ in range(10)]


@pytest.mark.parametrize("executor", [process_executor, ThreadPoolExecutor])
def test_every_task_is_evaluated_once_also_when_workers_are_recycled(
    vectors, monkeypatch, executor
):
    monkeypatch.setattr("tetra_drake.evolution.executors.TASKS_PER_WORKER", 4)
    evaluations = dict(evaluate_all(Bowl(), vectors, workers=2, executor=executor))
    assert evaluations == {i: Bowl()(vector) for i, vector in enumerate(vectors)}
    assert list(evaluate_all(Bowl(), [], executor=executor)) == []


def test_only_what_ends_its_process_fails(vectors):
    evaluations = dict(evaluate_all(Deadly(), vectors, workers=2))
    assert sorted(evaluations) == list(range(10))
    died = [evaluations[i].failure == "its process died" for i in range(10)]
    assert died == [is_deadly(vector.tolist()) for vector in vectors]
    assert any(died)


def succeed_at_0(task):
    if task != 0:
        os._exit(3)
    return Evaluation(1.0)


@pytest.mark.slow
def test_deaths_count_once_anything_has_succeeded():
    evaluations = dict(evaluate_all(succeed_at_0, [1, 0, 2], workers=1))
    assert [evaluations[i].failure is None for i in range(3)] == [False, True, False]
    for tasks in ([1], [1, 2, 3]):
        with pytest.raises(EvaluationImpossible):
            list(evaluate_all(succeed_at_0, tasks, workers=2))


def test_a_function_that_workers_cannot_get_is_refused_with_the_cause(vectors, monkeypatch, capfd):
    with pytest.raises(EvaluationImpossible, match="lambda"):
        list(evaluate_all(lambda vector: Evaluation(1.0), vectors, workers=2))
    monkeypatch.delenv("TETRA_DRAKE_LOADED_IN", raising=False)
    evaluate = importlib.import_module("helpers.unloadable").evaluate
    with pytest.raises(EvaluationImpossible, match="do not start"):
        list(evaluate_all(evaluate, vectors, workers=1))
    assert "only one process can load this" in capfd.readouterr().err


PROGRAM = """
import numpy as np
from tetra_drake.evolution.executors import evaluate_all
from helpers.analytic import Bowl, small_scenario
def evaluate(vector):
    return Bowl()(vector)
"""
EVALUATE = "print(len(list(evaluate_all({}, [np.ones(26)], workers=1))))"
EVOLVE = "import tetra_drake\ntetra_drake.evolve(small_scenario(), 'run')"


@pytest.mark.parametrize(
    ("how", "call", "cause"),
    [
        ("stdin", EVALUATE.format("Bowl()"), "<stdin>"),
        ("file", EVALUATE.format("evaluate"), "__main__"),
        pytest.param("file", EVOLVE, "__main__", marks=pytest.mark.slow),
    ],
)
def test_programs_that_workers_cannot_import_are_told_at_once(how, call, cause, tmp_path):
    program = PROGRAM + call
    (tmp_path / "unguarded.py").write_text(program)
    ended = subprocess.run(
        [sys.executable, "-" if how == "stdin" else tmp_path / "unguarded.py"],
        input=program,
        text=True,
        capture_output=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        timeout=60,
        cwd=tmp_path,
    )
    # Read from standard input there is no file to import; in a file, a worker would start workers.
    assert "1\n" not in ended.stdout
    error = ended.stderr.splitlines()[-1]
    assert "EvaluationImpossible" in error
    assert cause in error


MPI = """
from mpi4py.futures import MPIPoolExecutor
from helpers.analytic import Chunked
if __name__ == "__main__":
    vectors = [np.full(26, 1.0 + i / 7) for i in range(9)]
    for _ in range(2):
        evaluations = evaluate_all(Chunked(Bowl()), vectors, workers=2, executor=MPIPoolExecutor)
        print([evaluation == Bowl()(vectors[i]) for i, evaluation in sorted(evaluations)])
"""


def test_mpi_is_an_executor(tmp_path):
    pytest.importorskip("mpi4py")
    if not (mpiexec := shutil.which("mpiexec")):
        pytest.skip("mpiexec is not installed")
    (tmp_path / "mpi.py").write_text(PROGRAM + MPI)
    as_root = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    program = [sys.executable, "-m", "mpi4py.futures", tmp_path / "mpi.py"]
    ended = subprocess.run(
        [mpiexec, "--oversubscribe", "-n", "3", *program],
        text=True,
        capture_output=True,
        env=os.environ | as_root | {"PYTHONPATH": os.pathsep.join(sys.path)},
        timeout=60,
    )
    assert ended.stdout.splitlines() == [str([True] * 9)] * 2, ended.stderr
