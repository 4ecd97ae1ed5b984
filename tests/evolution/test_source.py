"""Gaits for commands: from a file or a run, with the scenario that they are simulated on."""

import shutil
import sys
from pathlib import Path

import pytest
import yaml
from helpers.brief import BRIEF
from helpers.synthetic_run import tiny_scenario, write_run

import tetra_drake as td
from tetra_drake.cli import main
from tetra_drake.evolution.run import load_run, load_source
from tetra_drake.robot.gait_file import given_gait, save_gait
from tetra_drake.scenario.load import dump_scenario
from tetra_drake.scenario.policy_kinds import imported_function

PROGRAMS = yaml.safe_load(Path(__file__).with_name("program.yaml").read_text("utf-8"))


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


@pytest.fixture(scope="module")
def foreign_run(tmp_path_factory):
    """A run whose policy is in a module beside it."""
    folder = tmp_path_factory.mktemp("foreign")
    (folder / "wave.py").write_text(PROGRAMS["policy"])
    policy = {"policy": "!Python {function: 'wave:wave', count: 1}"}
    scenario = td.load_scenario("prism").with_changes(BRIEF | policy)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(folder)
        td.evolve(scenario, folder / "run", workers=1, progress=False, report=False)
    return folder / "run"


COMMANDS = ["figures run --out out", "replay run --out page.html"]
COMMANDS += ["replay run/trial_00/best_gait.json --out page.html"]
COMMANDS += ["evolve --resume --out run --workers 1"]


@pytest.mark.parametrize("command", COMMANDS)
def test_commands_name_the_code_of_a_run_before_they_import_it(
    command, foreign_run, tmp_path, monkeypatch, caplog
):
    shutil.copytree(foreign_run, tmp_path / "run")
    monkeypatch.syspath_prepend(foreign_run.parent)
    monkeypatch.chdir(tmp_path)
    monkeypatch.delitem(sys.modules, "wave", raising=False)
    imported_function.cache_clear()
    caplog.clear()
    assert main(command.split()) == 0
    first = caplog.messages.index("imported")
    assert any("wave:wave" in told for told in caplog.messages[:first])
