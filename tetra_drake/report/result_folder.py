"""The folder of one simulation: written by `simulate`, read by `replay` and `figures`.

scenario.yaml     the scenario in full, for `--scenario`
trajectory.nc     motion and forces over time, for xarray
replay.html       a page that plays the motion
result.json       the numbers, the gait, and the path of the centre
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.evolution.manifest import MANIFEST
from tetra_drake.files import check_folder, read_text, write_whole
from tetra_drake.results.metrics import headline
from tetra_drake.results.trajectory import DIMENSIONS, labels
from tetra_drake.robot.gait import Gait, load_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import Structure
from tetra_drake.scenario.load import dump_scenario, load_scenario
from tetra_drake.scenario.metric_units import METRICS
from tetra_drake.scenario.schema import Scenario

if TYPE_CHECKING:
    import xarray

    from tetra_drake.results.result import SimulationResult

SCENARIO, TRAJECTORY = "scenario.yaml", "trajectory.nc"
REPLAY, RESULT = "replay.html", "result.json"


@dataclass(frozen=True)
class GaitMotion:
    """A gait and its motion, with all that is needed to show it."""

    scenario: Scenario
    gait: Gait
    trajectory: xarray.Dataset
    """Motion and forces; see results.trajectory.make_dataset."""
    metrics: Mapping[str, float]
    """Values in SI of all METRICS."""

    @property
    def title(self) -> str:
        """The gait's name and what it did."""
        return f"{self.gait.name}: {headline(self.scenario, self.metrics)}"

    def save_replay(self, path: Path, *, viewer: Path | None = None) -> None:
        """Writes the page that plays the motion; see visualization.replay.save_replay."""
        from tetra_drake.visualization.replay import save_replay

        save_replay(
            path,
            robot=Robot.of(self.scenario),
            trajectory=self.trajectory,
            title=self.title,
            viewer=viewer,
        )


def simulate_gait(scenario: Scenario, gait: Gait) -> GaitMotion:
    """Simulates a gait and keeps its motion. Raises SimulationFailure."""
    from tetra_drake.engines.simulate import simulate

    result = simulate(scenario=scenario, gait=gait, record=True)
    assert result.trajectory is not None
    return GaitMotion(scenario, gait, result.trajectory, vars(result.metrics))


def check_result_folder(folder: Path) -> None:
    """Raises InputError if a simulation cannot write its files to `folder`."""
    check_folder(folder)
    if (folder / MANIFEST).exists():
        raise InputError(folder, "", "holds a run of `evolve`, expected another folder")


def save_result_folder(
    folder: Path,
    *,
    scenario: Scenario,
    gait: Gait,
    result: SimulationResult,
    commanded: bool = False,
) -> None:
    """Writes the files of a simulation that recorded its trajectory; the gait of one that was
    `commanded` is left out. Raises InputError if the folder cannot be written to."""
    from tetra_drake.results.result import save_result
    from tetra_drake.results.trajectory import save_dataset

    assert result.trajectory is not None
    motion = GaitMotion(scenario, gait, result.trajectory, vars(result.metrics))
    # Written last and removed first: where there is a result.json, the other files belong to it.
    if (folder / RESULT).is_file():
        (folder / RESULT).unlink()
    write_whole(folder / SCENARIO, dump_scenario(scenario))
    save_dataset(motion.trajectory, folder / TRAJECTORY)
    motion.save_replay(folder / REPLAY)
    save_result(folder / RESULT, scenario, None if commanded else gait, result)


def load_result_folder(folder: Path) -> GaitMotion:
    """Reads a simulation's scenario, gait and trajectory back.

    Raises InputError, naming the file, if one is missing, damaged, or not of this scenario.
    """
    for name in (RESULT, SCENARIO, TRAJECTORY):
        if not (folder / name).is_file():
            problem = f"holds no {name}, so it was not written by `simulate`"
            raise InputError(folder, name, problem)
    scenario = load_scenario(folder / SCENARIO)
    return GaitMotion(
        scenario=scenario,
        gait=load_gait(folder / RESULT, scenario, key="gait"),
        trajectory=_load_trajectory(folder / TRAJECTORY, Robot.of(scenario).structure),
        metrics=_load_metrics(folder / RESULT),
    )


def _load_metrics(path: Path) -> dict[str, float]:
    """The metrics in result.json, NaN where one is null; InputError if one is missing."""
    numbers = json.loads(read_text(path, "result")).get("metrics")
    for name in METRICS:
        if not isinstance(numbers, dict) or not isinstance(numbers.get(name, ""), float | None):
            raise InputError(path, f"metrics.{name}", "is missing, or no number")
    return {name: math.nan if numbers[name] is None else numbers[name] for name in METRICS}


def _load_trajectory(path: Path, structure: Structure) -> xarray.Dataset:
    """The trajectory in a file; InputError unless it holds the motion of this robot."""
    import xarray

    try:
        trajectory = xarray.load_dataset(path, engine="h5netcdf")
    except Exception as error:  # what HDF5 raises for damaged files has no common ancestor
        raise InputError(path, "", f"cannot be read as netCDF: {error}") from error
    for name, (_, expected) in labels(structure).items():
        if name not in trajectory.coords or trajectory[name].values.tolist() != expected:
            raise InputError(path, name, f"is not that of the robot in {SCENARIO}")
    for name, dimensions in {"time": ("time",), **DIMENSIONS}.items():
        if name not in trajectory or trajectory[name].dims != dimensions:
            raise InputError(path, name, f"is missing, or not over {', '.join(dimensions)}")
        values = trajectory[name].values
        if values.dtype.kind not in "iuf" or not np.isfinite(values).all():
            raise InputError(path, name, "holds what is no finite number")
    times = trajectory["time"].values
    if len(times) < 2 or not (np.diff(times) > 0.0).all():
        raise InputError(path, "time", "has fewer than two samples, or does not ascend")
    return trajectory
