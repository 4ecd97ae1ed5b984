"""The benchmark: budgets, entries from files, records that go on, and its page."""

import dataclasses
from pathlib import Path

import bench
import numpy as np
import pytest
import yaml

from tetra_drake.errors import InputError

SHORT = {"simulation.duration": "4 s"}
WALK = dataclasses.replace(bench.TASKS[0], changes=SHORT)
ENTRIES = yaml.safe_load(Path(__file__).with_name("entries.yaml").read_text("utf-8"))


def entry_of(folder, text):
    file = folder / "mine.py"
    file.write_text(text)
    return bench.Entry.of(file)


def test_an_entry_is_a_file_and_its_score_is_that_of_its_solution(tmp_path):
    entry = entry_of(tmp_path, ENTRIES["good"])
    assert entry.tasks == ["walk"] and entry.about == "The first of two random vectors"
    (record,) = bench.solved(entry, WALK, [3], episodes=2)
    duration = WALK.scenario.simulation.duration
    assert record["simulated_s"] == 2 * duration and record["seed"] == 3
    assert WALK.scored(np.array(record["parameters"])) == pytest.approx(record["score"], abs=1e-6)
    assert record["second"] == pytest.approx(record["score"], abs=0.1)  # in MuJoCo


@pytest.mark.parametrize(("text", "key"), ENTRIES["refused"])
def test_what_is_no_entry_is_refused(tmp_path, text, key):
    with pytest.raises(InputError) as caught:
        bench.solved(entry_of(tmp_path, text), WALK, [0], episodes=2)
    assert caught.value.key == key and "\n" not in str(caught.value)


def test_every_entry_of_the_folder_is_in_the_records():
    entries = {bench.Entry.of(file).name for file in bench.ENTRIES.glob("*.py")}
    assert entries <= {one["entry"] for one in bench.read(bench.HERE / bench.RECORDS)}


def test_a_gait_does_as_well_on_the_second_engine():
    """But a tenth, which may be by bristles, and on `roll`, where impacts are chaotic."""
    records = [one for one in bench.read(bench.HERE / bench.RECORDS) if "parameters" in one]
    twice = [one for one in records if "second" in one and one["task"] != "roll"]
    assert len(twice) > 30
    for one in twice:
        assert one["second"] == pytest.approx(one["score"], rel=0.1), (one["task"], one["entry"])
