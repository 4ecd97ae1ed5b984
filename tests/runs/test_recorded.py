"""The recorded runs, whatever there are: their gaits walk as recorded, their pages are whole."""

import itertools
import json
import lzma
import re
import subprocess

import gallery
import numpy as np
import pytest
import record
import tables
from analyse import ROUNDINGS, load_analysis
from helpers.recorded import recorded_run

from tetra_drake.engines.simulate import simulate
from tetra_drake.evolution.manifest import read_manifest
from tetra_drake.lab.study.robustness import DRAWS
from tetra_drake.optimizers import optimizer_of
from tetra_drake.report.result_folder import REPLAY
from tetra_drake.robot.gait_file import load_gait
from tetra_drake.robot.parameter_space import ParameterSpace
from tetra_drake.scenario.load import SCENARIO, dump_scenario, load_scenario
from tetra_drake.scenario.yaml_text import dump_yaml, parse_yaml
from tetra_drake.settings.units import INCH

DRAKE = "`!Drake {}`"
FOLDERS = [name for name in record.EXPERIMENTS if (tables.HERE / name / "manifest.json").exists()]
"""Runs of one's own may lie beside them."""


def some(*quick: str) -> list[object]:
    """All runs; they are slow tests but for these."""
    marks = {name: [] if name in quick else [pytest.mark.slow] for name in FOLDERS}
    return [pytest.param(name, marks=each) for name, each in marks.items()]


if not FOLDERS:  # as in a source distribution
    pytest.skip("the recorded runs are not here", allow_module_level=True)


@pytest.fixture(scope="module")
def runs():
    """All recorded runs by their names, as the pages need them."""
    return tables.load_all()


def files_in_git():
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=tables.HERE, capture_output=True)
    return [tables.HERE / name for name in listed.stdout.decode().split("\0") if name]


def test_every_experiment_is_recorded():
    folders = {file.parent.name for file in files_in_git() if file.name == "manifest.json"}
    assert folders <= set(FOLDERS) == set(record.EXPERIMENTS)


@pytest.mark.parametrize("name", some("thesis", "map", "prism"))
def test_the_best_gaits_walk_as_recorded(name):
    """On the compiled engine, undisturbed, which is what analyse.py recorded, too."""
    folder = tables.HERE / name
    analysis, scenario = load_analysis(folder), load_scenario(folder / "scenario.yaml")
    scenario = scenario.on_engine("compiled")
    best = analysis.best_gaits
    assert len(best) == scenario.evolution.trials
    for trial, sensitivity in best["sensitivity_in"].items():
        gait = load_gait(folder / f"trial_{trial:02d}/best_gait.json", scenario)
        walked = simulate(scenario=scenario, gait=gait).metrics.distance_in
        recorded = analysis.distances.at[trial, "compiled"]
        assert walked == pytest.approx(recorded, rel=0, abs=ROUNDINGS * sensitivity), trial


@pytest.mark.slow
def test_the_diagram_walks_as_recorded():
    run, best = recorded_run("thesis-drake"), load_analysis(tables.HERE / "thesis-drake").best_gaits
    walked = simulate(scenario=run.scenario, gait=run.best_gait()).metrics.distance_in
    fittest = run.fittest()
    sensitivity = best.loc[fittest["trial"], "sensitivity_in"]
    assert walked == pytest.approx(fittest["distance_in"], rel=0, abs=ROUNDINGS * sensitivity)


@pytest.mark.parametrize("name", FOLDERS)
def test_a_record_holds_every_value_of_its_scenario(name):
    """So that another default does not change what the record means."""
    for file in (tables.HERE / name).rglob(SCENARIO):
        recorded = parse_yaml(file.read_text(encoding="utf-8"), file)
        now = parse_yaml(dump_scenario(load_scenario(file)), file)
        assert recorded.keys() == now.keys(), file
        # Also in the same order where it matters: it numbers bodies.
        cpg = [tree.pop("cpg") for tree in (recorded, now)]
        assert cpg[0] == cpg[1], file
        for section, values in recorded.items():
            both = [values, now[section]]
            if section == "robot":
                both = [dict(sorted(each.items())) for each in both]
            assert dump_yaml({section: both[0]}) == dump_yaml({section: both[1]}), file


@pytest.mark.parametrize("name", FOLDERS)
def test_a_run_begins_as_its_scenario_and_seed_say(name):
    folder = tables.HERE / name
    manifest = read_manifest(folder)
    scenario, seeds = manifest.scenario, np.random.SeedSequence(manifest.seed)
    assert not record.EXPERIMENTS[name].scenario(name).differences(scenario)
    seed = seeds.spawn(scenario.evolution.trials)[0]
    space, generator = ParameterSpace.of(scenario), np.random.default_rng(seed)
    asked = optimizer_of(scenario.optimizer)(space, scenario.evolution, generator).ask()
    with lzma.open(folder / "trial_00/evaluations.jsonl.xz", "rt") as lines:
        recorded = [json.loads(line)["genome"] for line in itertools.islice(lines, len(asked))]
    assert np.array_equal(asked, recorded)


def test_the_pages_show_the_recorded_runs(runs):
    assert set(runs) == set(FOLDERS)
    for page in tables.pages(runs):
        assert tables.made_again(page, runs) == page.read_text(encoding="utf-8"), page


def test_a_page_says_how_far_its_best_gait_walks_and_how_long(runs):
    said, units = set(), {"in": INCH, "cm": 0.01}
    words = r"[Tt]he (?:best|fittest) gait walks ([\d.]+) (in|cm)(?:ches)?(?: in (\d+) s)?"
    for name, run in runs.items():
        page = (tables.HERE / name / tables.README).read_text(encoding="utf-8")
        for number, unit, seconds in re.findall(words, page):
            walked = run.distances.at[run.best_trial, "compiled"] * INCH / units[unit]
            assert number == f"{walked:.{len(number.partition('.')[2])}f}", name
            assert seconds in ("", f"{tables.scenario_of(name).simulation.duration:g}"), name
            said.add(name)
    assert {"champion", "motors", "pair", "rough", "steps", "twelve", "winch"} <= said


def test_the_gallery_says_how_long_a_gait_walks_and_which_walks_farthest(runs):
    best = tables.best_of_all(runs)
    for name, one in best.items():
        told = re.search(r"in (\d+) s\b", one.title)
        assert tables.scenario_of(name).simulation.duration == float(told[1] if told else 15.0)
    inches = {name: one.reached["compiled"] for name, one in best.items() if one.unit == INCH}
    assert max(inches, key=inches.__getitem__) == "champion"  # as README and its page say


def test_numbers_in_the_text_are_those_of_the_records(runs):
    """On the pages README.md and runs/README.md, outside their tables."""
    front, page = (
        " ".join((folder / tables.README).read_text(encoding="utf-8").split())
        for folder in (tables.FRONT, tables.HERE)
    )
    assert tables.differences(runs)["diagram"].median() < 0.01
    assert "to a hundredth of an inch, in the median" in front
    assert f"share of {DRAWS} disturbed robots" in page

    engines = (tables.FRONT / "tetra_drake/engines/speed.md").read_text(encoding="utf-8")
    rows = [re.split(r"\s*\|\s*", line.strip("| ")) for line in engines.splitlines()]
    times = {row[0]: row for row in rows if len(row) > 2}
    assert round(float(times["1"][-1].replace(",", ".")), 0) == 2.0  # thousands
    assert "two thousand times faster than real time" in front
    _, _, relative = times["speed of `thesis` beside it"]
    assert round(float(times[DRAKE][1]) * float(relative)) == 6
    assert "in place of six times" in front


def test_the_gallery_opens_every_replay_in_its_folder(runs, tmp_path, monkeypatch):
    monkeypatch.setattr(gallery, "save_replays", lambda folder, names: None)
    gallery.save_gallery(tmp_path, FOLDERS)
    links = re.findall(r'(?:href|src)="([^":]+)"', (tmp_path / "index.html").read_text("utf-8"))
    replays = {f"{name}/{REPLAY}" for name in FOLDERS}
    assert replays | {*gallery.FIGURES} <= {*links}
    for link in {*links} - replays:
        assert (tmp_path / link).is_file() and ".." not in link


@pytest.mark.parametrize("name", FOLDERS)
def test_a_run_has_its_page_and_picture(name):
    folder = tables.HERE / name
    text = (folder / tables.README).read_text(encoding="utf-8")
    assert "<!-- to be written -->" not in text and "(../README.md#numbers-of-the-runs)" in text
    assert ("The engines differ by more" in text) == ("## Why the engines differ" in text)
    assert (folder / record.PICTURE).exists()


def test_the_folder_is_small():
    assert sum(file.stat().st_size for file in files_in_git() if file.exists()) < 20_000_000
