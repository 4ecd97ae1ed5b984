"""The recorded runs, whatever there are: their gaits walk as recorded, their pages are whole."""

import itertools
import json
import lzma
import subprocess

import numpy as np
import pytest
import record
import tables
from analyse import load_analysis

from tetra_drake.engines.simulate import simulate
from tetra_drake.evolution.manifest import read_manifest
from tetra_drake.machine import versions
from tetra_drake.optimizers import optimizer_of
from tetra_drake.report.result_folder import REPLAY
from tetra_drake.robot.gait import ParameterSpace, load_gait
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.units import INCH

TOLERANCE = 0.05
"""in; processors and versions of packages differ in the last digits, which a walk enlarges."""

FOLDERS = [name for name in record.EXPERIMENTS if (tables.HERE / name / "manifest.json").exists()]
"""Runs of one's own may lie beside them."""

if not FOLDERS:  # as in a source distribution
    pytest.skip("the recorded runs are not here", allow_module_level=True)


def files_in_git():
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=tables.HERE, capture_output=True)
    return [tables.HERE / name for name in listed.stdout.decode().split("\0") if name]


def test_every_experiment_is_recorded():
    folders = {file.parent.name for file in files_in_git() if file.name == "manifest.json"}
    assert folders <= set(FOLDERS) == set(record.EXPERIMENTS)


@pytest.mark.parametrize("name", FOLDERS)
def test_the_best_gaits_walk_as_recorded(name):
    """On the compiled engine, undisturbed, which is what analyse.py recorded, too."""
    folder = tables.HERE / name
    analysis, scenario = load_analysis(folder), load_scenario(folder / "scenario.yaml")
    scenario = scenario.with_changes({"engine": "!Compiled"})
    tolerance = 0.0 if analysis.versions == versions() else TOLERANCE
    recorded = analysis.disturbed["undisturbed"] / INCH
    assert len(recorded) == scenario.evolution.trials
    for trial, distance in recorded.items():
        gait = load_gait(folder / f"trial_{trial:02d}/best_gait.json", scenario)
        walked = simulate(scenario=scenario, gait=gait).metrics.distance_in
        assert walked == pytest.approx(distance, rel=0, abs=tolerance), f"trial {trial}"


@pytest.mark.parametrize("name", FOLDERS)
def test_a_run_begins_as_its_scenario_and_seed_say(name):
    folder = tables.HERE / name
    manifest = read_manifest(folder)
    scenario, seeds = manifest.scenario, np.random.SeedSequence(manifest.seed)
    seed = seeds.spawn(scenario.evolution.trials)[0]
    space, generator = ParameterSpace.of(scenario), np.random.default_rng(seed)
    asked = optimizer_of(scenario.optimizer)(space, scenario.evolution, generator).ask()
    with lzma.open(folder / "trial_00/evaluations.jsonl.xz", "rt") as lines:
        recorded = [json.loads(line)["genome"] for line in itertools.islice(lines, len(asked))]
    assert np.array_equal(asked, recorded)


def test_the_pages_show_the_recorded_runs():
    runs = tables.load_all()
    assert set(runs) == set(FOLDERS)
    for page in tables.pages(runs):
        assert tables.made_again(page, runs) == page.read_text(encoding="utf-8"), page


@pytest.mark.parametrize("name", FOLDERS)
def test_a_run_has_its_page_replay_and_picture(name):
    folder = tables.HERE / name
    text = (folder / tables.README).read_text(encoding="utf-8")
    assert "<!-- to be written -->" not in text
    assert ("The engines differ by more" in text) == ("## Why the engines differ" in text)
    assert (folder / REPLAY).exists() and (folder / record.PICTURE).exists()
    assert (tables.HERE / record.VIEWER).exists()


def test_the_folder_is_small():
    assert sum(file.stat().st_size for file in files_in_git() if file.exists()) < 25_000_000
