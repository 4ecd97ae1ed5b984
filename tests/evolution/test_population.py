"""The population of a trial, read back from who took whose place."""

import json

import numpy as np
import pytest
from helpers.synthetic_run import write_run

from tetra_drake.evolution.population import last_population, two_best
from tetra_drake.evolution.tables import load_run


def test_it_has_the_recorded_mean_fitness_after_every_iteration(run_small):
    run = load_run(run_small())
    for trial in (0, 1):
        evaluations = run.evaluations[run.evaluations["trial"] == trial]
        for _, line in run.iterations[run.iterations["trial"] == trial].iterrows():
            population = last_population(evaluations[evaluations["iteration"] <= line["iteration"]])
            assert population["placed"].tolist() == list(range(12))
            assert population["fitness"].mean() == pytest.approx(line["mean_fitness"])


def test_the_two_best_are_those_of_a_population_kept_by_hand(run_small):
    directory = run_small()
    run = load_run(directory)
    for trial in (0, 1):
        population = {}
        lines = (directory / f"trial_0{trial}" / "evaluations.jsonl").read_text().splitlines()
        for entry in map(json.loads, lines):
            if entry["placed"] is not None:
                population[entry["placed"]] = entry
        members = [entry for entry in population.values() if entry["fitness"] is not None]
        expected = sorted(members, key=lambda entry: -entry["fitness"])[:2]
        pair = two_best(run.evaluations[run.evaluations["trial"] == trial])
        for member, entry in zip(pair, expected, strict=True):
            assert member.evaluation == entry["index"]
            assert member.fitness == entry["fitness"]
            assert member.genome.tolist() == entry["genome"]


def pair_of(tmp_path, *iterations):
    return two_best(load_run(write_run(tmp_path / "run", [iterations])).evaluations)


def test_who_was_replaced_or_dropped_is_no_longer_in_it(tmp_path):
    first, second = pair_of(
        tmp_path, [(5.0, 0), (1.0, 1), (3.0, 2)], [(6.0, 0), (4.0, None)], [(2.0, 1)]
    )
    assert (first.fitness, second.fitness) == (6.0, 3.0)
    assert (first.evaluation, second.evaluation) == (3, 2)


def test_equal_genomes_are_one_gait(tmp_path):
    first, second = pair_of(tmp_path, [(5.0, 0), (5.0, 1), (3.0, 2)])
    assert (first.evaluation, second.evaluation) == (0, 2)
    assert np.any(first.genome != second.genome)


def test_there_are_no_two_best_of_fewer_than_two(tmp_path):
    assert pair_of(tmp_path, [(None, 0), (5.0, 1), (None, 2)]) is None
    assert pair_of(tmp_path / "twins", [(5.0, 0), (5.0, 1)]) is None
