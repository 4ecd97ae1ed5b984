"""The results of a run: the same from its record as at its end."""

import dataclasses
import math
from concurrent.futures import ThreadPoolExecutor

import pytest
from helpers.analytic import Bowl, small_scenario
from helpers.synthetic_run import write_run

from tetra_drake.evolution.record import RunRecord
from tetra_drake.evolution.run import evolve
from tetra_drake.evolution.summary import comparisons, recorded_statuses, summary
from tetra_drake.evolution.tables import load_run


def test_the_record_says_what_the_run_said_at_its_end(tmp_path):
    with RunRecord.create(tmp_path / "run", scenario=small_scenario(), seed=3) as record:
        ended = evolve(
            record, evaluate=Bowl(delay=0.001), workers=2, make_executor=ThreadPoolExecutor
        )
    recorded = recorded_statuses(load_run(tmp_path / "run"))
    assert summary(recorded) == summary(ended)
    for ours, theirs in zip(recorded, ended, strict=True):
        assert ours.wall_time == pytest.approx(theirs.wall_time, abs=1e-3)
        alike = {"wall_time": 0.0, "recalled": 0}
        assert dataclasses.replace(ours, **alike) == dataclasses.replace(theirs, **alike)


def test_an_unfinished_run_says_how_far_it_has_come(tmp_path):
    run = write_run(
        tmp_path / "run",
        [[[(1.0, 0), (None, 1)], [(4.0, 1)]], [[(None, 0)]], []],
        unfinished=(0, 1, 2),
    )
    first, second, third = recorded_statuses(load_run(run))
    assert (first.iteration, first.evaluations, first.failures, first.stop) == (1, 3, 1, None)
    assert (first.initial_mean_fitness, first.mean_fitness) == (1.0, 2.5)
    assert (first.initial_best_distance_in, first.best_distance_in) == (0.5, 2.0)
    assert (second.failures, second.best_fitness) == (1, -math.inf)
    assert (third.iteration, third.evaluations) == (-1, 0)
    ours = {row.name: row.ours for row in comparisons([first, second, third])}
    assert ours["best evolved gait"] == "2.00 in"
    assert ours["improvement, mean of trials"] == "300.00 %"
    assert ours["simulation time per iteration"] == "1.00 s"


def test_a_run_that_has_just_begun_says_so_without_numbers(tmp_path):
    (status,) = recorded_statuses(load_run(write_run(tmp_path / "run", [[]])))
    assert "not ended after iteration -1" in summary([status])
