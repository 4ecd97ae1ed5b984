"""The operators one by one: their statistics, their bounds, and the listing followed by hand."""

import math

import numpy as np
import pytest

from tetra_drake.evolution.optimizers.operators import (
    cross_over,
    draw_mutation,
    find_place,
    has_levelled_off,
    mean_fitness,
    mutate,
    select_parent,
    select_victim,
)
from tetra_drake.robot.gait import TAU_A, ParameterSpace

DRAWS = 2000


class Script:
    """A generator that deals prepared numbers, as a person following the listing would."""

    def __init__(self, *numbers):
        self._numbers = list(numbers)

    def random(self, size):
        return self._deal(size)

    def integers(self, low, high, size):
        candidates = self._deal(size)
        assert ((low <= candidates) & (candidates < high)).all()
        return candidates

    def _deal(self, size):
        row = np.array(self._numbers.pop(0))
        assert row.shape == (size,)
        return row

    def is_used_up(self):
        return not self._numbers


@pytest.fixture
def generator():
    return np.random.default_rng(7)


# Selection


def test_a_parent_is_the_best_of_five_drawn_with_replacement(generator):
    fitnesses = np.arange(50.0)
    parents = np.array(
        [select_parent(fitnesses, tournament=5, generator=generator) for _ in range(20 * DRAWS)]
    )
    # The best of five of 50 is at most m with chance ((m + 1) / 50)^5.
    for member in (10, 25, 40, 48):
        expected = ((member + 1) / 50) ** 5
        assert (parents <= member).mean() == pytest.approx(expected, abs=0.01)


def test_a_victim_is_the_worst_of_five_drawn_with_replacement(generator):
    fitnesses = np.arange(50.0)
    victims = np.array(
        [select_victim(fitnesses, tournament=5, generator=generator) for _ in range(20 * DRAWS)]
    )
    for member in (1, 10, 25, 40):
        assert (victims >= member).mean() == pytest.approx(((50 - member) / 50) ** 5, abs=0.01)


def test_a_failed_member_loses_every_tournament():
    fitnesses = np.array([-math.inf, -3.0, -math.inf])
    assert select_parent(fitnesses, tournament=3, generator=Script([0, 1, 2])) == 1
    assert select_victim(fitnesses, tournament=3, generator=Script([0, 1, 1])) == 0


# Crossover


def test_a_fifth_of_the_parameters_is_swapped(generator):
    ours, theirs = np.zeros(26), np.ones(26)
    swapped = []
    for _ in range(DRAWS):
        first, second = cross_over(ours, theirs, probability=0.2, generator=generator)
        np.testing.assert_array_equal(first + second, 1.0)
        swapped.append(first)
    np.testing.assert_allclose(np.mean(swapped, axis=0), 0.2, atol=0.04)
    assert np.mean(swapped) == pytest.approx(0.2, abs=0.006)


@pytest.mark.parametrize(("probability", "swapped"), [(0.0, 0.0), (1.0, 1.0)])
def test_never_and_always_are_exact(generator, probability, swapped):
    for _ in range(100):
        first, _ = cross_over(
            np.zeros(26), np.ones(26), probability=probability, generator=generator
        )
        np.testing.assert_array_equal(first, swapped)


# Mutation


def test_seven_tenths_of_the_parameters_move_by_up_to_their_step(scenario, generator):
    steps = ParameterSpace.of(scenario).steps
    rows = np.array(
        [draw_mutation(steps, probability=0.7, generator=generator) for _ in range(DRAWS)]
    )
    moved = rows != 0.0
    assert moved.mean() == pytest.approx(0.7, abs=0.006)
    np.testing.assert_allclose(moved.mean(axis=0), 0.7, atol=0.04)
    assert (rows[moved] > 0.0).mean() == pytest.approx(0.5, abs=0.01)
    sizes = np.abs(rows) / steps
    assert sizes.max() <= 1.0
    assert sizes.max() > 0.999
    assert sizes[moved].mean() == pytest.approx(0.5, abs=0.01)


def test_a_parameter_that_a_mutation_would_take_to_its_floor_stays():
    genome = np.array([0.15, 0.15, 0.1, 0.22, 0.44])
    floors = np.array([0.0, 0.0, 0.0, 0.2, 0.4])
    child = mutate(genome, mutation=np.array([-0.2, -0.1, -0.1, -0.03, 0.1]), floors=floors)
    np.testing.assert_allclose(child, [0.15, 0.05, 0.1, 0.22, 0.54])


def test_a_parameter_below_its_floor_can_still_grow():
    child = mutate(np.array([0.1]), mutation=np.array([0.05]), floors=np.array([0.2]))
    np.testing.assert_allclose(child, [0.15])


def test_mutations_keep_weights_above_zero_and_tau_above_its_floor(scenario, generator):
    space = ParameterSpace.of(scenario)
    genome = space.random(generator)
    for _ in range(DRAWS):
        row = draw_mutation(space.steps, probability=0.7, generator=generator)
        row = -np.abs(row)
        genome = space.repair(mutate(genome, mutation=row, floors=space.floors))
        assert (genome[:-2] > 0.0).all()
        assert genome[TAU_A] > 0.2
    assert genome[:-2].max() < 0.01


# Replacement


def test_a_fitter_child_replaces_the_worst_of_its_tournament():
    fitnesses = np.array([5.0, 1.0, 3.0, 4.0])
    assert find_place(fitnesses, 3.5, tournament=3, generator=Script([0, 2, 3])) == 2


def test_a_child_that_loses_its_tournament_replaces_the_worst_of_all():
    fitnesses = np.array([5.0, 1.0, 3.0, 4.0])
    assert find_place(fitnesses, 2.0, tournament=3, generator=Script([0, 2, 3])) == 1


@pytest.mark.parametrize("fitness", [1.0, 0.5, -math.inf])
def test_a_child_no_fitter_than_the_worst_is_dropped(fitness):
    fitnesses = np.array([5.0, 1.0, 3.0, 4.0])
    assert find_place(fitnesses, fitness, tournament=3, generator=Script([0, 2, 3])) is None


def test_the_best_is_never_replaced_by_a_lesser_one(generator):
    fitnesses = generator.normal(size=10)
    for child in generator.normal(size=DRAWS):
        best = fitnesses.max()
        place = find_place(fitnesses, child, tournament=3, generator=generator)
        if place is not None:
            assert child > fitnesses[place]
            fitnesses[place] = child
        assert fitnesses.max() == max(best, child)


# Mean and stop rule


def test_failed_members_do_not_count_in_the_mean():
    assert mean_fitness(np.array([1.0, -math.inf, 3.0])) == 2.0
    assert math.isnan(mean_fitness(np.array([-math.inf])))


@pytest.mark.parametrize(
    ("iterations", "rise", "stops"),
    [(200, 0.0, False), (201, 0.0, True), (201, 0.029, True), (201, 0.031, False)],
)
def test_the_stop_rule_looks_a_hundred_iterations_back_after_the_200th(iterations, rise, stops):
    means = [0.0] * iterations + [rise]
    assert has_levelled_off(means, rise=0.03, window=100, after=200) is stops


def test_the_stop_rule_waits_for_a_whole_window():
    assert not has_levelled_off([1.0] * 5, rise=0.03, window=10, after=0)


# The listing by hand


def test_one_iteration_as_the_listing_goes_through_it(scenario):
    """A.3 for two weights and tau: two tournaments, crossover, one set of mutation numbers."""
    population = np.array([[1.0, 2.0, 0.30, 0.60], [1.5, 2.5, 0.21, 0.42], [3.0, 0.1, 0.50, 1.00]])
    fitnesses = np.array([4.0, 6.0, 5.0])
    script = Script(
        [0, 2, 0],  # can1..3 of parent 1: fitnesses 4, 5, 4
        [1, 1, 0],  # of parent 2: 6, 6, 4
        [0.9, 0.1, 0.81, 0.5],  # sw_prob: swap weight 1 and tau
        [0.6, 0.4, 0.2, 0.9],  # mut_op: add, subtract, subtract, add
        [0.31, 0.95, 0.4, 0.1],  # mut_prob: all but the last beyond 0.3
        [0.5, 1.0, 0.8, 0.7],  # times the ranges
    )
    first = population[select_parent(fitnesses, tournament=3, generator=script)]
    second = population[select_parent(fitnesses, tournament=3, generator=script)]
    np.testing.assert_array_equal([first, second], population[[2, 1]])
    first, second = cross_over(first, second, probability=0.2, generator=script)
    np.testing.assert_array_equal(first, [1.5, 0.1, 0.21, 1.00])
    np.testing.assert_array_equal(second, [3.0, 2.5, 0.50, 0.42])
    steps, floors = np.array([0.2, 0.2, 0.05, 0.1]), np.array([0.0, 0.0, 0.2, 0.4])
    row = draw_mutation(steps, probability=0.7, generator=script)
    np.testing.assert_allclose(row, [0.1, -0.2, -0.04, 0.0])
    assert script.is_used_up()
    space = ParameterSpace.of(scenario)
    first, second = (
        space.repair(mutate(child, mutation=row, floors=floors)) for child in (first, second)
    )
    # Child 1: weight 2 would be negative and tau below 0.2, so both stay.
    np.testing.assert_allclose(first, [1.6, 0.1, 0.21, 0.42])
    np.testing.assert_allclose(second, [3.1, 2.3, 0.46, 0.92])

    # Child 1, fitness 4.5: the worst of its tournament has 5, so it replaces the worst of all.
    placing = Script([1, 2, 2], [0, 1, 1])
    place = find_place(fitnesses, 4.5, tournament=3, generator=placing)
    assert place == 0
    fitnesses[place] = 4.5
    # Child 2, fitness 4.7, meets child 1 in its tournament and takes its place.
    assert find_place(fitnesses, 4.7, tournament=3, generator=placing) == 0
