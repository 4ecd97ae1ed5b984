"""Replay pages of result folders, gait files and runs; result folders are read as written."""

import json
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
import xarray
from helpers.synthetic_run import write_run

from tetra_drake.errors import InputError
from tetra_drake.report.result_folder import (
    check_result_folder,
    load_or_simulate,
    load_result,
    save_result_folder,
)
from tetra_drake.results.result import headline
from tetra_drake.robot.gait_file import load_gait
from tetra_drake.scenario.load import load_scenario


def test_sources_without_motion_and_bad_places_are_refused(tmp_path, folder, run, refused):
    failed = write_run(tmp_path / "failed", [[[(None, 0)]]])
    with refused(failed, "", ""):
        load_or_simulate(failed)
    for source in (folder, run):  # they have scenarios of their own
        with refused("replay", "scenario", ""):
            load_or_simulate(source, scenario="thesis")
    with refused(run, "", ""):  # a result's scenario.yaml would replace the run's
        check_result_folder(run)


def cut_short(path):
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


@pytest.mark.parametrize("damage", [cut_short, Path.unlink])
@pytest.mark.parametrize("name", ["trajectory.nc", "result.json", "scenario.yaml"])
def test_missing_and_damaged_files_are_refused_by_name(folder, name, damage):
    damage(folder / name)
    with pytest.raises(InputError) as caught:
        load_or_simulate(folder)
    assert name in str(caught.value) or damage is Path.unlink  # without result.json: both names
    assert caught.value.source in (str(folder / name), str(folder))


UNFITTING = {
    "body": lambda dataset: dataset.isel(body=slice(2)),
    "tension": lambda dataset: dataset.drop_vars("tension"),
    "p_WB": lambda dataset: dataset.assign(p_WB=dataset.p_WB.where(False)),
    "time": lambda dataset: dataset.isel(time=slice(None, None, -1)),
}


@pytest.mark.parametrize("key", UNFITTING)
def test_an_unfitting_trajectory_is_refused(folder, result, key, refused, monkeypatch):
    changed = UNFITTING[key](result.trajectory)
    monkeypatch.setattr(xarray, "load_dataset", lambda path, engine: changed)
    with refused(folder / "trajectory.nc", key, ""):
        load_or_simulate(folder)


DAMAGES = {
    "duration_s": lambda content: content.update(duration_s=0.0),
    "metrics.speed": lambda content: content["metrics"].pop("speed"),
    "gait.parameters": lambda content: content["gait"]["parameters"].pop("tau_A"),
    "integrator.steps": lambda content: content["integrator"].pop("steps"),
    "path.x_m": lambda content: content["path"]["x_m"].pop(),
}


@pytest.mark.parametrize("key", DAMAGES)
def test_a_damaged_result_is_refused_by_its_key(folder, key, refused):
    file = folder / "result.json"
    content = json.loads(file.read_text())
    DAMAGES[key](content)
    file.write_text(json.dumps(content))
    with refused(file, key, ""):
        load_result(folder)


def test_a_result_stands_for_files_that_are_complete(folder, tiny, gait, result, monkeypatch):
    fail = Mock(side_effect=OSError("disk full"))
    monkeypatch.setattr("tetra_drake.report.result_folder.save_dataset", fail)
    with pytest.raises(OSError, match="disk full"):
        save_result_folder(folder, result)
    assert not (folder / "result.json").exists()


def test_a_folder_gives_the_result_back(folder, result):
    read = load_result(folder)
    assert read == result
    assert read.gait == result.gait and read.scenario == result.scenario
    xarray.testing.assert_identical(read.trajectory, result.trajectory)
    for name in ("centre", "heading"):
        np.testing.assert_array_equal(getattr(read.path, name), getattr(result.path, name))
    in_contact, texts = read.trajectory.in_contact, read.trajectory.attrs
    assert {*np.unique(in_contact)} <= {*in_contact.attrs["flag_values"]}
    assert all(values.variable.values.base is None for values in result.trajectory.values())
    # The file of the trajectory alone says what was simulated.
    (folder / "scenario.yaml").write_text(texts["scenario"])
    (folder / "gait.json").write_text(texts["gait"])
    assert load_scenario(folder / "scenario.yaml") == result.scenario
    assert load_gait(folder / "gait.json", result.scenario) == result.gait
    assert texts["title"] == f"{result.name}: {headline(result.scenario, vars(result.metrics))}"
