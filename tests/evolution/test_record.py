"""Run directories: what is refused, repaired and reported, and how runs are resumed."""

import hashlib
import json
import math
import subprocess
import sys

import numpy as np
import pytest
from helpers.analytic import Bowl, read_record, small_scenario

from tetra_drake.errors import InputError
from tetra_drake.evolution.method import Method
from tetra_drake.evolution.optimizers.base import Evaluation
from tetra_drake.evolution.record import RunRecord, TrialRecord, evaluation_entry, read_manifest
from tetra_drake.results.result import versions


def cut(path, size):
    path.write_bytes(path.read_bytes()[:size])


class Interrupted(Exception):
    pass


def interrupted_after(count):
    """Bowl, until it has been asked `count` times."""
    asked = []

    def evaluate(genome):
        asked.append(genome)
        if len(asked) > count:
            raise Interrupted
        return Bowl()(genome)

    return evaluate


# Manifest


def test_the_manifest_holds_seed_versions_and_method_and_the_scenario_its_own_file(run_small):
    run = run_small(seed=11)
    manifest = read_manifest(run)
    assert manifest.scenario == small_scenario()
    assert manifest.seed == 11
    assert manifest.versions == versions()
    assert manifest.method == Method.of(small_scenario())
    raw = json.loads((run / "manifest.json").read_text())
    text = (run / "scenario.yaml").read_bytes()
    assert raw["scenario_sha256"] == hashlib.sha256(text).hexdigest()
    assert "scenario" not in raw


def test_a_directory_without_manifest_is_no_run(tmp_path, refused):
    with refused(tmp_path, "", "manifest.json"):
        RunRecord.resume(tmp_path)
    with refused(tmp_path / "none", "", "manifest.json"):
        RunRecord.resume(tmp_path / "none")
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize(
    ("key", "value"), [("seed", "x"), ("schema", 3), ("versions", []), ("objective", 7)]
)
def test_a_damaged_manifest_is_reported(run_small, refused, key, value):
    run = run_small(population=4, iterations=1)
    manifest = run / "manifest.json"
    manifest.write_text(json.dumps(json.loads(manifest.read_text()) | {key: value}))
    with refused(manifest, key, ""):
        RunRecord.resume(run)
    cut(manifest, 50)
    with refused(manifest, "", "cannot be read"):
        RunRecord.resume(run)


def test_a_scenario_changed_after_the_run_began_is_reported(run_small, refused):
    run = run_small()
    scenario = run / "scenario.yaml"
    scenario.write_text(scenario.read_text().replace("population: 12", "population: 13"))
    with refused(scenario, "", "manifest.json"):
        RunRecord.resume(run)


# What is refused


def test_an_existing_run_is_refused(run_small, refused):
    run = run_small()
    before = read_record(run)
    with refused(run, "", "--resume"):
        RunRecord.create(run, scenario=small_scenario(), seed=5)
    assert read_record(run) == before


def test_a_directory_with_other_things_in_it_is_refused(tmp_path, refused):
    (tmp_path / "notes.txt").write_text("mine")
    with refused(tmp_path, "", "is not empty"):
        RunRecord.create(tmp_path, scenario=small_scenario(), seed=5)
    with refused(tmp_path / "notes.txt", "", "is a file"):
        RunRecord.create(tmp_path / "notes.txt", scenario=small_scenario(), seed=5)
    with refused(tmp_path / "notes.txt" / "run", "", "is a file"):
        RunRecord.create(tmp_path / "notes.txt" / "run", scenario=small_scenario(), seed=5)


def test_what_a_kill_in_the_first_moment_leaves_is_an_empty_directory(tmp_path):
    (tmp_path / ".lock").touch()
    (tmp_path / ".manifest.x1.json").touch()
    with RunRecord.create(tmp_path, scenario=small_scenario(), seed=5):
        pass
    assert not (tmp_path / ".manifest.x1.json").exists()


def test_another_seed_or_scenario_is_refused(run_small, refused):
    run = run_small(seed=5)
    with refused(run, "seed", "5, not 6"):
        RunRecord.resume(run, seed=6)
    with refused(run, "evolution.population", "12"):
        RunRecord.resume(run, scenario=small_scenario(population=13))
    other = Method.of(small_scenario(), objective=Bowl())
    with refused(run, "objective", "Bowl"):
        RunRecord.resume(run, method=other)
    with RunRecord.resume(
        run, scenario=small_scenario(), seed=5, method=Method.of(small_scenario())
    ):
        pass


def test_a_second_process_is_refused_until_the_first_ends(run_small):
    run = run_small()
    program = (
        "import sys\n"
        "from pathlib import Path\n"
        "from tetra_drake.evolution.record import RunRecord\n"
        "with RunRecord.resume(Path(sys.argv[1])):\n"
        "    print('open', flush=True)\n"
        "    sys.stdin.read()\n"
    )
    command = [sys.executable, "-c", program, str(run)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        assert other.stdout.readline() == b"open\n"
        with pytest.raises(InputError, match="another process is at work"):
            RunRecord.resume(run)
        other.kill()
    with RunRecord.resume(run):
        pass


# Torn and damaged lines


@pytest.mark.parametrize("name", ["evaluations.jsonl", "iterations.jsonl"])
@pytest.mark.parametrize("lost", [1, 7, 60, 500, 5000])
def test_a_torn_end_is_made_good(run_small, name, lost):
    run = run_small()
    whole = read_record(run)
    path = run / "trial_01" / name
    cut(path, max(0, len(path.read_bytes()) - lost))
    run_small(resume=True)
    assert read_record(run) == whole


DAMAGED = [b"{nonsense", b"", b"\xff\xfe", b"[1, 2]", b"\0" * 30, b'{"index": 4}']


@pytest.mark.parametrize("line", [3, 42])
@pytest.mark.parametrize("content", DAMAGED)
def test_a_damaged_line_is_reported(run_small, refused, line, content):
    run = run_small(trials=1)
    path = run / "trial_00" / "evaluations.jsonl"
    lines = path.read_bytes().splitlines()
    lines[line - 1] = content
    path.write_bytes(b"\n".join(lines) + b"\n")
    with refused(path, f"line {line}", "damaged"):
        run_small(resume=True)


@pytest.mark.parametrize(
    ("key", "value"),
    [("genome", [2.0] * 26), ("placed", 77), ("index", 77), ("fitness", "high"), ("iteration", 3)],
)
def test_a_line_that_does_not_follow_is_reported(run_small, refused, key, value):
    run = run_small(trials=1)
    path = run / "trial_00" / "evaluations.jsonl"
    entries = [json.loads(text) for text in path.read_text().splitlines()]
    entries[19][key] = value
    path.write_text("".join(json.dumps(entry) + "\n" for entry in entries))
    with refused(path, "line 20", key):
        run_small(resume=True)


def test_lines_beyond_the_end_are_reported(run_small, refused):
    run = run_small()
    path = run / "trial_00" / "evaluations.jsonl"
    last = json.loads(path.read_text().splitlines()[-1]) | {"index": 42}
    path.write_text(path.read_text() + json.dumps(last) + "\n")
    with refused(path, "line 43", "the trial ends before"):
        run_small(resume=True)


def test_a_changed_iteration_is_reported(run_small, refused):
    run = run_small()
    path = run / "trial_00" / "iterations.jsonl"
    path.write_text(path.read_text().replace('"evaluations": 14', '"evaluations": 15'))
    with refused(path, "line 2", "evaluations is not what"):
        run_small(resume=True)


# Resuming


@pytest.mark.parametrize("count", [0, 1, 11, 12, 23, 24, 25, 60, 83])
def test_an_interrupted_run_ends_like_one_that_was_not(run_small, count):
    whole = read_record(run_small("whole"))
    with pytest.raises(Interrupted):
        run_small("run", evaluate=interrupted_after(count), workers=1)
    run = run_small("run", resume=True)
    assert read_record(run) == whole


def test_no_finished_evaluation_is_made_again(run_small):
    with pytest.raises(Interrupted):
        run_small(evaluate=interrupted_after(40), workers=1)
    asked = []

    def evaluate(genome):
        asked.append(genome)
        return Bowl()(genome)

    run_small(evaluate=evaluate, resume=True)
    assert len(asked) == 2 * 42 - 40


def test_a_finished_run_is_resumed_without_an_evaluation(run_small):
    run = run_small()
    whole = read_record(run)
    run_small(resume=True, evaluate=interrupted_after(0))
    assert read_record(run) == whole


def test_what_is_in_progress_is_recalled_but_never_for_another_genome(tmp_path, refused):
    genome = np.linspace(1.0, 2.0, 26)
    failed = Evaluation(-math.inf, {}, "why", 1.25)
    TrialRecord(tmp_path).keep(evaluation_entry(3, 1, genome, failed))
    with (tmp_path / "in_progress.jsonl").open("a") as file:
        file.write('{"index": 4, "torn')
    record = TrialRecord(tmp_path)
    recalled = record.recall(3, genome)
    assert recalled == Evaluation(-math.inf, {}, "why", 1.25)
    assert record.recall(4, genome) is None
    with refused(tmp_path / "in_progress.jsonl", "line 1", "the genome is not the one"):
        record.recall(3, genome + 1.0)
