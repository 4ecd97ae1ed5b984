"""What is simulated of a run's best gaits, and the file it is kept in."""

import json
from concurrent.futures import ThreadPoolExecutor

import pytest
from helpers.synthetic_run import tiny_scenario, write_run

from tetra_drake.evolution.evaluation import GaitEvaluation
from tetra_drake.evolution.tables import load_run
from tetra_drake.experiment import analysis
from tetra_drake.experiment.analysis import ANALYSIS, analyse, best_of_trials, load_analysis
from tetra_drake.experiment.variations import DEFAULT, NOTHING, resimulations, variations
from tetra_drake.results.result import versions

TRIALS = [[[(1.0, 0), (2.0, 1)], [(5.0, 0)]], [[(None, 0)]], [[(3.0, 0), (2.5, 1)]]]
"""Trial 1 has no gait with a fitness."""


@pytest.fixture(scope="module")
def analysed(tmp_path_factory):
    """The directory of an analysed run of a robot of three tetrahedra."""
    scenario = tiny_scenario().with_changes({"simulation.engine": "compiled"})
    run = write_run(tmp_path_factory.mktemp("runs") / "thesis", TRIALS, scenario=scenario)
    analyse(run, workers=1, make_executor=ThreadPoolExecutor)
    return run


def test_the_best_gait_of_each_trial_is_simulated_as_the_run_does(analysed):
    run, best = load_run(analysed), load_analysis(analysed).best_gaits
    assert list(zip(best["trial"], best["evaluation"], strict=True)) == [(0, 2), (2, 0)]
    evaluate = GaitEvaluation(run.manifest.scenario)
    distances = [evaluate(gait.genome).distance_in for gait in best_of_trials(run)]
    assert best["distance_in"].tolist() == distances
    for _, gait in best.iterrows():
        assert list(gait["off_ground"]) == ["T1", "T2", "T3"]
        assert all(0.0 <= share <= 1.0 for share in gait["off_ground"].values())
        assert list(gait["frequencies_hz"]) == ["T1-T2", "T2-T3"]


def test_each_setting_is_simulated_on_the_diagram(analysed):
    run, again = load_run(analysed), load_analysis(analysed).resimulations
    settings = resimulations(run.manifest.scenario)
    assert list(again["setting"]) == [name for name in settings for _ in range(2)]
    assert again["failure"].isna().all()
    evaluate = GaitEvaluation(run.manifest.scenario.with_changes({"simulation.engine": "drake"}))
    distances = [evaluate(gait.genome).distance_in for gait in best_of_trials(run)]
    assert again[again["setting"] == DEFAULT]["distance_in"].tolist() == distances
    assert again["distance_in"].nunique() > len(distances)


def test_each_variation_is_simulated_on_the_compiled_engine(analysed):
    found = load_analysis(analysed)
    expected = list(variations(load_run(analysed).manifest.scenario))
    assert len(found.variations) == 2 * len(expected)
    unchanged = found.variations[found.variations["what"] == NOTHING]
    assert unchanged["distance_in"].tolist() == found.best_gaits["distance_in"].tolist()
    changed = found.variations[found.variations["what"] == "initial spacing"]
    assert not changed["distance_in"].isin(unchanged["distance_in"]).any()


def test_the_analysis_says_what_made_it(analysed):
    found = load_analysis(analysed)
    assert found.versions == versions()
    assert (found.oscillator_tau_a_s, found.oscillator_frequency_hz) == (
        0.3,
        pytest.approx(0.5305, abs=1e-3),
    )


def test_a_run_without_any_fitness_is_refused(tmp_path, refused):
    run = write_run(tmp_path / "run", [[[(None, 0)]]])
    with refused(run, "", "no gait of this run has a fitness yet"):
        analyse(run, workers=1, make_executor=ThreadPoolExecutor)
    assert not (run / ANALYSIS).exists()


def test_an_analysis_that_is_broken_off_leaves_nothing(tmp_path, monkeypatch):
    run = write_run(tmp_path / "run", [[[(1.0, 0)]]])
    before = sorted(run.rglob("*"))

    def break_off(scenario):
        raise KeyboardInterrupt

    monkeypatch.setattr(analysis, "variations", break_off)
    with pytest.raises(KeyboardInterrupt):
        analyse(run, workers=1, make_executor=ThreadPoolExecutor)
    assert sorted(run.rglob("*")) == before


@pytest.mark.parametrize(
    ("damage", "key", "problem"),
    [
        (lambda content: None, "", "tetra-drake analyse"),
        (lambda content: "{", "", "cannot be read"),
        (lambda content: [], "schema", "of schema 1"),
        (lambda content: content | {"schema": 2}, "schema", "of schema 1"),
        (lambda content: content | {"variations": [{"trial": 0}]}, "variations", "is damaged"),
        (lambda content: content | {"best_gaits": 7}, "best_gaits", "is damaged"),
        (lambda content: content | {"oscillator": {}}, "", "is damaged"),
    ],
    ids=["missing", "cut off", "no object", "other schema", "columns", "no table", "oscillator"],
)
def test_a_damaged_analysis_is_refused(analysed, tmp_path, refused, damage, key, problem):
    content = damage(json.loads((analysed / ANALYSIS).read_text()))
    if content is not None:
        text = content if isinstance(content, str) else json.dumps(content)
        (tmp_path / ANALYSIS).write_text(text)
    with refused(tmp_path / ANALYSIS, key, problem):
        load_analysis(tmp_path)
