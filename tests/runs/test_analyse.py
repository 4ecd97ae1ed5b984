"""What analyse.py simulates of a run's best gaits."""

import functools

import analyse
import pytest
from helpers.synthetic_run import tiny_scenario, write_run

from tetra_drake.engines.simulate import simulate
from tetra_drake.evolution.run import load_run
from tetra_drake.scenario.load import load_scenario

TRIALS = [[[(1.0, 0), (2.0, 1)], [(5.0, 0)]], [[(None, 0)]], [[(3.0, 0), (2.5, 1)]]]
"""Trial 1 has no gait with a fitness."""

METRICS = {"relative_speed": 0.1, "cost_of_transport": 4.0, "tension": 1.0, "clearance": 0.02}
"""Of the best gaits."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """An analysed run of a robot of three tetrahedra."""
    scenario = tiny_scenario().with_changes({"engine": "!Compiled"})
    metrics = {5.0: METRICS, 3.0: METRICS}
    path = tmp_path_factory.mktemp("runs") / "thesis"
    run = write_run(path, TRIALS, scenario=scenario, metrics=metrics)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(analyse, "robustness", functools.partial(analyse.robustness, draws=8))
        analyse.analyse(run, workers=1)
    return run


def distances(run, scenario):
    gaits = run.gait(0, 2), run.gait(2, 0)
    return [simulate(scenario=scenario, gait=gait).metrics.distance_in for gait in gaits]


def test_the_best_gait_of_each_trial_is_analysed(folder):
    analysis = analyse.load_analysis(folder)
    counts = {"evaluation": [2, 0], "evaluations": [3, 2], "fitness": [5.0, 3.0]}
    metrics = {name: [value, value] for name, value in METRICS.items()}
    best = analysis.best_gaits
    assert best[[*counts, *metrics]].to_dict("list") == counts | metrics
    assert best[analyse.TURNED].isna().all(), "the objective is about distance"
    assert best.index.tolist() == [0, 2] and analysis.best_trial == 0


def test_they_are_simulated_on_other_engines(folder):
    run, again = load_run(folder), analyse.load_analysis(folder).resimulations
    settings = analyse.settings_of(run.scenario)
    engines = {name: changed.engine_name for name, changed in settings.items()}
    assert engines == {analyse.TIGHT: "drake", analyse.MUJOCO: "mujoco"}
    by_setting = again.groupby("setting")["distance_in"].apply(list)
    assert by_setting[analyse.TIGHT] == distances(run, settings[analyse.TIGHT])
    assert by_setting[analyse.MUJOCO] == distances(run, settings[analyse.MUJOCO])
    assert set(analyse.settings_of(load_scenario("rough"))) == {analyse.TIGHT}


def test_sensitivity_is_of_each_gait_and_grows_with_the_displacement(folder, monkeypatch):
    run, recorded = load_run(folder), analyse.load_analysis(folder).best_gaits["sensitivity_in"]
    gaits = [run.gait(0, 2), run.gait(2, 0)]
    for gait, sensitivity in zip(gaits, recorded, strict=True):
        assert [sensitivity] == analyse.sensitivity(run.scenario, [gait], workers=1)
        assert 1e-10 < sensitivity < 1e-6, "1 nm in 0.3 s"
    monkeypatch.setattr(analyse, "DISPLACEMENT", 1e-6)
    further = analyse.sensitivity(run.scenario, gaits, workers=1)
    assert all(100.0 < a / b < 10_000.0 for a, b in zip(further, recorded, strict=True))
