"""Making recorded runs: what is done is kept, and what is written can be read."""

import shutil

import pandas
import pytest
import record
from analyse import ANALYSIS
from helpers.brief import BRIEF

from tetra_drake.evolution.run import load_run
from tetra_drake.lab.elites.elites import elites
from tetra_drake.scenario.optimizer_kinds import QualityDiversity

MAP = QualityDiversity(cells=[2, 2], draws=1)
FEW = {"robot.tetrahedra": 2, "optimizer": MAP, "evolution.trials": 2, "evolution.evaluations": 8}
GENERATIONS = {"optimizer": {"population": 4, "tournament": 2}}
TINY = record.Experiment("two tetrahedra", "thesis", BRIEF | FEW, film=True)


@pytest.fixture
def analysed(monkeypatch):
    """An analysis and pictures that take no time; the folders that were analysed."""
    analysed = []

    def analyse(directory, *, workers):
        analysed.append(directory)
        (directory / ANALYSIS).write_text("{}")

    monkeypatch.setattr(record, "analyse", analyse)

    def take_pictures(page, *pictures):
        for picture in pictures:
            picture.touch()

    monkeypatch.setattr(record, "take_pictures", take_pictures)
    return analysed


@pytest.mark.slow
def test_an_experiment_becomes_a_thinned_run_and_is_made_once(tmp_path, analysed):
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
    assert analysed == [scratch / "tiny"]


@pytest.mark.slow
def test_an_experiment_goes_on_from_an_unfinished_record(tmp_path, analysed):
    experiment = record.Experiment("two tetrahedra", "thesis", BRIEF | FEW | GENERATIONS)
    whole, again, out = (tmp_path / name for name in ("whole", "again", "out"))
    record.record("tiny", experiment, scratch=whole, out=tmp_path / "finished")
    shutil.copytree(whole / "tiny", out / "tiny")
    for name, lines in (("evaluations", 6), ("iterations", 2)):  # the first of two generations
        file = out / f"tiny/trial_00/{name}.jsonl"
        file.write_text("".join(file.read_text().splitlines(keepends=True)[:lines]))
    record.record("tiny", experiment, scratch=again, out=out)
    assert load_run(out / "tiny").manifest.thinned and analysed == [whole / "tiny", again / "tiny"]
    runs = [load_run(folder / "tiny").evaluations for folder in (whole, again)]
    first, second = (evaluations.drop(columns="wall_time_s") for evaluations in runs)
    pandas.testing.assert_frame_equal(first, second, check_exact=True)
