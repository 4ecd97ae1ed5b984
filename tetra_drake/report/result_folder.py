"""Result folder of one simulation: written by `simulate`, read by `replay` and `figures`.

scenario.yaml     the scenario with all settings, for `--scenario`; and its height file, if any
trajectory.nc     motion and forces over time; a file for xarray
replay.html       page that plays the motion
result.json       metrics, gait, and path of the centre
"""

from __future__ import annotations

import dataclasses
import json
import logging
import math
import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Self

import numpy as np
import pydantic
from pydantic import Field

from tetra_drake import __version__
from tetra_drake.engines.simulate import simulate
from tetra_drake.errors import InputError
from tetra_drake.evolution.manifest import MANIFEST
from tetra_drake.evolution.run import load_source
from tetra_drake.files import (
    check_folder,
    given_path,
    json_number,
    read_json,
    write_whole,
)
from tetra_drake.formatting import Say, silent
from tetra_drake.machine import versions
from tetra_drake.results.result import IntegratorWork, SimulationResult
from tetra_drake.results.trajectory import VARIABLES, labels, save_dataset, with_indexes
from tetra_drake.robot.gait_file import load_gait
from tetra_drake.robot.measures import CentrePath
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import Structure
from tetra_drake.scenario.load import SCENARIO, load_scenario, save_scenario
from tetra_drake.scenario.metrics import METRICS, UNITS, Metrics, wrong_metric
from tetra_drake.settings.plugins import check_plugins, plugins_of
from tetra_drake.settings.refusals import refuse
from tetra_drake.settings.section import Section
from tetra_drake.settings.units import INCH

if TYPE_CHECKING:
    import xarray

TRAJECTORY, REPLAY, RESULT = "trajectory.nc", "replay.html", "result.json"
SCHEMA = 1


_LOG = logging.getLogger("tetra_drake")


class PathColumns(Section):
    """Path of the robot's centre of mass in result.json: lists over time of equal length, in the
    order of the arrays of CentrePath. Positions are in the world frame."""

    time_s: list[float]
    x_m: list[float]
    y_m: list[float]
    z_m: list[float]
    heading_rad: list[float | None]
    """Headings; None where the heading is undefined."""

    @pydantic.model_validator(mode="after")
    def _check_lengths(self) -> Self:
        count = len(self.time_s)
        for name, column in self:
            if len(column) != count or count < 2:
                expected = f"{max(count, 2)}, as many as time_s"
                refuse(name, f"found {len(column)} numbers, expected {expected}")
        return self


class ResultFile(Section):
    """Part of result.json that load_result() reads back; the file has more keys."""

    name: str
    metrics: dict[str, Any]
    fitness: float | None
    duration_s: float = Field(gt=0)
    wall_time_s: float = Field(gt=0)
    engine: str
    integrator: IntegratorWork
    versions: dict[str, str]
    gait: Any
    """Gait in the form of GaitFile; None if the robot followed a command."""
    spread: dict[str, Annotated[list[float], Field(min_length=2, max_length=2)]] = Field(default={})
    """Ranges of the metrics for moved starts; see SimulationResult.spread."""
    path: PathColumns


def check_result_folder(folder: Path) -> None:
    """Raises InputError if `folder` cannot be written to or holds a run of `evolve`."""
    check_folder(folder)
    if (folder / MANIFEST).exists():
        raise InputError(folder, "", "holds a run of `evolve`, expected another folder")


def save_result_folder(folder: Path, result: SimulationResult) -> None:
    """Writes scenario.yaml, trajectory.nc, replay.html and result.json of a simulation.

    Raises InputError if the result has no recorded trajectory, or if the folder cannot be written
    to.
    """
    trajectory = result.trajectory
    # result.json is removed first and written last: if it is there, the other files belong to it.
    if (folder / RESULT).is_file():
        (folder / RESULT).unlink()
    save_scenario(folder, result.scenario)
    save_dataset(trajectory, folder / TRAJECTORY)
    result.save_replay(folder / REPLAY)
    save_result(folder / RESULT, result)


def save_result(path: str | Path, result: SimulationResult) -> None:
    """Writes the numbers of a result to the JSON file `path`: metrics in SI, lengths also in
    inches, times in s, and the path of the centre of mass as columns. The key `gait` is null if
    the robot followed a file of actuator commands."""
    scenario, gait, metrics = result.scenario, result.gait, result.metrics
    lengths = {name: getattr(metrics, name) for name, unit in UNITS.items() if unit == "m"}
    lengths["path_radius"] = metrics.path_radius
    columns = [result.path.times, *result.path.centre.T, result.path.heading]
    path_columns = dict(zip(PathColumns.model_fields, columns, strict=True))
    content = {
        "schema": SCHEMA,
        "name": result.name,
        "scenario": scenario.name,
        "metrics": metrics.to_json(),
        **{f"{name}_in": json_number(length / INCH) for name, length in lengths.items()},
        "fitness": result.fitness,
        "duration_s": result.duration,
        "wall_time_s": result.wall_time,
        "real_time_factor": result.duration / result.wall_time,
        "engine": result.engine,
        "integrator": result.integrator.model_dump(),
        "versions": versions(scenario.engine.packages) | plugins_of(scenario),
        "gait": gait and gait.to_json(scenario),
        **({"spread": dict(result.spread)} if result.spread else {}),
        "path": {
            name: [json_number(number) for number in column.tolist()]
            for name, column in path_columns.items()
        },
    }
    write_whole(path, json.dumps(content, indent=1, allow_nan=False) + "\n")


def load_result(folder: str | Path) -> SimulationResult:
    """Reads a folder written by `simulate`: returns the result with scenario, gait and trajectory.

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
    path = folder / RESULT
    content = read_json(path, "result")
    if isinstance(content, dict):
        content = {name: content[name] for name in ResultFile.model_fields if name in content}
    file = ResultFile.from_tree(content, path)
    check_plugins(file.versions, folder)
    scenario = load_scenario(folder / SCENARIO)
    unknown = [name for name in METRICS if name not in file.metrics]
    if unknown and file.versions.get("tetra_drake") == __version__:
        raise InputError(path, f"metrics.{unknown[0]}", "is missing")
    if unknown:
        _LOG.warning("%s: made without the metrics %s, which are NaN", path, ", ".join(unknown))
    metrics: dict[str, Any] = dict.fromkeys(METRICS) | {"lifted_shares": ""} | file.metrics
    if wrong := wrong_metric(metrics):
        raise InputError(path, f"metrics.{wrong}", "is missing, or of a wrong type")
    numbers = {name: math.nan if metrics[name] is None else metrics[name] for name in METRICS}
    shares = tuple(metrics["lifted_shares"])
    if file.gait is None:  # a command was played
        gait, robot = None, Robot.of(scenario).without_network()
    else:
        gait, robot = load_gait(path, scenario, key="gait"), Robot.of(scenario)
        robot = robot if scenario.policy is None else robot.controlled
    times, *centre, heading = (np.array(column, dtype=float) for _, column in file.path)
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
        path=CentrePath(times, np.column_stack(centre), heading),
        spread=file.spread,
        recorded=_load_trajectory(folder / TRAJECTORY, robot.structure),
    )


def _load_trajectory(path: Path, structure: Structure) -> xarray.Dataset:
    """Reads a trajectory from a netCDF file. Raises InputError if it is damaged, or not a motion of
    the robot with this structure."""
    import xarray

    try:
        trajectory = xarray.load_dataset(path, engine="h5netcdf")
    except Exception as error:  # errors of HDF5 for damaged files have no common class
        raise InputError(path, "", f"cannot be read as netCDF: {error}") from error
    for name, (_, expected) in labels(structure).items():
        if name not in trajectory.coords or trajectory[name].values.tolist() != expected:
            raise InputError(path, name, f"differs from the robot in {SCENARIO}")
    dimensions = {name: along for name, (along, _, _) in VARIABLES.items()}
    for name, along in {"time": ("time",), **dimensions}.items():
        if name not in trajectory or trajectory[name].dims != along:
            raise InputError(path, name, f"is missing, or not over {', '.join(along)}")
        values = trajectory[name].values
        if values.dtype.kind not in "iuf" or not np.isfinite(values).all():
            raise InputError(path, name, "has values that are not finite numbers")
    times = trajectory["time"].values
    if len(times) < 2 or not (np.diff(times) > 0.0).all():
        raise InputError(path, "time", "has fewer than two samples, or does not ascend")
    return with_indexes(trajectory)


def load_or_simulate(
    source: Path, *, scenario: str | None = None, warn: Say = silent
) -> SimulationResult:
    """Loads the result in a folder of `simulate`; or simulates a gait file, or the best gait of a
    run of `evolve`.

    `scenario` is a name or file, for gait files only: folders have their own. `warn` is called with
    a warning if the gait was made for another scenario.

    Raises InputError if the source cannot be used, or if a folder is given a scenario. Raises
    SimulationFailure if the simulation fails.
    """
    if os.path.isdir(source) and scenario is not None:
        raise InputError("replay", "scenario", f"is for gait files; {source} has its own scenario")
    is_run = os.path.exists(source / MANIFEST)
    if os.path.exists(source / RESULT) and not is_run:
        return load_result(source)
    if not os.path.isfile(source) and not is_run:
        raise InputError(source, "", "expected a folder of `simulate` or `evolve`, or a gait file")
    loaded = load_source(source, scenario=scenario, warn=warn)
    result = simulate(loaded.scenario, loaded.best, record=True)
    return dataclasses.replace(result, spread=loaded.spread)
