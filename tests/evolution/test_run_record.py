"""Run directories: what is refused, repaired and reported, and how runs are resumed."""

import hashlib
import json
import math
import re
import subprocess
import sys

import numpy as np
import pytest
from helpers.analytic import read_record, small_scenario

from tetra_drake.errors import InputError
from tetra_drake.evolution.entries import json_line
from tetra_drake.evolution.manifest import Method, read_manifest
from tetra_drake.evolution.run import load_run
from tetra_drake.evolution.run_record import RunRecord, TrialRecord
from tetra_drake.machine import versions
from tetra_drake.optimizers.base import Evaluation, Task


def cut(path, lost):
    """Takes bytes off the end of a file."""
    path.write_bytes(path.read_bytes()[:-lost])


def create(directory, scenario=None):
    record = RunRecord.create(directory, scenario=scenario or small_scenario(), seed=5)
    record.begin()
    return record


def test_the_manifest_holds_seed_versions_and_method_and_the_scenario_its_own_file(run_small):
    run = run_small(seed=11)
    manifest = read_manifest(run)
    assert (manifest.scenario, manifest.seed) == (small_scenario(), 11)
    assert manifest.versions == versions()
    assert manifest.method == Method.of(small_scenario())
    raw = json.loads((run / "manifest.json").read_text())
    text = (run / "scenario.yaml").read_bytes()
    assert raw["scenario_sha256"] == hashlib.sha256(text).hexdigest()
    assert "scenario" not in raw


@pytest.mark.parametrize(
    ("key", "value"), [("schema", 3), ("seed", -1), ("versions", []), ("objective", 7)]
)
def test_a_damaged_manifest_is_reported(run_small, refused, key, value):
    run = run_small(population=4, iterations=1)
    manifest = run / "manifest.json"
    manifest.write_text(json.dumps(json.loads(manifest.read_text()) | {key: value}))
    with refused(manifest, key, ""):
        RunRecord.resume(run)
    cut(manifest, 50)
    with refused(manifest, "", "is not JSON"):
        RunRecord.resume(run)


@pytest.mark.parametrize("key", ["run", "seed", "versions", "objective", "optimizer"])
def test_a_changed_manifest_is_reported(run_small, refused, key):
    run = run_small(population=4, iterations=1)
    manifest = run / "manifest.json"
    content = json.loads(manifest.read_text())
    manifest.write_text(json.dumps(content | {"thinned": True}))
    assert read_manifest(run).thinned
    manifest.write_text(json.dumps(content | {key: other(content[key])}))
    with refused(manifest, "sha256", "changed"):
        read_manifest(run)


def test_a_changed_scenario_is_reported(run_small, refused):
    run = run_small(population=4, iterations=1)
    scenario = run / "scenario.yaml"
    scenario.write_text(scenario.read_text().replace("population: 4", "population: 3"))
    with refused(scenario, "", "manifest.json"):
        RunRecord.resume(run)


def test_a_run_is_not_resumed_with_a_scenario_that_adds_or_lacks_something(tmp_path, refused):
    plain, required = small_scenario(), small_scenario().with_changes({"require.clearance": "1 mm"})
    for ours, given, problem in ((plain, required, "has none"), (required, plain, "has")):
        run = tmp_path / problem
        with create(run, ours):
            pass
        with refused(run, "require.clearance", problem):
            RunRecord.resume(run, scenario=given)
        with RunRecord.resume(run, scenario=ours.with_changes({"name": "another"})):
            pass


def test_runs_are_resumed_where_one_is_and_begun_where_none_is(run_small, tmp_path, refused):
    for directory in (tmp_path, tmp_path / "none"):
        with refused(directory, "", "manifest.json"):
            RunRecord.resume(directory)
    assert not (tmp_path / "none").exists()
    run, notes = run_small(), tmp_path / "notes.txt"
    before = read_record(run)
    notes.write_text("mine")
    problems = {run: "--resume", tmp_path: "is not empty", notes: "is a file"}
    for directory, problem in problems.items() | {(notes / "run", "is a file")}:
        with refused(directory, "", problem):
            create(directory)
    assert read_record(run) == before


def test_what_a_kill_in_the_first_moment_leaves_is_an_empty_directory(tmp_path):
    leftover = tmp_path / f".manifest.{2**22 + 1}.abcd_123.json"  # of no process
    heights = tmp_path / "heights-0123456789abcdef.npy"
    for file in (tmp_path / ".lock", leftover, heights):
        file.touch()
    with create(tmp_path):
        pass
    assert not leftover.exists() and not heights.exists()


HOLDING = """
import sys
from pathlib import Path
from tetra_drake.evolution.run_record import RunRecord
with RunRecord.resume(Path(sys.argv[1])):
    print("open", flush=True)
    sys.stdin.read()
"""


def test_a_second_process_is_refused_until_the_first_ends(run_small):
    run = run_small(population=4, iterations=1)
    command = [sys.executable, "-c", HOLDING, str(run)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        assert other.stdout.readline() == b"open\n"
        with pytest.raises(InputError, match="another process is at work"):
            RunRecord.resume(run)
        other.kill()
    with RunRecord.resume(run):
        pass


@pytest.mark.parametrize("name", ["evaluations.jsonl", "iterations.jsonl"])
@pytest.mark.parametrize("lost", [1, 5000])
def test_a_torn_end_is_made_good(run_small, name, lost):
    run = run_small()
    whole = read_record(run)
    cut(run / "trial_01" / name, lost)
    run_small(resume=True)
    assert read_record(run) == whole


def with_line(number, change):
    """A function that changes a line of a file, given and returned as bytes."""

    def damage(content):
        lines = content.splitlines()
        lines[number - 1] = change(lines[number - 1])
        return b"\n".join(lines) + b"\n"

    return damage


def with_value(number, key, other):
    """The line as it would have been written with another value: its checksum is right."""

    def change(line):
        entry = json.loads(line)
        del entry["crc"]
        return json_line(entry | {key: other(entry[key])}).encode().strip()

    return with_line(number, change)


def with_one_more(content):
    entry = json.loads(content.splitlines()[-1])
    del entry["crc"]
    return content + json_line(entry | {"index": 42}).encode()


def other(value):
    """Another value of the same kind."""
    if isinstance(value, str):
        return value + "x"
    if isinstance(value, list):
        return [other(value[0]), *value[1:]]
    if isinstance(value, dict):
        return {key: other(number) for key, number in value.items()} or {"distance": 1.0}
    return 1 if value is None else value + 1


def with_changed(number, key):
    """A line with another value and the checksum that it had."""

    def change(line):
        entry = json.loads(line)
        return json.dumps(entry | {key: other(entry[key])}).encode()

    return with_line(number, change)


def test_no_value_that_was_changed_is_taken_over(run_small, refused):
    run = run_small(population=4, iterations=3, trials=1)
    whole = read_record(run)
    for path in sorted(run.glob("trial_00/*.jsonl")):
        content = path.read_bytes()
        lines = content.splitlines(keepends=True)
        for number in {1, len(lines)}:
            for key in json.loads(lines[number - 1]):
                path.write_bytes(with_changed(number, key)(content))
                with refused(path, f"line {number}", "checksum"):
                    run_small(resume=True)
                with refused(path, f"line {number}", ""):
                    load_run(run)
        # What the message says: cut there, the record is made good.
        path.write_bytes(b"".join(lines[: len(lines) // 2]))
        run_small(resume=True)
        assert read_record(run) == whole


# Lines of other runs and trials, lines that contradict each other


@pytest.mark.parametrize("name", ["evaluations", "iterations"])
def test_files_of_another_run_or_trial_are_refused(run_small, refused, name):
    run = run_small()
    path = run / "trial_00" / f"{name}.jsonl"
    lines = path.read_bytes().splitlines(keepends=True)
    strangers = {
        "run ": run_small("other", changes={"simulation.duration": "14 s"}) / "trial_00",
        "trial 1": run / "trial_01",
        "": run_small("longer", oscillators=5) / "trial_00",
    }
    for whose, folder in strangers.items():
        theirs = (folder / path.name).read_bytes().splitlines(keepends=True)
        for mixed, number in ((theirs, 1), ([*lines[:8], theirs[8], *lines[9:]], 9)):
            path.write_bytes(b"".join(mixed))
            for read in (lambda: load_run(run), lambda: run_small(resume=True)):
                with refused(path, f"line {number}", whose):
                    read()


@pytest.mark.parametrize(
    ("name", "number", "problem", "damage"),
    [
        ("evaluations", 3, "checksum", with_line(3, lambda _: b"{nonsense")),
        ("evaluations", 7, "index", with_value(7, "index", lambda index: index + 1)),
        ("evaluations", 7, "genome", with_value(7, "genome", lambda genome: genome[:20])),
        *(
            ("iterations", 5, key, with_value(5, key, lambda value: value + 1))
            for key in ("evaluations", "best_fitness", "best_evaluation")
        ),
        # What only a search that is repeated can tell
        ("evaluations", 20, "genome", with_value(20, "genome", lambda _: [2.0] * 26)),
        ("evaluations", 20, "placed", with_value(20, "placed", lambda _: 7)),
        ("evaluations", 43, "ends before", with_one_more),
    ],
)
def test_a_damaged_or_contradicting_line_is_reported(
    run_small, refused, name, number, problem, damage
):
    run = run_small(trials=1)
    path = run / "trial_00" / f"{name}.jsonl"
    path.write_bytes(damage(path.read_bytes()))
    with refused(path, f"line {number}", problem):
        run_small(resume=True)
    if number < 20:
        with refused(path, f"line {number}", problem):
            load_run(run)


def test_a_line_without_a_checksum_is_refused(run_small, refused):
    run = run_small(trials=1)
    path = run / "trial_00" / "evaluations.jsonl"
    path.write_text(re.sub(', "crc": "\\w+"', "", path.read_text()))
    with refused(path, "line 1", "checksum"):
        load_run(run)


def without(number, key):
    """The line as it would have been written without a key."""

    def change(line):
        entry = json.loads(line)
        del entry["crc"], entry[key]
        return json_line(entry).encode().strip()

    return with_line(number, change)


@pytest.mark.parametrize("name", ["evaluations", "iterations"])
def test_a_line_that_lacks_a_key_or_has_another_type_is_refused(run_small, refused, name):
    run = run_small(trials=1)
    path = run / "trial_00" / f"{name}.jsonl"
    content = path.read_bytes()
    for key in json.loads(content.splitlines()[4]).keys() - {"crc", "placed", "mean_fitness"}:
        for damage in (without(5, key), with_value(5, key, lambda _: {"distance": []})):
            path.write_bytes(damage(content))
            for read in (lambda: load_run(run), lambda: run_small(resume=True)):
                with refused(path, "line 5", key):
                    read()


def test_a_line_that_is_there_twice_is_refused(run_small, refused):
    run = load_run(run_small(trials=1))
    judged = {"trial": 0, "index": 3, "kept": 1.0, "mean_distance": 0.2}
    entry = run.file("evaluations.jsonl", 0).read()[3]
    for name, trial, line in (("elites.jsonl", None, judged), ("reevaluations.jsonl", 0, entry)):
        file = run.file(name, trial)
        file.append([line, line])
        with refused(file.path, "line 2", "index"):
            file.read()


def test_nothing_is_written_before_the_first_line(run_small, tmp_path):
    def interrupt(task):
        raise InterruptedError

    with pytest.raises(InterruptedError):
        run_small("runs/new", evaluate=interrupt)
    assert list(tmp_path.iterdir()) == []


def test_a_run_is_replaced_when_the_first_line_of_the_new_one_is_written(run_small, tmp_path):
    run = run_small()
    (run / "report.html").touch()
    before = read_record(run)
    with RunRecord.create(run, scenario=small_scenario(), seed=6, overwrite=True) as record:
        trial = TrialRecord(record, 0)
        assert trial.recall(0, np.zeros(26)) is None
        assert read_record(run) == before
        trial.keep(Task(np.ones(26)), Evaluation(1.0))
    assert sorted(read_record(run)) == [
        *(".lock", "manifest.json", "scenario.yaml", "trial_00/in_progress.jsonl")
    ]
    assert read_manifest(run).seed == 6


def test_a_run_stays_if_that_which_replaces_it_cannot_begin(run_small, monkeypatch, refused):
    run = run_small()
    before = read_record(run)

    def fail(*_):
        raise InputError(run, "", "disk full")

    monkeypatch.setattr("tetra_drake.evolution.run_record.write_manifest", fail)
    with RunRecord.create(run, scenario=small_scenario(), seed=6, overwrite=True) as record:
        with refused(run, "", "disk full"):
            record.begin()
        assert read_record(run) == before
    with RunRecord.resume(run):
        pass


def test_what_is_in_progress_is_recalled_but_never_for_another_genome(tmp_path, refused):
    genome = np.linspace(1.0, 2.0, 26)
    failed = Evaluation(-math.inf, {}, "why", 1.25)
    path = tmp_path / "trial_00" / "in_progress.jsonl"
    with create(tmp_path) as run:
        TrialRecord(run, 0).keep(Task(genome, index=3, iteration=1), failed)
        with path.open("a") as file:
            file.write('{"index": 4, "torn')
        record = TrialRecord(run, 0)
        assert record.recall(3, genome) == failed
        assert record.recall(4, genome) is None
        with refused(path, "line 1", "genome"):
            record.recall(3, genome + 1.0)
