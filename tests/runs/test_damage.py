"""Trial and error after damage: its choices on a made-up map, its records, and its page."""

import damage
import numpy as np
import pytest

from tetra_drake.engines.simulate import simulate
from tetra_drake.evolution.run import load_run


def test_a_gait_for_each_motor_is_the_recorded_one():
    run = load_run(damage.WALKER)
    same = simulate(damage.scenario(), damage.steered(run.best_gait(), 0.0))
    recorded = simulate(run.scenario, run.best_gait()).metrics.steady_distance
    assert same.metrics.steady_distance == pytest.approx(recorded, abs=1e-4)


def test_trials_turn_to_the_side_of_the_map_that_still_walks_and_end():
    places = np.random.default_rng(0).random((200, 3))
    before = 0.7 + 0.3 * places[:, 0]
    after = before * (places[:, 2] > 0.5)  # what the damage leaves
    tried = [int(np.argmax(before * (places[:, 2] < 0.5)))]
    while (following := damage.next_trial(places, before, tried, after[tried])) is not None:
        tried.append(following)
    assert len(tried) < damage.SET["trials"] and after[tried].max() > 0.9 * after.max()
