"""Where two runs part that search with the same seeds."""

import dataclasses

import numpy as np
import pytest
from helpers.recorded import recorded_run
from parting import asked, partings

CHANGED = 50
"""The first evaluation after the initial population."""


@pytest.fixture(scope="module")
def run():
    return recorded_run("thesis")


def changed(run, **values):
    """The run, in whose trials the evaluation CHANGED has other values."""
    table = run.evaluations.copy()
    for name, value in values.items():
        table.loc[table["index"] == CHANGED, name] = value
    return dataclasses.replace(run, evaluations=table)


def test_a_search_told_the_recorded_fitnesses_asks_for_the_recorded_gaits(run):
    for trial in (0, 2):
        vectors, kept = asked(run, trial), run.with_parameters.query("trial == @trial")
        assert len(vectors) == len(run.evaluations.query("trial == @trial"))
        for index in kept["index"].astype(int):
            assert np.array_equal(vectors[index], run.vector(trial, index))


def test_a_run_does_not_part_from_itself_nor_where_only_distances_differ(run):
    for other, apart in ((run, 0.0), (changed(run, distance_in=99.0), 90.0)):
        found = partings(other, run)
        assert found["alike"].equals(found["evaluations"])
        assert (found["first_best"] == found["second_best"]).all()
        assert (found["apart"] == 0.0).all() and (found["farthest"] >= apart).all()
