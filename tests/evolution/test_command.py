"""`tetra-drake evolve`: its options, what it prints, and what it refuses."""

import argparse
import dataclasses
import io
import math

import pytest
from helpers.analytic import Bowl, read_record

from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.evolution import evaluation
from tetra_drake.evolution.command import add_evolve
from tetra_drake.evolution.progress import LiveProgress, PlainProgress, cells, duration, plain_line
from tetra_drake.evolution.record import read_manifest
from tetra_drake.evolution.tables import load_run
from tetra_drake.evolution.trial import TrialStatus
from tetra_drake.scenario.load import load_scenario


@pytest.fixture
def evolve(monkeypatch):
    """evolve("--out", ...) runs the command on a cheap fitness, and without its report."""

    def run(*arguments):
        parser = argparse.ArgumentParser()
        add_evolve(parser.add_subparsers())
        options = parser.parse_args(["evolve", *map(str, arguments)])
        options.run(options)

    monkeypatch.setattr(evaluation, "GaitEvaluation", lambda scenario: Bowl())
    monkeypatch.setattr("tetra_drake.report.run_page.write_report", lambda directory: [])
    return run


SMALL = ("--scenario", "quick", "--trials", 1, "--iterations", 3, "--workers", 1)


def test_a_run_says_where_it_stands_and_how_it_compares(evolve, tmp_path, capsys):
    out = tmp_path / "runs" / "demo"
    evolve(*SMALL, "--out", out, "--seed", 4)
    printed = capsys.readouterr().out
    assert "scenario quick, seed 4, 1 trial of at most 3 iterations" in printed
    assert "14.34 in" in printed
    assert f"--scenario {out}/scenario.yaml --gait {out}/trial_00/best_gait.json" in printed
    manifest = read_manifest(out)
    assert manifest.seed == 4
    assert manifest.scenario.evolution.max_iterations == 3


def test_the_saved_scenario_is_the_one_that_was_run(evolve, tmp_path):
    evolve(*SMALL, "--out", tmp_path / "run")
    saved = load_scenario(tmp_path / "run" / "scenario.yaml")
    quick = load_scenario("quick")
    assert saved.simulation == quick.simulation
    assert dataclasses.replace(saved.evolution, max_iterations=60) == quick.evolution


def test_resuming_needs_the_directory_only(evolve, tmp_path, capsys):
    out = tmp_path / "run"
    evolve(*SMALL, "--out", out)
    whole = read_record(out)
    evaluations = out / "trial_00" / "evaluations.jsonl"
    evaluations.write_bytes(evaluations.read_bytes()[:-100])
    evolve("--out", out, "--resume")
    assert read_record(out) == whole
    evolve("--out", out, "--resume", *SMALL)
    assert read_record(out) == whole
    assert capsys.readouterr().err == ""


def test_a_resumed_run_with_other_versions_says_so(evolve, tmp_path, capsys):
    out = tmp_path / "run"
    evolve(*SMALL, "--out", out)
    manifest = out / "manifest.json"
    current = read_manifest(out).versions["numpy"]
    manifest.write_text(manifest.read_text().replace(f'"{current}"', '"0.9"'))
    evolve("--out", out, "--resume")
    assert "was begun with numpy 0.9" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "key"),
    [
        (("--trials", 2), "evolution.trials"),
        (("--iterations", 4), "evolution.max_iterations"),
        (("--scenario", "thesis"), "name"),
        (("--seed", 1), "seed"),
    ],
)
def test_a_run_is_resumed_as_what_it_is(evolve, tmp_path, options, key, refused):
    evolve(*SMALL, "--out", tmp_path / "run")
    with refused(tmp_path / "run", key, "the run has"):
        evolve("--out", tmp_path / "run", "--resume", *options)


def test_nothing_is_written_for_a_bad_scenario(evolve, tmp_path):
    with pytest.raises(InputError, match="no such scenario file"):
        evolve("--scenario", "quack", "--out", tmp_path / "run")
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("option", ["--trials", "--iterations", "--workers"])
@pytest.mark.parametrize("value", ["0", "-3", "many"])
def test_counts_are_counts(evolve, tmp_path, option, value, capsys):
    with pytest.raises(SystemExit) as caught:
        evolve("--out", tmp_path / "run", f"{option}={value}")
    assert caught.value.code == 2
    assert option in capsys.readouterr().err


def test_a_report_is_written_at_the_end_even_of_a_run_that_has_ended(
    evolve, tmp_path, capsys, monkeypatch
):
    reported = []

    def write_report(directory):
        reported.append(len(load_run(directory).iterations))
        return ["report.html"]

    monkeypatch.setattr("tetra_drake.report.run_page.write_report", write_report)
    for options in (SMALL, ("--resume",)):
        evolve("--out", tmp_path / "run", *options)
        printed = capsys.readouterr().out
        assert printed.endswith(f"\nwrote report.html to {tmp_path / 'run'}/\n")
    assert reported == [4, 4]


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (InputError("report.html", "", "cannot be written"), ": report.html: cannot be written;"),
        (SimulationFailure(time=1.5, reason="it fell"), "simulation failed at t = 1.5000 s: it"),
        (KeyError("x1"), "KeyError('x1')"),
    ],
)
def test_a_report_that_fails_does_not_look_like_a_run_that_failed(
    evolve, tmp_path, capsys, monkeypatch, error, reason
):
    def write_report(directory):
        raise error

    monkeypatch.setattr("tetra_drake.report.run_page.write_report", write_report)
    evolve(*SMALL, "--out", tmp_path / "run")
    captured = capsys.readouterr()
    assert "14.34 in" in captured.out
    assert len(captured.err.splitlines()) == 1
    assert "the run is complete, but its report could not be written" in captured.err
    assert reason in captured.err
    assert captured.err.endswith(f"try again with: tetra-drake figures {tmp_path / 'run'}\n")


def test_where_all_gaits_failed_none_is_offered_to_be_seen(evolve, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(evaluation, "GaitEvaluation", lambda scenario: Bowl(fails_every=1))
    evolve(*SMALL, "--out", tmp_path / "run")
    printed = capsys.readouterr().out
    assert "26 failed" in printed
    assert "see the best gait" not in printed


def test_an_interrupted_run_says_how_to_go_on(evolve, tmp_path, capsys, monkeypatch):
    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("tetra_drake.evolution.run.evolve", interrupt)
    with pytest.raises(KeyboardInterrupt):
        evolve(*SMALL, "--out", tmp_path / "run")
    message = f"tetra-drake evolve --out {tmp_path / 'run'} --resume"
    assert message in capsys.readouterr().err


# Progress

STATUS = TrialStatus(
    number=1,
    evaluations_at_most=140,
    iteration=10,
    evaluations=40,
    recalled=20,
    failures=1,
    mean_fitness=1.5,
    best_fitness=4.25,
    best_distance_in=5.0,
)


def test_a_trials_row_counts_what_was_evaluated_now():
    # 20 evaluations in 40 s, 100 to go.
    assert cells(STATUS, 40.0) == [
        "1", "10", "1.50", "4.25", "5.00 in", "0.50", "0:03:20", "1",
    ]  # fmt: skip
    line = plain_line(STATUS, 40.0)
    assert line == (
        "trial 1: iteration 10, mean fitness 1.50, best 4.25, best distance 5.00 in, "
        "0.50 evaluations/s, 0:03:20 left, 1 failed"
    )


def test_a_row_before_anything_is_known_and_after_the_end():
    fresh = TrialStatus(number=0, evaluations_at_most=140)
    assert cells(fresh, 0.0)[1:7] == ["0 (0 done)", "-", "-", "- in", "0.00", "-"]
    ended = dataclasses.replace(STATUS, stop="all iterations done")
    assert cells(ended, 40.0)[6] == "all iterations done"
    assert math.isnan(fresh.mean_fitness)


def test_plain_lines_come_now_and_then_and_at_the_end(monkeypatch):
    now = [100.0]
    monkeypatch.setattr("tetra_drake.evolution.progress.time.monotonic", lambda: now[0])
    stream = io.StringIO()
    status = dataclasses.replace(STATUS)
    with PlainProgress(stream) as progress:
        for second in range(25):
            now[0] = 100.0 + second
            status.evaluations += 1
            progress.show([status])
        assert len(stream.getvalue().splitlines()) == 2
        status.stop = "all iterations done"
        for _ in range(3):
            progress.show([status])
    assert len(stream.getvalue().splitlines()) == 3
    assert "all iterations done" in stream.getvalue()


def test_the_live_table_has_a_row_a_trial(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "120")
    with LiveProgress() as progress:
        progress.show([STATUS, dataclasses.replace(STATUS, number=2)])
    printed = capsys.readouterr().out
    for text in ("mean fitness", "4.25", "5.00 in"):
        assert text in printed


def test_the_time_left_is_readable():
    assert [duration(seconds) for seconds in (0.2, 61, 36000)] == ["0:00:00", "0:01:01", "10:00:00"]
