"""A recorded run as tables: columns, best gaits, populations, states of trials."""

import dataclasses
import functools
import lzma
import math

import numpy as np
import pytest
from helpers.analytic import Bowl, record_run, small_scenario
from helpers.synthetic_run import write_run

from tetra_drake.errors import InputError
from tetra_drake.evolution.run import load_run
from tetra_drake.evolution.trials import ALL_DONE
from tetra_drake.optimizers.base import Task
from tetra_drake.robot.gait_file import load_gait
from tetra_drake.settings.units import INCH


def test_every_evaluation_is_a_row_of_a_table_and_iterations_follow_from_them(run_small):
    run = load_run(run_small(seed=11, population=12, iterations=15))
    assert run.manifest.seed == 11 and len(run.evaluations) == 2 * 42
    table = run.evaluations.query("trial == 1")
    assert table["index"].tolist() == list(range(42))
    assert table["iteration"].tolist() == [0] * 12 + [1 + i // 2 for i in range(30)]
    assert table["placed"].iloc[:12].tolist() == list(range(12))
    for row in table.to_dict("records"):
        expected = Bowl()(Task(run.vector(1, row["index"])))
        assert row["weight 4->1 extensor"] == run.vector(1, row["index"])[2]
        if expected.failure:
            assert row["failure"] == expected.failure and math.isnan(row["fitness"])
        else:
            assert row["fitness"] == expected.fitness
            assert {name: row[name] for name in expected.metrics} == expected.metrics
            assert row["distance_in"] == row["distance"] / INCH
    assert 0 < table["failure"].notna().sum() < 42

    means = run.iterations.pivot(index="iteration", columns="trial", values="mean_fitness")
    assert means.shape == (16, 2)
    for row in run.iterations.query("trial == 1").to_dict("records"):
        so_far = table[table["iteration"] <= row["iteration"]].set_index("index")
        members = so_far.dropna(subset="placed").drop_duplicates("placed", keep="last")
        assert row["mean_fitness"] == pytest.approx(members["fitness"].mean(), rel=1e-12)
        assert row["best_fitness"] == members["fitness"].max()
        best = so_far.loc[row["best_evaluation"]]
        assert (best["fitness"], best["distance"]) == (row["best_fitness"], row["best_distance"])
    assert run.iterations["stop"].dropna().to_dict() == dict.fromkeys((15, 31), ALL_DONE)


def test_a_run_in_progress_loads_and_is_left_alone(run_small):
    run = run_small()
    for path in run.glob("trial_00/*s.jsonl"):
        path.write_bytes(path.read_bytes()[:-10])
    torn = path.read_bytes()
    assert len(load_run(run).evaluations) == 2 * 42 - 1
    assert path.read_bytes() == torn
    done = run / "trial_00" / "evaluations.jsonl"
    under_way = done.with_name("in_progress.jsonl")
    first, second = done.read_bytes().splitlines(keepends=True)[:2]
    under_way.write_bytes(second + first)
    assert len(load_run(run).evaluations) == 2 * 42 - 1
    for file in [*run.glob("trial_*/evaluations.jsonl"), *run.glob("trial_*/iterations.jsonl")]:
        file.unlink()
    assert load_run(run).evaluations["index"].to_list() == [1, 0]
    under_way.unlink()
    empty = load_run(run)
    assert empty.evaluations.empty
    assert [status.evaluations for status in empty.statuses] == [0, 0]
    with pytest.raises(InputError):
        empty.fittest()


def test_each_tetrahedrons_lifted_share_is_a_column(tmp_path):
    shares = {4.0: {"lifted_shares": [0.25, 0.0, 0.5]}}
    run = load_run(write_run(tmp_path / "run", [[[(None, 0), (4.0, 1)]]], metrics=shares))
    columns = ["lifted_T1", "lifted_T2", "lifted_T3"]
    np.testing.assert_array_equal(run.evaluations[columns], [[math.nan] * 3, [0.25, 0.0, 0.5]])
    assert run.gait(0, 1)


def test_a_compressed_record_reads_alike_and_can_be_added_to(run_small, refused, monkeypatch):
    run = run_small()
    plain = load_run(run)
    for path in run.rglob("*.jsonl"):
        path.with_name(path.name + ".xz").write_bytes(lzma.compress(path.read_bytes()))
        path.unlink()
    compressed = load_run(run)
    assert compressed.evaluations.equals(plain.evaluations)
    assert compressed.iterations.equals(plain.iterations)
    file = plain.file("iterations.jsonl", trial=0)
    entries = list(file.read())
    more = entries[-1].model_copy(update={"iteration": len(entries)})
    file.append([more])
    assert list(file.read()) == [*entries, more]
    packed = run / "trial_00" / "iterations.jsonl.xz"
    monkeypatch.setattr("tetra_drake.evolution.entries.MOST", 2**20)
    compress = functools.partial(lzma.compress, preset=0)
    faults = {b"": "", b"no xz": "", compress(b"{}\n")[:-9]: ""}
    faults |= {compress(bytes(2**21)): "", compress(b"{}"): "no end"}
    no_json = (b"{nonsense\n", b"[1]\n", b"\xff\n", b"[" * 10**5 + b"\n")
    for content, fact in (faults | {compress(line): "JSON" for line in no_json}).items():
        packed.write_bytes(content)
        with refused(packed, "line 1" if fact else "", fact):
            load_run(run)


def test_the_best_of_each_trial_are_different_gaits_the_earlier_of_equals_first(tmp_path):
    trials = [[[(5.0, 0), (5.0, 1), (None, 2), (4.0, 3)]], [[(3.0, 0)], [(6.0, 0)]]]
    run = load_run(write_run(tmp_path / "run", trials))
    assert run.best(3)[["trial", "index"]].to_numpy().tolist() == [[0, 0], [0, 3], [1, 1], [1, 0]]
    assert run.best()["fitness"].tolist() == [5.0, 6.0]
    assert run.fittest().equals(run.evaluations.query("trial == 1 and index == 1").iloc[0])
    assert run.initial_best(1).equals(run.evaluations.query("trial == 1 and index == 0").iloc[0])
    assert run.best_gait() == run.gait(1, 1) != run.gait(0, 0)
    assert run.gaits() == [run.gait(0, 0), run.gait(1, 1)]
    assert run.gaits(3)[1].name == "tiny, seed 7, trial 0, evaluation 3"
    assert run.initial()["index"].tolist() == [0, 1, 2, 3, 0]


def test_the_record_says_what_the_run_said_at_its_end_and_best_gaits_are_saved(tmp_path, scenario):
    ended = record_run(tmp_path / "run", small_scenario(), evaluate=Bowl(delay=0.001))
    recorded = load_run(tmp_path / "run").statuses
    for ours, theirs in zip(recorded, ended, strict=True):
        assert ours.wall_time == pytest.approx(theirs.wall_time, abs=1e-3)
        assert dataclasses.replace(ours, wall_time=theirs.wall_time) == theirs
    for trial, gait in enumerate(load_run(tmp_path / "run").gaits()):
        assert load_gait(tmp_path / f"run/trial_0{trial}/best_gait.json", scenario) == gait


def test_an_unfinished_run_says_how_far_it_has_come(tmp_path):
    trials = [[[(1.0, 0), (None, 1)], [(4.0, 1)]], [[(None, 0)]], []]
    run = load_run(write_run(tmp_path / "run", trials, unfinished=(0, 1, 2)))
    first, second, third = run.statuses
    assert (first.iteration, first.evaluations, first.failures, first.stop) == (1, 3, 1, None)
    assert (first.best_fitness, first.best_distance / INCH) == pytest.approx((4.0, 2.0))
    assert (second.failures, second.best_fitness) == (1, -math.inf)
    assert (third.iteration, third.evaluations) == (-1, 0)
