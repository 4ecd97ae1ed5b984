"""Gaits evaluated among draws of disturbances, and requirements."""

import dataclasses
import math
import re
from unittest.mock import Mock

import numpy as np
import pytest
from helpers import analytic
from helpers.converged import shortly
from helpers.quantities import with_unit
from pytest import approx

from tetra_drake.engines.simulate import simulate
from tetra_drake.evolution.evaluation import GaitEvaluation, combine_metrics, worst_mean
from tetra_drake.evolution.evaluators import in_lanes
from tetra_drake.evolution.reevaluation import reevaluate
from tetra_drake.evolution.run import load_run
from tetra_drake.optimizers.base import Task
from tetra_drake.robot.parameter_space import ParameterSpace
from tetra_drake.scenario.disturbances import disturbed, draw_disturbances
from tetra_drake.scenario.experiment_sections import Disturbances

STIFFNESS = {"robot.cables.outer_stiffness": 0.05}
SEED = (5, 0, 3)


@pytest.fixture(scope="module")
def tiny():
    """0.3 s of three tetrahedra, actuated at once, on the compiled engine, among three draws."""
    settings = Disturbances(draws=3, spreads=STIFFNESS, start=0.02)
    small = analytic.small_scenario(oscillators=2, population=4, iterations=2, trials=2)
    return shortly(small, 0.3, engine="!Compiled", disturbances=settings)


@pytest.fixture(scope="module")
def vector(tiny):
    return ParameterSpace.of(tiny).random(np.random.default_rng(1))


def by_hand(scenario, vector):
    """The results of the draws of SEED, as simulate() gives them."""
    gait = ParameterSpace.of(scenario).gait(vector, name="any")
    draws = [draw_disturbances(scenario, (*SEED, k)) for k in range(3)]
    return [simulate(scenario=disturbed(scenario, draw), gait=gait) for draw in draws]


def test_a_gait_is_simulated_in_each_of_its_draws(tiny, vector):
    results = by_hand(tiny, vector)
    fitnesses = [result.fitness for result in results]
    twists = [result.metrics.twist for result in results]
    combined = GaitEvaluation(tiny)(Task(vector, seed=SEED))
    assert len(set(fitnesses)) == 3
    assert combined.draws["fitness"] == fitnesses
    assert combined.draws["distance"] == [result.metrics.distance for result in results]
    assert combined.fitness == approx(np.mean(fitnesses), rel=1e-14)
    assert combined.metrics["twist"] == approx(np.mean(twists), rel=1e-14)
    other = GaitEvaluation(tiny)(Task(vector, seed=(5, 0, 4)))
    assert other.draws["fitness"] != fitnesses
    # Another objective, and the worst half of the draws.
    half = tiny.with_changes({"disturbances.tail": 0.5})
    far = GaitEvaluation(half, lambda result: -abs(result.metrics.distance))
    combined = far(Task(vector, seed=SEED))
    assert combined.draws["fitness"] == [-abs(distance) for distance in combined.draws["distance"]]
    least, second, _ = sorted(combined.draws["fitness"])
    assert combined.fitness == approx((least + second / 2) / 1.5, rel=1e-14)


def test_the_mean_over_the_worst_share_is_continuous_from_the_mean_to_the_least():
    fitnesses = [3.0, -1.0, 2.0, 8.0]
    found = [worst_mean(fitnesses, share) for share in (1.0, 0.5, 0.25, 0.1)]
    assert found == [3.0, 0.5, -1.0, -1.0]
    shares = np.linspace(0.01, 1.0, 1000)
    means = np.array([worst_mean(fitnesses, share) for share in shares])
    # Beyond the least, share s counts 4 s draws: dm/ds = (worst of the rest - m) / s < 9 / 0.25.
    assert (np.diff(means) >= 0.0).all() and np.diff(means).max() < 36.0 * (shares[1] - shares[0])


def test_metrics_are_means_but_for_the_least_clearance_and_tension():
    names = ("speed", "clearance", "tension", "lifted_shares", "cost_of_transport")
    draws = [[1.0, 2.0, 3.0, [0.5, 0.0], 1.0], [3.0, 1.0, 4.0, [0.0, 1.0], None]]
    combined = combine_metrics([dict(zip(names, values, strict=True)) for values in draws])
    assert list(combined.values()) == [2.0, 1.0, 3.0, [0.25, 0.5], None]


def test_a_requirement_missed_in_one_draw_is_missed(tiny, vector):
    distances = [result.metrics.distance for result in by_hand(tiny, vector)]
    least = sorted(distances)[1]
    missed = distances.index(min(distances))
    strict = tiny.with_changes({"require": {"distance": with_unit(least, "m")}})
    failed = GaitEvaluation(strict)(Task(vector, seed=SEED))
    assert failed.failure.startswith(f"draw {missed}: requirement: distance is ")
    assert (failed.fitness, failed.draws) == (-math.inf, None)
    assert failed.metrics["distance"] == approx(np.mean(distances), rel=1e-14)


# A step 10 mm ahead of the lead's feet, which draws move by up to 22 mm.
STEP = f"!Steps {{height: 2 cm, depth: 2 cm, count: 1, start: {2 * 2.94 * 2.54 + 1} cm}}"
FAILING = [({"terrain": STEP, "disturbances.start": 0.3}, "no start")]
FAILING += [({"simulation.max_evaluations": 50}, "step budget")]


@pytest.mark.parametrize(("changes", "kind"), FAILING)
def test_a_draw_that_fails_or_cannot_start_fails_its_gait(tiny, vector, changes, kind):
    scenario = tiny.with_changes(changes)
    tasks = [Task(vector, index=i, seed=(1, 0, i)) for i in range(4)]
    evaluate = GaitEvaluation(scenario)
    alone = [dataclasses.replace(evaluate(task), wall_time=0.0) for task in tasks]
    with in_lanes(evaluate, 1) as lanes:
        beside = analytic.evaluated(lanes, tasks)
    for i, evaluation in enumerate(alone):
        assert dataclasses.replace(beside[i], wall_time=0.0) == evaluation
    failed = [gait for gait in alone if gait.failure]
    assert failed
    for gait in failed:
        assert re.match(rf"draw [012]: {kind}: ", gait.failure)
        assert (gait.fitness, gait.metrics, gait.draws) == (-math.inf, {}, None)


def test_all_gaits_of_an_iteration_share_its_draws_which_are_recorded(tmp_path, monkeypatch):
    evaluate = Mock(wraps=analytic.DrawnBowl())
    analytic.record_run(tmp_path, analytic.drawn_scenario(), evaluate=evaluate)
    seeds = [call.args[0].seed for call in evaluate.call_args_list]
    iterations = [0] * 12 + [i for i in range(1, 16) for _ in range(2)]
    assert sorted(seeds) == [(5, trial, i) for trial in (0, 1) for i in iterations]

    table = load_run(tmp_path).evaluations
    walked = table.dropna(subset="fitness")
    assert table["draws_fitness"].notna().sum() == len(walked) < len(table)
    for _, gait in walked.iterrows():
        assert gait["fitness"] == worst_mean(gait["draws_fitness"], analytic.TAIL)
        assert gait["distance"] == approx(np.mean(gait["draws_distance"]))
        assert gait["worst_distance"] == min(gait["draws_distance"])

    # A gait is evaluated once more among the draws that it had.
    name = "tetra_drake.evolution.reevaluation.evaluator_of"
    monkeypatch.setattr(name, lambda *_, **__: analytic.in_threads(evaluate))
    again = reevaluate(tmp_path).reevaluations.set_index(["trial", "index"])
    first = table.set_index(["trial", "index"]).loc[again.index]
    assert len(again) == 2, "the best of each trial: 5 gaits would be 15 simulations"
    assert first["iteration"].max() > 0
    assert again["draws_fitness"].equals(first["draws_fitness"])
