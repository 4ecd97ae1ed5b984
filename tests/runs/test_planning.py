"""The script of the planned rover: it continues after an interruption, and writes its page."""

import json
import shutil
from collections import Counter

import numpy as np
import planning
import pytest

from tetra_drake.robot.command import Command


def test_an_interrupted_script_runs_what_is_left_and_writes_its_page(tmp_path, monkeypatch):
    short = {"samples": 4, "horizon": 0.5, "knots": 2}
    monkeypatch.setattr(planning, "PLANNING", planning.PLANNING | short)
    ways = [
        planning.Way([(0.0, 0.0)], planning.EPISODES["courses"]["slalom"]["pillars"]),
        planning.Way([(3.0, 0.0)]),
    ]
    groups, episodes = ("courses", "goals, MuJoCo"), []
    for group, way in zip(groups, ways, strict=True):
        episodes.append(planning.Episode(group, "a", lambda way=way: way, most=0.2))
    planning.run_all(episodes[:1], tmp_path)
    records = tmp_path / planning.RECORDS
    first = records.read_text()
    records.write_text(first + first[:20])  # a line that was cut off
    planning.run_all(episodes, tmp_path)
    assert records.read_text().startswith(first) and len(records.read_text().splitlines()) == 2
    done, late = map(json.loads, records.read_text().splitlines())
    assert done["is_done"] and done["time"] == pytest.approx(0.1) and not late["is_done"]
    held = Command("held", 0.1, np.linspace(0.1, 0.3, 24)[np.newaxis])  # lengths in m
    name = "row, up 20 degrees, friction 0.8, from a gait, compiled"
    options = {"most": 0.2, "make_command": lambda: held, "planning": {"noise": 1e-9}}
    planning.run_all([planning.Episode("others", name, planning.Ahead, **options)], tmp_path)
    record = planning.load_records(tmp_path)["others", name]
    assert abs(record["command_speed"]) > 1e-3
    assert record["command_speed"] == pytest.approx(record["relative_speed"], rel=0.02)
    planning.write_page(tmp_path, dict.fromkeys(planning.GROUPS, 10))
    assert "1 of 10 (courses)" in (tmp_path / "README.md").read_text()
    nodes = np.array([[0.5, 0.0, 0.0], [-0.5, 0.0, 0.0]])
    assert planning.clearance(nodes, [(2.0, 0.0), (0.0, 5.0)]) == pytest.approx(1.4)


def test_the_page_is_made_from_the_records(tmp_path):
    shutil.copy(planning.HERE / planning.RECORDS, tmp_path)
    planning.write_page(tmp_path, Counter(each.group for each in planning.all_episodes()))
    made, recorded = (folder / "README.md" for folder in (tmp_path, planning.HERE))
    assert made.read_text("utf-8") == recorded.read_text("utf-8")
