"""The optimiser as a whole, told the fitness of a cheap function."""

import numpy as np
import pytest
from helpers.analytic import small_scenario

from tetra_drake.evolution.optimizers.base import Evaluation
from tetra_drake.evolution.optimizers.steady_state import SteadyState
from tetra_drake.robot.gait import TAU_A, TAU_B, ParameterSpace


def evaluate(genome):
    return Evaluation(-float(((genome[:-2] - 2.0) ** 2).sum() + abs(genome[TAU_A] - 0.25)))


def run(optimizer):
    """All asked genomes, batch by batch, and what became of them."""
    batches, iterations = [], []
    while not iterations or iterations[-1].stop is None:
        batches.append(optimizer.ask())
        iterations.append(optimizer.tell([evaluate(genome) for genome in batches[-1]]))
    return batches, iterations


def make(scenario, seed=3):
    generator = np.random.default_rng(seed)
    return SteadyState(ParameterSpace.of(scenario), scenario.evolution, generator)


def test_first_the_population_then_two_children_an_iteration():
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


def test_the_same_generator_gives_the_same_trial():
    ours, theirs = (run(make(small_scenario()))[0] for _ in range(2))
    np.testing.assert_array_equal(np.concatenate(ours), np.concatenate(theirs))
    others = run(make(small_scenario(), seed=4))[0]
    assert not np.array_equal(np.concatenate(ours), np.concatenate(others))


def test_what_is_asked_for_can_be_changed_without_harm():
    scenario = small_scenario(iterations=2)
    first, second = make(scenario), make(scenario)
    for optimizer in (first, second):
        asked = optimizer.ask()
        told = [evaluate(genome) for genome in asked]
        if optimizer is first:
            for genome in asked:
                genome[:] = 0.0
        optimizer.tell(told)
    np.testing.assert_array_equal(first.ask(), second.ask())


def test_tau_b_is_twice_tau_a_throughout():
    genomes = np.concatenate(run(make(small_scenario(iterations=100)))[0])
    np.testing.assert_array_equal(genomes[:, TAU_B], 2.0 * genomes[:, TAU_A])
    assert (genomes[:, :-2] > 0.0).all()
    assert (genomes[:, TAU_A] >= 0.2).all()


def test_an_independent_tau_b_goes_its_own_way():
    scenario = small_scenario(iterations=100)
    scenario.evolution.independent_tau_b = True
    batches, _ = run(make(scenario))
    children = np.concatenate(batches[1:])
    assert (children[:, TAU_B] != 2.0 * children[:, TAU_A]).mean() > 0.5


def test_with_the_listings_slip_tau_a_is_only_ever_passed_on():
    scenario = small_scenario(iterations=100)
    scenario.evolution.tau_mutation = "listing"
    batches, _ = run(make(scenario))
    children = np.concatenate(batches[1:])
    assert set(children[:, TAU_A]) <= {genome[TAU_A] for genome in batches[0]}
    np.testing.assert_array_equal(children[:, TAU_B], 2.0 * children[:, TAU_A])


def test_a_fixed_tau_stays():
    scenario = small_scenario(iterations=50)
    scenario.gait_bounds.tau_a_min = scenario.gait_bounds.tau_a_max = 0.3
    genomes = np.concatenate(run(make(scenario))[0])
    np.testing.assert_array_equal(genomes[:, TAU_A], 0.3)
    np.testing.assert_array_equal(genomes[:, TAU_B], 0.6)


def test_a_trial_ends_when_the_mean_fitness_levels_off():
    scenario = small_scenario(iterations=100)
    scenario.evolution.stop_after, scenario.evolution.stop_window = 20, 10
    optimizer = make(scenario)
    for iteration in range(22):
        told = optimizer.tell([Evaluation(1.0)] * len(optimizer.ask()))
        assert told.stop == ("mean fitness levelled off" if iteration == 21 else None)


def test_without_a_fitness_there_is_no_mean():
    optimizer = make(small_scenario())
    told = optimizer.tell([Evaluation.failed("fell")] * len(optimizer.ask()))
    assert told.report == {"mean_fitness": None}
