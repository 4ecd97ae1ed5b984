"""Evaluating vectors by simulation: objectives, failures, and the same numbers in any process."""

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from helpers.analytic import evaluated, small_scenario, tasks_of
from helpers.converged import shortly

from tetra_drake.engines.simulate import simulate
from tetra_drake.engines.time_limit import check_time
from tetra_drake.evolution.evaluation import GaitEvaluation
from tetra_drake.evolution.evaluators import in_lanes, on_executor
from tetra_drake.optimizers.base import Task
from tetra_drake.robot.parameter_space import ParameterSpace


@pytest.fixture
def tiny():
    """0.1 s from a standing start, actuated at once so that gaits differ."""
    return shortly(small_scenario(), 0.1)


@pytest.fixture
def vectors(tiny):
    generator = np.random.default_rng(1)
    return [ParameterSpace.of(tiny).random(generator) for _ in range(2)]


def test_an_evaluation_is_that_of_its_gait_bit_for_bit_in_any_process(tiny, vectors, one_process):
    tasks = tasks_of(vectors)
    here = [GaitEvaluation(tiny)(task) for task in tasks]
    with on_executor(GaitEvaluation(tiny), one_process, 1) as process:
        there = evaluated(process, tasks)
    for index, vector in enumerate(vectors):
        result = simulate(tiny, ParameterSpace.of(tiny).gait(vector, name="any"), record=True)
        for found in (here[index], there[index]):
            assert (found.fitness, found.metrics) == (result.fitness, result.metrics.to_json())
            assert found.engine == "drake" and found.wall_time > 0.0
    assert here[0].fitness != here[1].fitness
    twisting = GaitEvaluation(tiny, lambda result: -result.metrics.twist - 1.0)(tasks[0])
    assert twisting.fitness == -here[0].metrics["twist"] - 1.0
    assert twisting.metrics == here[0].metrics


def highest(result):
    """Greatest height of a node."""
    return result.trajectory["p_WN"].sel(axis="z").max()


def test_objectives_that_read_the_trajectory_say_so(tiny, vectors, refused, monkeypatch):
    scenario = tiny.with_changes({"engine": "!Compiled"})
    with refused("objective", "", "needs_trajectory"):
        GaitEvaluation(scenario, highest)(Task(vectors[0]))
    monkeypatch.setattr(highest, "needs_trajectory", True, raising=False)
    evaluation = GaitEvaluation(scenario, highest)(Task(vectors[0]))
    gait = ParameterSpace.of(scenario).gait(vectors[0], name="any")
    result = simulate(scenario, gait, record=True)
    assert evaluation.fitness == highest(result) > 0.05
    assert evaluation.metrics == result.metrics.to_json()


FAILING = [
    ({"simulation.max_evaluations": 50}, None, "step budget: "),
    ({"cpg.gain": "4e9 N", "cpg.start_up": 0.0}, None, "diverged: "),
    ({}, lambda result: math.nan, "diverged: "),
]


@pytest.mark.parametrize(("changes", "objective", "kind"), FAILING)
def test_failures_say_why_and_are_the_worst(tiny, vectors, changes, objective, kind):
    failed = GaitEvaluation(tiny.with_changes(changes), objective)(Task(vectors[0]))
    assert failed.failure.startswith(kind)
    assert (failed.fitness, failed.metrics) == (-math.inf, {})
    assert failed.wall_time > 0.0


def test_time_budgets_hold_in_any_thread_and_end_with_their_evaluation(tiny, vectors, engine):
    changes = {"engine": engine, "simulation.duration": "60.0 s"}
    late = GaitEvaluation(tiny.with_changes(changes | {"evolution.time_budget": "0.01 s"}))
    with ThreadPoolExecutor(1) as thread:
        failed = thread.submit(late, Task(vectors[0])).result()
        assert failed.failure == "time budget: not done after 0.01 s"
        assert thread.submit(check_time).exception() is None


def test_an_error_of_an_objective_in_lanes_ends_the_run(tiny, vectors):
    def objective(result):
        raise ZeroDivisionError("mine")

    evaluate = GaitEvaluation(tiny.with_changes({"engine": "!Compiled"}), objective)
    with in_lanes(evaluate, 1) as lanes, pytest.raises(ZeroDivisionError, match="mine"):
        evaluated(lanes, tasks_of(vectors))


@pytest.mark.parametrize("returned", ["3.2", None, np.zeros(2)])
def test_an_objective_that_returns_no_number_is_named(tiny, vectors, refused, returned):
    def judge(result):
        return returned

    evaluate = GaitEvaluation(tiny.with_changes({"engine": "!Compiled"}), judge)
    with refused("objective", f"{__name__}.{judge.__qualname__}", f"returned {returned!r}"):
        evaluate(Task(vectors[0]))
