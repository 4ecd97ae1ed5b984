"""The operators of the thesis's algorithm: an iteration of the listing by hand, and its
other rules."""

import math
from types import SimpleNamespace

import numpy as np

from tetra_drake.optimizers.base import mean_fitness
from tetra_drake.optimizers.steady_state import (
    find_place,
    has_levelled_off,
    make_children,
    mutation_steps,
    select_parent,
)
from tetra_drake.robot.parameter_space import ParameterSpace
from tetra_drake.scenario import optimizer_kinds as kinds


class Script:
    """A generator that deals prepared numbers, as a person following the listing would."""

    def __init__(self, *numbers, members=3):
        self.numbers, self.members = list(numbers), members

    def random(self, size):
        row = np.array(self.numbers.pop(0))
        assert row.shape == (size,)
        return row

    def integers(self, low, high, size):
        assert (low, high) == (0, self.members)
        return self.random(size)


def test_failed_members_lose_every_tournament_and_do_not_count_in_the_mean():
    fitnesses = np.array([-math.inf, -3.0, -math.inf])
    assert select_parent(fitnesses, tournament=3, generator=Script([0, 1, 2])) == 1
    assert find_place(fitnesses, math.inf, tournament=3, generator=Script([0, 1, 1])) == 0
    assert mean_fitness(fitnesses) == -3.0
    assert math.isnan(mean_fitness(fitnesses[:1]))


def test_a_child_replaces_the_worst_of_its_tournament_or_else_of_all():
    fitnesses = np.array([5.0, 1.0, 3.0, 4.0])
    for fitness, place in {3.5: 2, 2.0: 1, 1.0: None, -math.inf: None}.items():
        found = find_place(fitnesses, fitness, tournament=3, generator=Script([0, 2, 3], members=4))
        assert found == place


def test_the_stop_rule_looks_a_hundred_iterations_back_after_the_200th():
    rule = kinds.SteadyState(stop_rise=0.03, stop_window=100, stop_after=200)
    for iterations, rise, stops in ((200, 0, 0), (201, 0, 1), (201, 0.029, 1), (201, 0.031, 0)):
        assert has_levelled_off([0.0] * iterations + [rise], rule) == stops
    assert not has_levelled_off([0.0] * 202, kinds.SteadyState(stop_window=300, stop_after=0))


def test_one_iteration_as_the_listing_goes_through_it():
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
        [1, 2, 2],  # places: the tournament of child 1
        [0, 1, 1],  # of child 2
    )
    parents = [select_parent(fitnesses, tournament=3, generator=script) for _ in range(2)]
    assert parents == [2, 1]
    space = SimpleNamespace(
        names=["weight 1", "weight 2", "tau_A", "tau_B"],
        low=np.array([1.0, 1.0, 0.2, 0.4]),
        high=np.array([3.4, 3.4, 0.5, 1.0]),
        floors=np.array([0.0, 0.0, 0.2, 0.4]),
        body=slice(2, 2),
    )
    mutants = make_children(*population[parents], space, kinds.SteadyState(), script)
    # Children [1.5, 0.1, 0.21, 1.00] and [3.0, 2.5, 0.50, 0.42], moved by [0.1, -0.2, -0.04, 0.0].
    # Child 1: weight 2 would be negative and tau below 0.2, so both stay.
    np.testing.assert_allclose(mutants, [[1.6, 0.1, 0.21, 1.00], [3.1, 2.3, 0.46, 0.42]])

    # Child 1, fitness 4.5: the worst of its tournament has 5, so it replaces the worst of all.
    assert find_place(fitnesses, 4.5, tournament=3, generator=script) == 0
    fitnesses[0] = 4.5
    # Child 2, fitness 4.7, meets child 1 in its tournament and takes its place.
    assert find_place(fitnesses, 4.7, tournament=3, generator=script) == 0
    assert script.numbers == []


def test_steps_are_the_thesis_s(scenario):
    def steps(changes):
        changed = scenario.with_changes(changes)
        return mutation_steps(ParameterSpace.of(changed), changed.optimizer)

    np.testing.assert_allclose(steps({})[[0, -2, -1]], [0.2, 0.05, 0.1])  # τ_A, τ_B
    listing = {"optimizer.tau_mutation": "listing"}
    np.testing.assert_allclose(steps(listing)[[-2, -1]], [0.0, 0.1])
