"""Making recorded runs: what is done is kept, and what is written can be read."""

from unittest.mock import Mock

import pytest
import record
from analyse import ANALYSIS
from helpers.brief import BRIEF

from tetra_drake.evolution.run import load_run
from tetra_drake.lab.elites.elites import elites
from tetra_drake.scenario.optimizer_kinds import QualityDiversity

MAP = QualityDiversity(cells=[2, 2], draws=1)
FEW = {"robot.tetrahedra": 2, "optimizer": MAP, "evolution.trials": 2, "evolution.evaluations": 8}
TINY = record.Experiment("two tetrahedra", "thesis", BRIEF | FEW, film=True)


def analyse(directory, *, workers):
    """An analysis that takes no time."""
    (directory / ANALYSIS).write_text("{}")


def take_pictures(page, *pictures):
    for picture in pictures:
        picture.touch()


@pytest.mark.slow
def test_an_experiment_becomes_a_thinned_run_and_is_made_once(tmp_path, monkeypatch):
    analysed = Mock(side_effect=analyse)
    monkeypatch.setattr(record, "analyse", analysed)
    monkeypatch.setattr(record, "take_pictures", take_pictures)
    scratch, out = tmp_path / "scratch", tmp_path / "runs"
    (out / "tiny/trial_07").mkdir(parents=True)  # of an older run
    kept = {"README.md", "map.png", "readings.json"}
    for name in kept:
        (out / "tiny" / name).write_text("of an older run")
    record.record("tiny", TINY, scratch=scratch, out=out)
    run = load_run(out / "tiny")
    assert run.manifest.thinned and run.manifest.scenario == TINY.scenario("tiny")
    assert run.evaluations.groupby("trial").size().tolist() == [8, 8]
    assert elites(run)["kept"].notna().all()
    made = {"manifest.json", "scenario.yaml", "trial_00", "trial_01", "elites.jsonl.xz"}
    shown = {"walking.png", "walking.gif", "gait.svg", "analysis.json"}
    assert {file.name for file in (out / "tiny").iterdir()} == kept | made | shown
    (out / "tiny" / ANALYSIS).unlink()  # as if interrupted
    record.record("tiny", TINY, scratch=scratch, out=out)
    assert load_run(out / "tiny").evaluations.equals(run.evaluations)
    assert [call.args for call in analysed.call_args_list] == [(scratch / "tiny",)]
