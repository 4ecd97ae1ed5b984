"""The recorded runs, whatever there are: their gaits walk as recorded, their pages are whole."""

import subprocess
from functools import cache

import numpy as np
import pytest
import record
import tables

from tetra_drake.engines.simulate import simulate
from tetra_drake.evolution.optimizers import optimizer_of
from tetra_drake.results.folder import REPLAY
from tetra_drake.results.result import versions
from tetra_drake.robot.gait import ParameterSpace, load_gait

TOLERANCE = 0.05
"""in; processors and versions of packages differ in the last digits, which a walk enlarges."""

LARGEST = 20_000_000
"""Bytes, of all files that git has in the folder."""

FOLDERS = [name for name in record.EXPERIMENTS if (tables.HERE / name / "manifest.json").exists()]
"""Runs of one's own may lie beside them."""

if not FOLDERS:  # as in a source distribution
    pytest.skip("the recorded runs are not here", allow_module_level=True)


@cache
def runs():
    return tables.load_all()


def files_in_git():
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=tables.HERE, capture_output=True)
    return [tables.HERE / name for name in listed.stdout.decode().split("\0") if name]


def test_every_experiment_is_recorded():
    folders = {file.parent.name for file in files_in_git() if file.name == "manifest.json"}
    assert folders <= set(FOLDERS) == set(runs()) == set(record.EXPERIMENTS)


@pytest.mark.parametrize("name", FOLDERS)
def test_the_best_gait_walks_as_recorded(name):
    """On the compiled engine, undisturbed, which is what analyse.py recorded, too."""
    run = runs()[name]
    trial = run.best_trial
    gait = load_gait(tables.HERE / name / f"trial_{trial:02d}/best_gait.json", run.scenario)
    scenario = run.scenario.with_changes({"simulation.engine": "compiled"})
    distance = simulate(scenario=scenario, gait=gait).metrics.distance_in
    tolerance = 0.0 if run.analysis.versions == versions() else TOLERANCE
    assert distance == pytest.approx(run.undisturbed(trial), rel=0, abs=tolerance)


@pytest.mark.parametrize("name", FOLDERS)
def test_a_run_begins_as_its_scenario_and_seed_say(name):
    run, scenario = runs()[name].record, runs()[name].scenario
    seeds = np.random.SeedSequence(run.manifest.seed).spawn(scenario.evolution.trials)
    space, generator = ParameterSpace.of(scenario), np.random.default_rng(seeds[0])
    asked = optimizer_of(scenario.optimizer)(space, scenario.evolution, generator).ask()
    assert np.array_equal(asked, [run.vector(0, i) for i in range(len(asked))])


@pytest.mark.parametrize("name", FOLDERS)
def test_a_run_has_its_pages(name):
    folder = tables.HERE / name
    text = (folder / tables.README).read_text(encoding="utf-8")
    assert tables.made_again(folder / tables.README, runs()) == text
    assert "<!-- to be written -->" not in text
    assert ("The engines differ by more" in text) == ("## Why the engines differ" in text)
    assert (folder / REPLAY).exists() and (folder / record.PICTURE).exists()
    assert (tables.HERE / record.VIEWER).exists()


@pytest.mark.parametrize("page", tables.pages({})[:2], ids=("README", "runs"))
def test_the_tables_of_the_pages_are_those_of_the_recorded_runs(page):
    assert tables.made_again(page, runs()) == page.read_text(encoding="utf-8")


def test_the_folder_is_small():
    assert sum(file.stat().st_size for file in files_in_git() if file.exists()) < LARGEST
