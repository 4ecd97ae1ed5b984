"""Command file: CSV with a column for the time and one for each driven cable."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas

from tetra_drake.errors import InputError
from tetra_drake.files import given_path, read_text
from tetra_drake.robot.command import Command
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import SCENARIO, GivenScenario, given_scenario
from tetra_drake.settings.refusals import hint

TIME_S = "time_s"


_UNEVEN = 0.05
"""Tolerance for the time between two samples, as a share of it. Times in files may be rounded."""


def command_columns(robot: Robot) -> list[str]:
    """Names of the columns of a robot's command file without the time, one per driven cable: the
    cable, the commanded quantity and its unit, such as "T1-T2 outer top tension_N"."""
    quantity, names = robot.scenario.actuation.commanded, robot.structure.cable_names
    return [f"{names[cable]} {quantity}" for cable in robot.driven]


def command_text(robot: Robot, command: Command) -> str:
    """CSV text of a command, setpoints of the actuators over time. It has the column time_s and the
    columns of command_columns(), in their units; load_command() reads it."""
    times = command.period * np.arange(len(command.samples))
    values = command.samples / robot.scenario.actuation.command_unit
    return table_text(command_columns(robot), times, values)


def table_text(columns: Sequence[str], times: np.ndarray, values: np.ndarray) -> str:
    """CSV text with a row per time: `times` (rows,) in s in the column time_s, then `values` (rows,
    columns) in columns with the names `columns`."""
    table = pandas.DataFrame(values, columns=columns, index=pandas.Index(times, name=TIME_S))
    return table.reset_index().to_csv(index=False, float_format="%.6f")


def scenario_beside(path: Path) -> Path | None:
    """Path of the file scenario.yaml in the folder of the command file `path`; None if there is
    none."""
    scenario = path.parent / SCENARIO
    return scenario if os.path.isfile(scenario) else None


def load_command(path: str | Path, scenario: GivenScenario) -> Command:
    """Reads a command file, setpoints of the actuators over time, for a scenario's robot.

        >>> scenario = td.load_scenario("quick")
        >>> command = td.load_command("lab/command.csv", scenario)
        >>> result = td.simulate(scenario, command=command)

    Args:
        path: the CSV file: a column time_s and one per driven cable, as export() writes. Columns
            may be in any order; times are evenly spaced and begin at 0.
        scenario: the scenario of the robot, its name or file, or a run.

    Returns:
        The command with setpoints in SI units, named after the file.

    Raises:
        InputError: names file and line, if the file is wrong or does not fit the robot.
    """
    path, scenario = given_path(path, "load_command", "path"), given_scenario(scenario)
    robot, text = Robot.of(scenario), read_text(path, "command file")
    wanted = [TIME_S, *command_columns(robot)]
    cells = table_cells(text, path, wanted=wanted)
    table = np.column_stack([column_numbers(cells[name], path) for name in wanted])
    times, least = table[:, 0], scenario.cpg.listing_step
    if len(times) < 2 or abs(times[0]) > 1e-6:
        raise InputError(path, TIME_S, "expected at least two samples, the first at 0")
    period = float(np.median(np.diff(times)))
    if period < (1.0 - _UNEVEN) * least:
        problem = f"found samples {period:g} s apart, expected at least {least:g} s"
        raise InputError(path, TIME_S, problem)
    for row in np.flatnonzero(np.abs(np.diff(times) - period) > _UNEVEN * period):
        problem = f"found {times[row + 1]:g} after {times[row]:g}, expected {period:g} s more"
        raise InputError(path, f"line {row + 3}, {TIME_S}", problem)
    samples = scenario.actuation.command_unit * table[:, 1:]
    return Command(path.name, float(times[-1]) / (len(times) - 1), samples)


def table_cells(
    text: str, path: str | Path, *, wanted: Sequence[str] | None = None
) -> pandas.DataFrame:
    """Cells of a CSV table as texts, so that messages can show them.

    `text` is the content, `path` names the file in messages. Raises InputError if it is no table, a
    column is given twice, or the columns are not the `wanted` ones, in any order. Without `wanted`,
    all columns are accepted.
    """
    try:
        heading, *rows = csv.reader(io.StringIO(text.rstrip()), strict=True)
    except (csv.Error, ValueError) as error:  # an empty file, too
        raise InputError(path, "", "is no table with commas between cells") from error
    if wanted is not None and set(heading).isdisjoint(wanted):
        # The file may be any, so nothing of it is shown.
        raise InputError(path, "", f"has no column of a command; {hint('', wanted)}")
    for name in [*heading, *(wanted or ())]:
        if wanted is not None and name not in wanted:
            raise InputError(path, name, f"is no column of this robot; {hint(name, wanted)}")
        if (count := heading.count(name)) != 1:
            raise InputError(path, name, "is missing" if count == 0 else "is given twice")
    for line, row in enumerate(rows, start=2):
        if len(row) != len(heading):
            problem = f"found {len(row)} cells, expected {len(heading)}"
            raise InputError(path, f"line {line}", problem)
    return pandas.DataFrame(rows, columns=heading, dtype=str)


def column_numbers(cells: pandas.Series, path: str | Path, *, gaps: bool = False) -> np.ndarray:
    """Numbers (rows,) of a column whose cells are texts, from table_cells().

    With `gaps`, an empty cell becomes NaN. Raises InputError, naming the file `path` and the line,
    for any other cell that is not a finite number.
    """
    numbers = pandas.to_numeric(cells, errors="coerce").to_numpy(dtype=float)
    is_gap = gaps & (cells.str.strip() == "").to_numpy()
    for row in np.flatnonzero(~np.isfinite(numbers) & ~is_gap):
        problem = f"found '{cells[row]}', expected a number"
        raise InputError(path, f"line {row + 2}, {cells.name}", problem)
    return numbers
