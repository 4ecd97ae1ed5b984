"""The trial loop on a cheap fitness: what it records, and that only scenario and seed decide it."""

import pytest
from helpers.analytic import Bowl, RandomSearch, read_record, record_run, small_scenario

from tetra_drake.evolution.evaluators import on_executor
from tetra_drake.evolution.run import load_run
from tetra_drake.optimizers.base import Evaluation, Iteration


def test_neither_workers_nor_timing_change_the_record(run_small, tmp_path, one_process):
    reference = read_record(run_small("alone", workers=1))
    assert read_record(run_small("crowd", workers=7, evaluate=Bowl(delay=0.004))) == reference
    process = on_executor(Bowl(), one_process, 1)  # it is replaced on the way
    record_run(tmp_path / "pool", small_scenario(), evaluator=process)
    assert read_record(tmp_path / "pool") == reference


def test_trials_differ_and_do_not_depend_on_their_number(run_small):
    two, three = (load_run(run_small(f"{n}", trials=n)).evaluations for n in (2, 3))
    other = load_run(run_small("other", trials=1, seed=6)).evaluations
    assert two.equals(three.query("trial < 2"))
    tables = (two.query("trial == 0"), two.query("trial == 1"), other)
    first, *others = (table["weight 2->1 extensor"].tolist() for table in tables)
    assert first not in others


@pytest.mark.parametrize("report", [{"mean_fitness": "wide"}, {"stop": 3}, {"spread": object}])
def test_an_optimiser_that_reports_what_cannot_be_recorded_is_named(tmp_path, refused, report):
    class Odd(RandomSearch):
        def tell(self, evaluations):
            return Iteration(report)

    with refused("optimizer", *report, "valid"):
        record_run(tmp_path, small_scenario(trials=1), optimizer=Odd)
    assert not list(tmp_path.rglob("iterations.jsonl"))


def test_a_run_in_which_everything_fails_goes_to_its_end(run_small):
    run = load_run(run_small(evaluate=lambda vector: Evaluation(failure="no ground")))
    assert run.evaluations["failure"].tolist() == ["no ground"] * 2 * 42
    assert run.iterations["mean_fitness"].isna().all()
    assert not list(run.directory.rglob("best_gait.json"))
