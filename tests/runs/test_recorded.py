"""The recorded runs: their best gaits walk as recorded, and the pages show their numbers."""

from pathlib import Path

import pytest
import tables

from tetra_drake.engines.simulate import simulate
from tetra_drake.results.result import versions
from tetra_drake.robot.gait import load_gait

TOLERANCE = 0.05
"""in; versions of Drake, numpy and numba differ in the last digits, which a walk enlarges."""

if not (tables.HERE / "thesis").exists():  # as in a source distribution
    pytest.skip("the recorded runs are not here", allow_module_level=True)


@pytest.fixture(scope="module")
def recorded():
    return tables.load_all()


@pytest.mark.parametrize("page", tables.PAGES, ids=lambda page: f"{page.parent.name}-{page.stem}")
def test_the_tables_of_the_pages_are_those_of_the_recorded_runs(recorded, page):
    text = Path(page).read_text(encoding="utf-8")
    assert tables.filled(text, lambda name: tables.TABLES[name](recorded)) == text


@pytest.mark.parametrize("number", range(len(tables.RUNS)), ids=tables.RUNS)
def test_the_best_gait_walks_as_recorded(recorded, number):
    run = recorded[number]
    trial = run.best_trial
    gait = load_gait(tables.HERE / run.name / f"trial_{trial:02d}/best_gait.json", run.scenario)
    distance = simulate(scenario=run.scenario, gait=gait).metrics.distance_in
    same = run.record.manifest.versions == versions()
    tolerance = 0.0 if same else TOLERANCE
    assert distance == pytest.approx(run.trials.loc[trial, "distance_in"], rel=0, abs=tolerance)
