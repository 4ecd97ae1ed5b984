"""The optimiser as a whole, told the fitness of a cheap function."""

import numpy as np
import pytest
from helpers.analytic import small_scenario

from tetra_drake.evolution.optimizers.base import Evaluation
from tetra_drake.evolution.optimizers.steady_state import SteadyState
from tetra_drake.robot.gait import TAU_A, TAU_B, ParameterSpace


def evaluate(vector):
    return Evaluation(-float(((vector[:-2] - 2.0) ** 2).sum() + abs(vector[TAU_A] - 0.25)))


def run(optimizer):
    """All vectors asked for, batch by batch, and the iterations."""
    batches, iterations = [], []
    while not iterations or iterations[-1].stop is None:
        batches.append(optimizer.ask())
        iterations.append(optimizer.tell([evaluate(vector) for vector in batches[-1]]))
    return batches, iterations


def make(scenario, seed=3):
    generator = np.random.default_rng(seed)
    return SteadyState(ParameterSpace.of(scenario), scenario.evolution, generator)


def test_first_the_population_then_two_children_per_iteration():
    optimizer = make(small_scenario(population=12, iterations=15))
    batches, iterations = run(optimizer)
    assert [len(batch) for batch in batches] == [12] + [2] * 15
    assert sum(len(batch) for batch in batches) == optimizer.evaluations_at_most
    assert iterations[0].placed == tuple(range(12))
    assert iterations[-1].stop == "all iterations done"


@pytest.mark.parametrize("oscillators", [2, 4, 8])
def test_the_mean_fitness_never_falls_and_rises_much(oscillators):
    scenario = small_scenario(oscillators=oscillators, population=20, iterations=200)
    _, iterations = run(make(scenario))
    means = np.array([iteration.report["mean_fitness"] for iteration in iterations])
    assert (np.diff(means) >= -1e-12).all()
    assert means[-1] > 0.6 * means[0]


def test_the_generator_alone_decides_a_trial():
    ours, theirs, others = (
        np.concatenate(run(make(small_scenario(), seed))[0]) for seed in (3, 3, 4)
    )
    np.testing.assert_array_equal(ours, theirs)
    assert not np.array_equal(ours, others)


def test_what_is_asked_for_can_be_changed_without_harm():
    scenario = small_scenario(iterations=2)
    first, second = make(scenario), make(scenario)
    for optimizer in (first, second):
        asked = optimizer.ask()
        told = [evaluate(vector) for vector in asked]
        if optimizer is first:
            for vector in asked:
                vector[:] = 0.0
        optimizer.tell(told)
    np.testing.assert_array_equal(first.ask(), second.ask())


def vectors_of(changes, iterations=100):
    """The initial population and the children of a trial of a changed scenario."""
    scenario = small_scenario(iterations=iterations).with_changes(changes)
    batches, _ = run(make(scenario))
    return np.array(batches[0]), np.concatenate(batches[1:])


def test_tau_b_is_twice_tau_a_unless_it_is_independent():
    for vectors in vectors_of({}):
        np.testing.assert_array_equal(vectors[:, TAU_B], 2.0 * vectors[:, TAU_A])
        assert (vectors[:, :-2] > 0.0).all()
        assert (vectors[:, TAU_A] >= 0.2).all()
    _, children = vectors_of({"evolution.independent_tau_b": True})
    assert (children[:, TAU_B] != 2.0 * children[:, TAU_A]).mean() > 0.5


def test_with_the_listings_slip_tau_a_is_only_ever_passed_on():
    initial, children = vectors_of({"evolution.tau_mutation": "listing"})
    assert set(children[:, TAU_A]) <= set(initial[:, TAU_A])
    np.testing.assert_array_equal(children[:, TAU_B], 2.0 * children[:, TAU_A])


def test_a_fixed_tau_stays():
    fixed = {"gait_bounds.tau_a_min": 0.3, "gait_bounds.tau_a_max": 0.3}
    for vectors in vectors_of(fixed):
        np.testing.assert_array_equal(vectors[:, TAU_A], 0.3)
        np.testing.assert_array_equal(vectors[:, TAU_B], 0.6)


def test_a_trial_ends_when_the_mean_fitness_levels_off():
    changes = {"evolution.stop_after": 20, "evolution.stop_window": 10}
    optimizer = make(small_scenario(iterations=100).with_changes(changes))
    for iteration in range(22):
        told = optimizer.tell([Evaluation(1.0)] * len(optimizer.ask()))
        assert told.stop == ("mean fitness levelled off" if iteration == 21 else None)


def test_without_a_fitness_there_is_no_mean():
    optimizer = make(small_scenario())
    told = optimizer.tell([Evaluation.failed("fell")] * len(optimizer.ask()))
    assert told.report == {"mean_fitness": None}
