"""Fronts of what distance is traded against, and their champions."""

import dataclasses
import math

import numpy as np
import pytest
from helpers.synthetic_run import PER_DISTANCE, write_run

from tetra_drake.evolution.pareto import (
    STEADINESS,
    champions,
    distinct_gaits,
    forward_gaits,
    pareto_front,
    trades,
)
from tetra_drake.evolution.tables import load_run

NAN = math.nan


@pytest.mark.parametrize(
    ("points", "front"),
    [
        ([], []),
        ([(1, 1)], [True]),
        ([(1, 3), (2, 2), (3, 1), (2, 1), (1, 1)], [True, True, True, False, False]),
        ([(2, 1), (2, 3), (2, 2)], [False, True, False]),
        ([(1, 2), (3, 2), (2, 2)], [False, True, False]),
        ([(1, 2), (2, 1), (1, 2), (0, 2)], [True, True, True, False]),
        ([(5, NAN), (NAN, 5), (1, 1), (NAN, NAN)], [False, False, True, False]),
        ([(-1, -4), (-2, -3)], [True, True]),
    ],
    ids=["none", "one", "inside", "ties", "ties of the other", "equal", "NaN", "negative"],
)
def test_the_front_is_what_no_other_point_dominates(points, front):
    assert pareto_front(np.array(points, dtype=float).reshape(-1, 2)).tolist() == front


def test_the_front_is_that_of_comparing_all_pairs():
    points = np.random.default_rng(3).integers(0, 12, (200, 2)).astype(float)
    greater = (points[:, None] >= points).all(axis=2) & (points[:, None] > points).any(axis=2)
    assert pareto_front(points).tolist() == (~greater.any(axis=0)).tolist()


def test_champions_walk_forward_and_at_least_half_as_far_as_the_farthest(tmp_path):
    costs = {20.0: 5.0, 10.0: 2.0, 9.0: 1.0, 12.0: None, -30.0: 0.5, 16.0: 3.0}
    metrics = {fitness: {"cost_of_transport": cost} for fitness, cost in costs.items()}
    trials = [[[(9.0, 0), (-30.0, 1), (None, 2)], [(20.0, 0)]], [[(10.0, 0), (12.0, 1), (16.0, 2)]]]
    run = load_run(write_run(tmp_path / "run", trials, metrics=metrics))
    best = champions(run)
    found = {name: (gait["trial"], gait["index"]) for name, gait in best.items()}
    assert found == {"farthest": (0, 3), "cheapest": (1, 0)}
    assert best["cheapest"]["distance_in"] == pytest.approx(10.0 / PER_DISTANCE)
    again = {"fittest": best["farthest"]} | best
    assert [names for names, _ in distinct_gaits(again)] == [["fittest", "farthest"], ["cheapest"]]


def test_steadiness_is_the_worst_draws_share_of_the_mean_distance(tmp_path):
    trial = [[(20.0, 0), (16.0, 1), (12.0, 2), (8.0, 3), (-4.0, 4)]]
    run = load_run(write_run(tmp_path / "run", [trial]))
    worst = [2.0, 6.0, 4.8, 3.9, -2.0]  # of means 10, 8, 6, 4 and -2 in
    run = dataclasses.replace(run, evaluations=run.evaluations.assign(worst_distance_in=worst))
    gaits = forward_gaits(run.evaluations)
    assert trades(gaits) == [STEADINESS]
    np.testing.assert_allclose(STEADINESS.of(gaits), [0.2, 0.75, 0.8, 0.975], rtol=1e-12)
    # The last one walks less than half as far as the farthest.
    found = {name: gait["index"] for name, gait in champions(run).items()}
    assert found == {"farthest": 0, "steadiest": 2}


@pytest.mark.parametrize("metrics", [{}, {-1.0: {"cost_of_transport": 1.0}}])
def test_without_a_number_to_trade_there_are_no_champions(tmp_path, metrics):
    run = load_run(write_run(tmp_path / "run", [[[(3.0, 0), (-1.0, 1)]]], metrics=metrics))
    assert trades(forward_gaits(run.evaluations)) == []
    assert champions(run) == {}
