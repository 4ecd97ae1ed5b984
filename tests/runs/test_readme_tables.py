"""The recorded runs, and the tables of the READMEs, which must be what the runs say."""

from pathlib import Path

import pytest

from tetra_drake.engines.simulate import simulate
from tetra_drake.evolution.record import MANIFEST
from tetra_drake.evolution.tables import load_run
from tetra_drake.experiment.recorded import RUNS, load_experiment
from tetra_drake.experiment.tables import filled
from tetra_drake.results.result import versions
from tetra_drake.robot.gait import load_gait

CHECKOUT = Path(__file__).parents[2]
RECORDED = CHECKOUT / "runs"
PRESENT = [name for name in RUNS if (RECORDED / name / MANIFEST).exists()]

pytestmark = pytest.mark.skipif(
    not PRESENT, reason="there are no recorded runs here, as in a source distribution"
)


@pytest.fixture(scope="module")
def experiment():
    return load_experiment(RECORDED)


@pytest.mark.parametrize("page", ["README.md", "runs/README.md"])
def test_the_tables_say_what_the_recorded_runs_say(experiment, page):
    path = CHECKOUT / page
    assert filled(path, experiment) == path.read_text(encoding="utf-8"), (
        f"make them anew with: tetra-drake tables runs --into {page}"
    )


@pytest.mark.parametrize("name", PRESENT)
def test_the_best_gait_walks_again_as_recorded(experiment, name):
    recorded = experiment[name]
    manifest = load_run(RECORDED / name).manifest
    if manifest.versions != versions():
        pytest.skip("the run was recorded with other versions, on which last digits depend")
    trial = recorded.best_trial.number
    path = RECORDED / name / f"trial_{trial:02d}" / "best_gait.json"
    gait = load_gait(path, manifest.scenario)
    result = simulate(scenario=manifest.scenario, gait=gait)
    assert result.metrics.distance_in == recorded.best.loc[trial, "distance_in"]
