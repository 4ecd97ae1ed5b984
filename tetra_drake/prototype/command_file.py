"""The file of a command: CSV with a column for the time, and one for each driven cable."""

from __future__ import annotations

import io
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas

from tetra_drake.errors import InputError
from tetra_drake.files import read_text
from tetra_drake.robot.command import Command
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import SCENARIO
from tetra_drake.scenario.refusals import hint
from tetra_drake.scenario.scenario import Scenario

TIME = "time_s"


_UNEVEN = 0.05
"""Largest error of the time between two samples, as a share of it: times may be rounded."""


def command_columns(robot: Robot) -> list[str]:
    """The columns of a robot's commands but for the time, such as "T1-T2 outer top tension_N"."""
    quantity, names = robot.scenario.actuation.commanded, robot.structure.cable_names
    return [f"{names[cable]} {quantity}" for cable in robot.driven]


def command_text(robot: Robot, command: Command) -> str:
    """A command as the content of its file."""
    times = command.period * np.arange(len(command.samples))
    values = command.samples / robot.scenario.actuation.command_unit
    return table_text(command_columns(robot), times, values)


def table_text(columns: Sequence[str], times: np.ndarray, values: np.ndarray) -> str:
    """CSV with times (s) and values, a row for each time."""
    table = pandas.DataFrame(values, columns=columns, index=pandas.Index(times, name=TIME))
    return table.reset_index().to_csv(index=False, float_format="%.6f")


def scenario_beside(path: Path) -> Path | None:
    """The scenario file in the folder of a command, which the command is for, if there is one."""
    scenario = path.parent / SCENARIO
    return scenario if os.path.isfile(scenario) else None


def load_command(path: str | Path, scenario: Scenario) -> Command:
    """Reads the file of a command for a scenario's robot; columns may stand in any order.

        >>> scenario = td.load_scenario("quick")
        >>> command = td.load_command("lab/command.csv", scenario)
        >>> result = td.simulate(scenario, command=command)

    Raises InputError, naming file and place, for whatever is wrong in the file or does not fit.
    """
    robot, text = Robot.of(scenario), read_text(path, "command file")
    try:
        # Cells are read as texts, so that what is no number can be shown.
        cells = pandas.read_csv(io.StringIO(text), dtype=str, na_filter=False)
    except ValueError as error:  # also what pandas raises for ragged rows and an empty file
        raise InputError(path, "", f"is no table: {error}") from error
    if not isinstance(cells.index, pandas.RangeIndex):
        raise InputError(path, "", "is no table: rows have more cells than the heading")
    wanted = [TIME, *command_columns(robot)]
    for name in cells.columns:
        if name not in wanted:
            raise InputError(path, name, f"is no column of this robot; {hint(name, wanted)}")
    for name in wanted:
        if name not in cells.columns:
            raise InputError(path, name, "is missing")
        numbers = pandas.to_numeric(cells[name], errors="coerce")
        for row in np.flatnonzero(~np.isfinite(numbers)):
            problem = f"found '{cells[name][row]}', expected a number"
            raise InputError(path, f"line {row + 2}, {name}", problem)
        cells[name] = numbers
    table = cells[wanted].to_numpy(dtype=float)
    period = _period(table[:, 0], scenario.cpg.listing_step, path)
    return Command(Path(path).name, period, scenario.actuation.command_unit * table[:, 1:])


def _period(times: np.ndarray, least: float, source: str | Path) -> float:
    """Time (s) between samples; InputError unless they are evenly spaced from 0 on."""
    if len(times) < 2 or abs(times[0]) > 1e-6:
        raise InputError(source, TIME, "expected at least two samples, the first at 0")
    period = float(np.median(np.diff(times)))
    if period < (1.0 - _UNEVEN) * least:
        problem = f"found samples {period:g} s apart, expected at least {least:g} s"
        raise InputError(source, TIME, problem)
    for row in np.flatnonzero(np.abs(np.diff(times) - period) > _UNEVEN * period):
        problem = f"found {times[row + 1]:g} after {times[row]:g}, expected {period:g} s more"
        raise InputError(source, f"line {row + 3}, {TIME}", problem)
    return float(times[-1]) / (len(times) - 1)
