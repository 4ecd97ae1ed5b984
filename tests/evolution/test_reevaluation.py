"""Gaits of a run evaluated once more: which, how often, and what is kept of it."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import pytest
from helpers.analytic import Bowl

from tetra_drake.evolution.optimizers.base import Evaluation
from tetra_drake.evolution.reevaluation import (
    best_distances,
    best_gaits,
    initial_gaits,
    reevaluate,
)
from tetra_drake.evolution.tables import load_run


@dataclass(frozen=True)
class Slope:
    """Another opinion of the same genomes: half an inch less than Bowl's."""

    def __call__(self, genome) -> Evaluation:
        bowl = Bowl(fails_every=10**9)(genome)
        shorter = {"distance_in": bowl.metrics["distance_in"] - 0.5}
        return replace(bowl, metrics=shorter, engine="drake")


def again(directory, choose, evaluate=None):
    reevaluate(
        directory,
        choose,
        workers=2,
        evaluate=evaluate or Slope(),
        make_executor=ThreadPoolExecutor,
    )
    return load_run(directory)


def test_the_five_best_of_each_trial_are_evaluated_again(run_small):
    directory = run_small()
    run = again(directory, best_gaits)
    assert list(run.reevaluations.groupby("trial").size()) == [5, 5]
    for trial in range(2):
        ours = run.evaluations[run.evaluations["trial"] == trial].set_index("index")
        chosen = run.reevaluations[run.reevaluations["trial"] == trial].set_index("index")
        best = ours["fitness"].sort_values(ascending=False, kind="stable").drop_duplicates().head(5)
        assert set(chosen.index) == set(best.index)
        assert set(chosen["engine"]) == {"drake"}
        assert (chosen["weight_7"] == ours.loc[chosen.index, "weight_7"]).all()
    for _, recorded, on_drake in best_distances(run):
        assert on_drake == pytest.approx(recorded - 0.5)


def test_all_initial_gaits_can_be_evaluated_again(run_small):
    run = again(run_small(), initial_gaits)
    assert list(run.reevaluations.groupby("trial").size()) == [12, 12]
    assert (run.reevaluations["iteration"] == 0).all()


def test_what_is_done_is_not_done_again(run_small):
    directory = run_small()
    again(directory, best_gaits)

    def forbidden(genome):
        raise AssertionError("evaluated twice")

    assert len(again(directory, best_gaits, forbidden).reevaluations) == 10


def test_a_torn_reevaluation_is_made_again(run_small):
    directory = run_small()
    again(directory, best_gaits)
    path = directory / "trial_01" / "reevaluations.jsonl"
    path.write_bytes(path.read_bytes()[:-9])
    assert len(load_run(directory).reevaluations) == 9
    assert len(again(directory, best_gaits).reevaluations) == 10


def test_without_reevaluations_there_is_nothing_to_compare(run_small):
    run = load_run(run_small())
    assert run.reevaluations.empty
    assert all(on_drake != on_drake for _, _, on_drake in best_distances(run))
