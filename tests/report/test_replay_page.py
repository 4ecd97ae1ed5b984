"""Replay pages of result folders, gait files and runs; result folders are read as written."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
import xarray
from helpers.synthetic_run import write_run

from tetra_drake.errors import InputError
from tetra_drake.report.replay_page import load_recording, write_replay
from tetra_drake.results.folder import check_result_folder, save_result_folder
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.gait import Gait, save_gait
from tetra_drake.scenario.load import dump_scenario
from tetra_drake.scenario.schema import Scenario


def test_a_result_folder_holds_what_its_replay_needs(
    folder: Path, tiny: Scenario, gait: Gait, result: SimulationResult
) -> None:
    moved = folder.rename(folder.with_name("elsewhere"))
    recording = load_recording(moved)
    assert recording.scenario == tiny
    assert recording.gait == gait
    xarray.testing.assert_equal(recording.trajectory, result.trajectory)


def test_a_gait_file_is_simulated_and_gives_the_same_page(
    folder: Path, tiny: Scenario, gait: Gait
) -> None:
    save_gait(gait, folder / "gait.json")
    (folder / "tiny.yaml").write_text(dump_scenario(tiny))
    out = folder / "new" / "gait.html"
    title = write_replay(folder / "gait.json", out, scenario=str(folder / "tiny.yaml"))
    assert gait.name in title
    assert out.read_bytes() == (folder / "replay.html").read_bytes()


def test_of_a_run_the_fittest_gait_is_simulated(run: Path, tiny: Scenario) -> None:
    recording = load_recording(run)
    assert recording.gait.name == "tiny, seed 7, trial 1, evaluation 4"
    assert recording.scenario.robot == tiny.robot


def test_a_run_without_fitness_has_no_motion(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run", [[[(None, 0)]]])
    with pytest.raises(InputError) as caught:
        load_recording(run)
    assert caught.value.source == str(run)


def test_a_result_does_not_go_into_a_run(run: Path) -> None:
    # Its scenario.yaml would replace the run's.
    with pytest.raises(InputError) as caught:
        check_result_folder(run)
    assert caught.value.source == str(run)


def test_folders_have_scenarios_of_their_own(folder: Path, run: Path) -> None:
    for source in (folder, run):
        with pytest.raises(InputError) as caught:
            load_recording(source, scenario="thesis")
        assert caught.value.source == "--scenario"


def test_sources_without_motion_and_places_that_cannot_be_written_to_are_refused(
    tmp_path: Path, folder: Path
) -> None:
    for source in (tmp_path / "missing", tmp_path):
        with pytest.raises(InputError) as caught:
            load_recording(source)
        assert caught.value.source == str(source)
    for out in (folder, folder / "result.json" / "replay.html"):
        with pytest.raises(InputError) as caught:
            write_replay(folder, out)
        assert caught.value.source in (str(out), str(out.parent))


def cut_short(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def scribble(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 3 : len(content) // 2] = b"?" * (len(content) // 2 - len(content) // 3)
    path.write_bytes(content)


@pytest.mark.parametrize("damage", [cut_short, scribble, Path.unlink])
@pytest.mark.parametrize("name", ["trajectory.nc", "result.json", "scenario.yaml"])
def test_missing_and_damaged_files_are_refused_by_name(
    folder: Path, name: str, damage: Callable[[Path], None]
) -> None:
    damage(folder / name)
    with pytest.raises(InputError) as caught:
        load_recording(folder)
    assert name in str(caught.value) or damage is Path.unlink  # without result.json: both names
    assert caught.value.source in (str(folder / name), str(folder))


def rewrite(folder: Path, change: Callable[[xarray.Dataset], xarray.Dataset]) -> None:
    dataset = xarray.load_dataset(folder / "trajectory.nc", engine="h5netcdf")
    change(dataset).to_netcdf(folder / "trajectory.nc", engine="h5netcdf")


@pytest.mark.parametrize(
    ("key", "change"),
    [
        ("tetrahedron", lambda dataset: dataset.isel(tetrahedron=slice(2))),
        ("cable", lambda dataset: dataset.isel(cable=slice(None, None, -1))),
        ("tension", lambda dataset: dataset.drop_vars("tension")),
        ("p_WN", lambda dataset: dataset.transpose(..., "time")),
        ("p_WB", lambda dataset: dataset.assign(p_WB=dataset.p_WB.where(False))),
        ("time", lambda dataset: dataset.isel(time=slice(0))),
        ("time", lambda dataset: dataset.isel(time=slice(None, None, -1))),
    ],
    ids=["another robot", "cables", "no tension", "dimensions", "nan", "empty", "backward"],
)
def test_a_trajectory_that_is_not_the_scenarios_is_refused(
    folder: Path, key: str, change: Callable[[xarray.Dataset], xarray.Dataset]
) -> None:
    rewrite(folder, change)
    with pytest.raises(InputError) as caught:
        load_recording(folder)
    assert (caught.value.source, caught.value.key) == (str(folder / "trajectory.nc"), key)


def test_a_gait_that_is_not_the_scenarios_is_refused(folder: Path) -> None:
    content = json.loads((folder / "result.json").read_text())
    content["gait"]["weights"] = [1.0] * 24
    (folder / "result.json").write_text(json.dumps(content))
    with pytest.raises(InputError) as caught:
        load_recording(folder)
    assert (caught.value.source, caught.value.key) == (str(folder / "result.json"), "gait.weights")


def test_a_result_stands_for_files_that_are_complete(
    folder: Path,
    tiny: Scenario,
    gait: Gait,
    result: SimulationResult,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(*arguments: object, **options: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr("tetra_drake.results.trajectory.save_dataset", fail)
    with pytest.raises(OSError, match="disk full"):
        save_result_folder(folder, scenario=tiny, gait=gait, result=result)
    assert not (folder / "result.json").exists()
