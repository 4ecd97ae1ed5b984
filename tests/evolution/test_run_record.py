"""Run directories: what is refused, repaired and reported, and how runs are resumed."""

import json
import shutil

import numpy as np
import pytest
from helpers.analytic import read_record, small_scenario

from tetra_drake.errors import InputError
from tetra_drake.evolution.entries import EliteLine, EvaluationLine, json_line
from tetra_drake.evolution.manifest import RunRecord, read_manifest
from tetra_drake.evolution.run import load_run
from tetra_drake.evolution.trials import RepeatedFile
from tetra_drake.optimizers.base import Evaluation, Task


def create(directory, **options):
    record = RunRecord.create(directory, scenario=small_scenario(), seed=5, **options)
    record.begin()
    return record


def test_the_manifest_holds_seed_versions_and_method_and_proves_the_scenario(tmp_path, refused):
    with create(tmp_path) as run:
        assert read_manifest(tmp_path) == run.manifest
    assert (run.manifest.scenario, run.manifest.seed) == (small_scenario(), 5)
    scenario = tmp_path / "scenario.yaml"
    scenario.write_text(scenario.read_text().replace("population: 12", "population: 3"))
    with refused(scenario, "", "manifest.json"):
        RunRecord.resume(tmp_path)


CHANGED = {"run": "x", "seed": 6, "versions": {}, "objective": "x", "optimizer": "CmaEs"}


NAMED = [("schema", 3, "schema"), ("seed", -1, "seed"), ("versions", [], "versions")]
NAMED += [(key, value, "sha256") for key, value in CHANGED.items()]


@pytest.mark.parametrize(("key", "value", "named"), NAMED)
def test_a_damaged_or_changed_manifest_is_reported(tmp_path, refused, key, value, named):
    with create(tmp_path):
        pass
    manifest = tmp_path / "manifest.json"
    manifest.write_text(json.dumps(json.loads(manifest.read_text()) | {key: value}))
    with refused(manifest, named):
        RunRecord.resume(tmp_path)


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
    with RunRecord.resume(run, scenario=small_scenario().with_changes({"name": "another"})):
        pass
    assert read_record(run) == before


def test_what_a_kill_in_the_first_moment_leaves_is_an_empty_directory(tmp_path):
    leftover = tmp_path / f".manifest.{2**22 + 1}.abcd_123.json"  # of no process
    heights = tmp_path / "heights-0123456789abcdef.npy"
    for file in (tmp_path / ".lock", leftover, heights):
        file.touch()
    with create(tmp_path):
        pass
    assert not leftover.exists() and not heights.exists()


@pytest.mark.parametrize(("name", "lost"), [("evaluations", 1), ("iterations", 1500)])
def test_a_torn_end_is_made_good(run_small, name, lost):
    run = run_small()
    whole = read_record(run)
    path = run / "trial_01" / f"{name}.jsonl"
    path.write_bytes(path.read_bytes()[:-lost])
    run_small(resume=True)
    assert read_record(run) == whole


def holding(**changes):
    """A damage: the line with other values, and with a checksum that fits them."""

    def change(line):
        entry = json.loads(line)
        del entry["crc"]
        return json_line(entry | changes).encode()

    return change


DAMAGES = [
    ("evaluations", 4, lambda line: line.replace(b'"index": 3', b'"index": 4'), "checksum"),
    ("evaluations", 4, lambda line: line.partition(b', "crc"')[0] + b"}\n", "checksum"),
    ("iterations", 9, holding(run="another"), "run another"),
    ("evaluations", 7, holding(index=7), "index"),
    ("evaluations", 7, holding(genome=[2.0] * 20), "genome"),
    ("evaluations", 7, holding(metrics={"distance": []}), "metrics"),
    ("iterations", 5, holding(best_evaluation=41), "best_evaluation"),
    # What only a search that is repeated can tell
    ("evaluations", 20, holding(genome=[2.0] * 26), "genome"),
    ("evaluations", 20, holding(placed=7), "placed"),
]


@pytest.mark.parametrize(("name", "number", "damage", "problem"), DAMAGES)
def test_a_damaged_line_is_named(run_small, refused, name, number, damage, problem):
    run = run_small(trials=1)
    path = run / "trial_00" / f"{name}.jsonl"
    lines = path.read_bytes().splitlines(keepends=True)
    lines[number - 1] = damage(lines[number - 1])
    path.write_bytes(b"".join(lines))
    with refused(path, f"line {number}", problem):
        run_small(resume=True)
    if number < 20:
        with refused(path, f"line {number}", problem):
            load_run(run)


def test_a_line_too_many_or_there_twice_is_refused(run_small, refused):
    run = load_run(run_small(trials=1))
    judged = EliteLine(trial=0, index=3, kept=1.0, mean_distance=0.2)
    entry = list(run.file("evaluations.jsonl", 0).read())[3]
    for name, trial, line in (("elites.jsonl", None, judged), ("reevaluations.jsonl", 0, entry)):
        file = run.file(name, trial)
        file.append([line, line])
        with refused(file.path, "line 2", "index"):
            list(file.read())
    file = run.file("evaluations.jsonl", 0)
    file.append([entry.model_copy(update={"index": 42})])
    with refused(file.path, "line 43", "ends before"):
        run_small(resume=True)


def test_a_run_is_replaced_when_a_new_one_has_its_first_line(
    run_small, tmp_path, monkeypatch, refused
):
    run = run_small()
    (run / "report.html").touch()
    before, killed = read_record(run), tmp_path / "killed"

    def fail(*_):
        shutil.copytree(run, killed)  # as a kill would leave it
        raise InputError(run, "", "disk full")

    with RunRecord.create(run, scenario=small_scenario(), seed=6, overwrite=True) as record:
        file = RepeatedFile(record, 0, "in_progress.jsonl")
        assert file.lines == []
        with monkeypatch.context() as broken, refused(run, "", "disk full"):
            broken.setattr("tetra_drake.evolution.manifest.write_manifest", fail)
            record.begin()
        with RunRecord.resume(killed):
            assert read_record(killed) == read_record(run) == before
        file.write([EvaluationLine.of(Task(np.ones(26)), Evaluation(1.0))], first=0)
    files = {".lock", "manifest.json", "scenario.yaml", "trial_00/in_progress.jsonl"}
    assert read_record(run).keys() == files
    assert read_manifest(run).seed == 6
    with RunRecord.resume(run), refused(run, "", "at work"):
        create(run, overwrite=True)
    (run / "manifest.json").unlink()
    with refused(run, "", "holds no manifest.json"):
        create(run, overwrite=True)
