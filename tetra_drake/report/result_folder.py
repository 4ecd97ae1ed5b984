"""Result folder of one simulation: written by `simulate`, read by `replay` and `figures`.

scenario.yaml     the scenario with all settings, for `--scenario`; and its height file, if any
trajectory.nc     motion and forces over time; a file for xarray
replay.html       page that plays the motion
result.json       metrics, gait, and path of the centre
"""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import Field

from tetra_drake.errors import InputError
from tetra_drake.evolution.manifest import MANIFEST
from tetra_drake.files import check_folder, given_path, read_json
from tetra_drake.results.result import (
    IntegratorWork,
    PathColumns,
    SimulationResult,
    save_result,
)
from tetra_drake.results.trajectory import DIMENSIONS, labels, save_dataset, with_indexes
from tetra_drake.robot.gait import load_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import Structure
from tetra_drake.scenario.load import SCENARIO, load_scenario, save_scenario
from tetra_drake.scenario.metrics import METRICS, Metrics, wrong_metric
from tetra_drake.settings.section import Section

if TYPE_CHECKING:
    import xarray

TRAJECTORY, REPLAY, RESULT = "trajectory.nc", "replay.html", "result.json"


def check_result_folder(folder: Path) -> None:
    """Raises InputError if a simulation cannot write its files to `folder`."""
    check_folder(folder)
    if (folder / MANIFEST).exists():
        raise InputError(folder, "", "holds a run of `evolve`, expected another folder")


def save_result_folder(folder: Path, result: SimulationResult) -> None:
    """Writes the files of a simulation. Raises InputError if it has no trajectory, or if the folder
    cannot be written to."""
    trajectory = result.trajectory
    # result.json is removed first and written last: if it is there, the other files belong to it.
    if (folder / RESULT).is_file():
        (folder / RESULT).unlink()
    save_scenario(folder, result.scenario)
    save_dataset(trajectory, folder / TRAJECTORY)
    result.save_replay(folder / REPLAY)
    save_result(folder / RESULT, result)


def load_result(folder: str | Path) -> SimulationResult:
    """Reads a result folder of `simulate`: the result with scenario, gait and trajectory.

        >>> result = td.load_result("out")
        >>> signals = result.trajectory.signal.sel(oscillator="T1-T2")

    Args:
        folder: a folder written by `tetra-drake simulate`.

    Raises:
        InputError: names the file that is missing, damaged, or of another scenario.
    """
    folder = given_path(folder, "load_result", "folder")
    for name in (RESULT, SCENARIO, TRAJECTORY):
        if not os.path.isfile(folder / name):
            problem = f"holds no {name}, so it was not written by `simulate`"
            raise InputError(folder, name, problem)
    scenario, path = load_scenario(folder / SCENARIO), folder / RESULT
    content = read_json(path, "result")
    if isinstance(content, dict):
        content = {name: content[name] for name in _ResultFile.model_fields if name in content}
    file = _ResultFile.from_tree(content, path)
    metrics = dict.fromkeys([*METRICS, "lifted_shares"], "") | file.metrics
    if name := wrong_metric(metrics):
        raise InputError(path, f"metrics.{name}", "is missing, or of a wrong type")
    numbers = {name: math.nan if metrics[name] is None else metrics[name] for name in METRICS}
    shares = tuple(metrics["lifted_shares"])
    if file.gait is None:  # a command was played
        gait, robot = None, Robot.of(scenario).without_network()
    else:
        gait, robot = load_gait(path, scenario, key="gait"), Robot.of(scenario)
    trajectory = _load_trajectory(folder / TRAJECTORY, robot.structure)
    return SimulationResult(
        scenario=scenario,
        robot=robot,
        name=file.name,
        gait=gait,
        metrics=Metrics(**numbers, lifted_shares=shares, units=scenario.units),
        fitness=math.nan if file.fitness is None else file.fitness,
        duration=file.duration_s,
        wall_time=file.wall_time_s,
        integrator=file.integrator,
        engine=file.engine,
        path=file.path.to_path(),
        recorded=trajectory,
    )


class _ResultFile(Section):
    """The keys of result.json that load_result() reads."""

    name: str
    metrics: dict[str, Any]
    fitness: float | None
    duration_s: float = Field(gt=0)
    wall_time_s: float = Field(gt=0)
    engine: str
    integrator: IntegratorWork
    gait: Any
    """See GaitFile; None if a command was played."""
    path: PathColumns


def _load_trajectory(path: Path, structure: Structure) -> xarray.Dataset:
    """Reads a trajectory. Raises InputError if it is not a motion of this robot."""
    import xarray

    try:
        trajectory = xarray.load_dataset(path, engine="h5netcdf")
    except Exception as error:  # errors of HDF5 for damaged files have no common class
        raise InputError(path, "", f"cannot be read as netCDF: {error}") from error
    for name, (_, expected) in labels(structure).items():
        if name not in trajectory.coords or trajectory[name].values.tolist() != expected:
            raise InputError(path, name, f"differs from the robot in {SCENARIO}")
    for name, dimensions in {"time": ("time",), **DIMENSIONS}.items():
        if name not in trajectory or trajectory[name].dims != dimensions:
            raise InputError(path, name, f"is missing, or not over {', '.join(dimensions)}")
        values = trajectory[name].values
        if values.dtype.kind not in "iuf" or not np.isfinite(values).all():
            raise InputError(path, name, "has values that are not finite numbers")
    times = trajectory["time"].values
    if len(times) < 2 or not (np.diff(times) > 0.0).all():
        raise InputError(path, "time", "has fewer than two samples, or does not ascend")
    return with_indexes(trajectory)
