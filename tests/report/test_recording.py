"""What `replay` shows: a folder of `simulate`, a gait file, or the best gait of a run."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray

from tetra_drake.engines.simulate import simulate
from tetra_drake.errors import InputError
from tetra_drake.evolution.record import RunRecord
from tetra_drake.report.recording import load_recording
from tetra_drake.results.folder import check_result_folder, load_result_folder, save_result_folder
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.gait import Gait, random_gait, save_gait
from tetra_drake.scenario.load import dump_scenario, load_scenario
from tetra_drake.scenario.schema import Scenario


@pytest.fixture(scope="module")
def short() -> Scenario:
    """A robot of three tetrahedra, for a moment."""
    thesis = load_scenario()
    return thesis.with_changes(
        {
            "name": "short",
            "robot.tetrahedra": 3,
            "simulation.duration": 0.1,
            "simulation.steady_from": 0.05,
            "evolution.trials": 3,
        }
    )


@pytest.fixture(scope="module")
def gait(short: Scenario) -> Gait:
    return random_gait(short, np.random.default_rng(0), name="any")


@pytest.fixture(scope="module")
def result(short: Scenario, gait: Gait) -> SimulationResult:
    return simulate(scenario=short, gait=gait, record=True)


@pytest.fixture(scope="module")
def written(
    tmp_path_factory: pytest.TempPathFactory, short: Scenario, gait: Gait, result: SimulationResult
) -> Path:
    folder = tmp_path_factory.mktemp("written") / "out"
    save_result_folder(folder, scenario=short, gait=gait, result=result)
    return folder


@pytest.fixture
def folder(tmp_path: Path, written: Path) -> Path:
    """A folder as `simulate` leaves it."""
    return shutil.copytree(written, tmp_path / "out")


def test_a_result_folder_holds_all_it_takes_to_replay_it(
    folder: Path, short: Scenario, gait: Gait, result: SimulationResult
) -> None:
    recording = load_recording(folder)
    assert recording.scenario == short
    assert recording.gait == gait
    xarray.testing.assert_equal(recording.trajectory, result.trajectory)


def test_its_scenario_gives_the_result_again(folder: Path, result: SimulationResult) -> None:
    recording = load_result_folder(folder)
    again = simulate(scenario=recording.scenario, gait=recording.gait)
    assert again.metrics == result.metrics


def test_a_gait_file_is_simulated(
    tmp_path: Path, short: Scenario, gait: Gait, result: SimulationResult
) -> None:
    save_gait(gait, tmp_path / "gait.json")
    (tmp_path / "short.yaml").write_text(dump_scenario(short))
    recording = load_recording(tmp_path / "gait.json", scenario=str(tmp_path / "short.yaml"))
    assert recording.scenario == short
    xarray.testing.assert_identical(recording.trajectory, result.trajectory)


@pytest.fixture
def run(tmp_path: Path, short: Scenario) -> Path:
    """A run of three trials, of which the second has the fittest gait and the last none."""
    with RunRecord.create(tmp_path / "run", scenario=short, seed=1) as record:
        for number, fitness in enumerate([[1.0, 2.0], [1.5, 3.0]]):
            record.open_trial(number)
            trial = tmp_path / "run" / f"trial_{number:02d}"
            lines = [json.dumps({"best_fitness": value}) for value in fitness]
            (trial / "iterations.jsonl").write_text("\n".join(lines) + "\n")
            generator = np.random.default_rng(number)
            save_gait(random_gait(short, generator, name=f"{number}"), trial / "best_gait.json")
    return tmp_path / "run"


def test_of_a_run_the_fittest_gait_is_simulated_on_its_scenario(run: Path, short: Scenario) -> None:
    recording = load_recording(run)
    assert recording.gait.name == "1"
    assert recording.scenario == short
    assert recording.trajectory.sizes["tetrahedron"] == 3


def test_a_run_without_a_gait_has_nothing_to_show(run: Path) -> None:
    for lines in run.glob("*/iterations.jsonl"):
        lines.write_text('{"best_fitness": null}\n')
    with pytest.raises(InputError, match="holds no gait with a fitness yet"):
        load_recording(run)


def test_a_result_does_not_go_into_a_run(run: Path) -> None:
    # Its scenario.yaml would take the place of the run's.
    with pytest.raises(InputError, match="holds a run"):
        check_result_folder(run)


def test_a_folder_has_its_own_scenario(folder: Path, run: Path) -> None:
    for source in (folder, run):
        with pytest.raises(InputError, match=f"--scenario: .*{source}"):
            load_recording(source, scenario="thesis")


def test_nothing_is_shown_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file or folder"):
        load_recording(tmp_path / "missing")
    with pytest.raises(InputError, match=r"neither result\.json.* nor manifest\.json"):
        load_recording(tmp_path)


@pytest.mark.parametrize("name", ["scenario.yaml", "trajectory.nc"])
def test_a_folder_without_one_of_its_files_is_refused(folder: Path, name: str) -> None:
    (folder / name).unlink()
    with pytest.raises(InputError, match=f"holds no {name}"):
        load_recording(folder)


def cut_short(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def scribble(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 3 : len(content) // 2] = b"?" * (len(content) // 2 - len(content) // 3)
    path.write_bytes(content)


@pytest.mark.parametrize("damage", [cut_short, scribble, lambda path: path.write_text("")])
@pytest.mark.parametrize("name", ["trajectory.nc", "result.json", "scenario.yaml"])
def test_damaged_files_are_refused_by_name(
    folder: Path, name: str, damage: Callable[[Path], None]
) -> None:
    damage(folder / name)
    with pytest.raises(InputError) as caught:
        load_recording(folder)
    assert caught.value.source == str(folder / name)


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
        ("p_WN", lambda dataset: dataset.assign(p_WN=dataset.p_WN * np.nan)),
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


def test_a_gait_that_is_not_the_scenarios_is_refused(folder: Path, gait: Gait) -> None:
    content = json.loads((folder / "result.json").read_text())
    content["gait"]["weights"] = [1.0] * 24
    (folder / "result.json").write_text(json.dumps(content))
    with pytest.raises(InputError, match=r"result\.json: weights: found 24 numbers, expected 4"):
        load_recording(folder)


def test_a_result_stands_for_files_that_are_complete(
    folder: Path,
    short: Scenario,
    gait: Gait,
    result: SimulationResult,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(*arguments: object, **options: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr("tetra_drake.results.trajectory.save_dataset", fail)
    with pytest.raises(OSError, match="disk full"):
        save_result_folder(folder, scenario=short, gait=gait, result=result)
    assert not (folder / "result.json").exists()


def test_a_folder_can_be_moved(folder: Path, tmp_path: Path) -> None:
    shutil.move(folder, tmp_path / "elsewhere")
    assert load_recording(tmp_path / "elsewhere").gait.name == "any"
