"""Gaits for commands: from a file or a run, with the scenario that they are simulated on."""

import shutil
from pathlib import Path

import pytest
from helpers.synthetic_run import tiny_scenario, write_run

from tetra_drake.evolution.run import load_run, load_source
from tetra_drake.robot.gait_file import given_gait, save_gait
from tetra_drake.scenario.load import dump_scenario


@pytest.fixture
def run(tmp_path):
    """A run of two trials, the second with the best gait, which is saved in its folder."""
    path = write_run(tmp_path / "run", [[[(2.0, 0)]], [[(4.0, 0), (3.0, 1)]]])
    save_gait(load_run(path).best_gait(), path / "trial_01" / "best_gait.json", tiny_scenario())
    return path


def test_the_gaits_of_a_run_and_files_in_it_come_with_its_scenario(run):
    recorded, source, told = load_run(run), load_source(run), []
    assert source.scenario == recorded.scenario
    assert source.best == recorded.gait(1, 0)
    assert source.gaits == {"trial 0": recorded.gait(0, 0), "trial 1": recorded.gait(1, 0)}
    source = load_source(run / "trial_01" / "best_gait.json", warn=told.append)
    assert (source.scenario.name, source.best) == ("tiny", recorded.best_gait())
    assert source.gaits == {"best_gait": source.best}
    assert told == []
    assert given_gait(run, source.scenario) == given_gait(str(run), source.scenario) == source.best


def test_another_scenario_than_the_gaits_is_said_once_with_both_names(run, tmp_path):
    other = tmp_path / "other.yaml"
    other.write_text(dump_scenario(tiny_scenario(name="other")))
    file, told = run / "trial_01" / "best_gait.json", []
    copied = Path(shutil.copy(file, tmp_path / "copied.json"))
    for source in (file, run, copied):
        assert load_source(source, scenario=str(other), warn=told.append).scenario.name == "other"
    assert len(told) == 3
    assert all("tiny" in text and "other" in text for text in told)
