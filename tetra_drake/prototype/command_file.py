"""The file of a command: CSV with a column for the time, and one for each driven cable."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.files import read_text
from tetra_drake.physics.actuator import DIRECT, TENSION_MOTOR, WINCH
from tetra_drake.robot.command import Command
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.sections import hint

TIME = "time_s"

QUANTITIES = {
    DIRECT: ("force_N", 1.0),
    WINCH: ("free_length_mm", 1e-3),
    TENSION_MOTOR: ("tension_N", 1.0),
}
"""Quantity that each kind of actuators is commanded, and its unit in SI."""

_UNEVEN = 0.05
"""Largest error of the time between two samples, as a share of it: times may be rounded."""


def command_columns(robot: Robot) -> list[str]:
    """The columns of a robot's commands but for the time, such as "T1-T2 outer top tension_N"."""
    quantity, _ = QUANTITIES[robot.model.actuator.kind]
    return [f"{robot.structure.cable_names[cable]} {quantity}" for cable in robot.driven]


def command_text(robot: Robot, command: Command) -> str:
    """A command as the content of its file."""
    _, unit = QUANTITIES[robot.model.actuator.kind]
    times = command.period * np.arange(len(command.samples))
    return table_text(command_columns(robot), times, command.samples / unit)


def table_text(columns: Sequence[str], times: np.ndarray, values: np.ndarray) -> str:
    """CSV with times (s) and values, a row for each time."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow([TIME, *columns])
    np.savetxt(text, np.column_stack([times, values]), delimiter=",", fmt="%.6f")
    return text.getvalue()


def load_command(path: str | Path, scenario: Scenario) -> Command:
    """Reads the file of a command for a scenario's robot; columns may stand in any order.

    Raises InputError, naming file and place, for whatever is wrong in the file or does not fit.
    """
    return parse_command(read_text(path, "command file"), Robot.of(scenario), source=path)


def parse_command(text: str, robot: Robot, *, source: str | Path) -> Command:
    """The command in the content of its file; raises InputError, see load_command()."""
    names, wanted = _rows(text)[0], [TIME, *command_columns(robot)]
    for name in names:
        if name not in wanted:
            raise InputError(source, name, f"is no column of this robot; {hint(name, wanted)}")
    if sorted(names) != sorted(wanted):
        wrong = next(name for name in wanted if names.count(name) != 1)
        problem = f"found {names.count(wrong)} such columns, expected 1 of each driven cable"
        raise InputError(source, wrong, problem)
    table = _numbers(text, names, source)[:, [names.index(name) for name in wanted]]
    _, unit = QUANTITIES[robot.model.actuator.kind]
    period = _period(table[:, 0], robot.scenario.cpg.listing_step, source)
    return Command(Path(source).name, period, unit * table[:, 1:])


def _rows(text: str) -> list[list[str]]:
    return list(csv.reader(io.StringIO(text), skipinitialspace=True)) or [[]]


def _numbers(text: str, names: Sequence[str], source: str | Path) -> np.ndarray:
    """(samples, columns): the numbers below the heading."""
    rows = _rows(text)[1:]
    for line, row in enumerate(rows, start=2):
        if len(row) != len(names):
            problem = f"found {len(row)} cells, expected {len(names)}"
            raise InputError(source, f"line {line}", problem)
        for name, cell in zip(names, row, strict=True):
            if not _is_number(cell):
                raise InputError(
                    source, f"line {line}, {name}", f"found '{cell}', expected a number"
                )
    if len(rows) < 2:
        raise InputError(source, "", f"found {len(rows)} samples, expected at least 2")
    return np.array(rows, dtype=float)


def _is_number(cell: str) -> bool:
    try:
        return math.isfinite(float(cell))
    except ValueError:
        return False


def _period(times: np.ndarray, least: float, source: str | Path) -> float:
    """Time (s) between samples; InputError unless they are evenly spaced from 0 on."""
    if abs(times[0]) > 1e-6:
        raise InputError(source, f"line 2, {TIME}", f"found {times[0]:g}, expected 0")
    steps = np.diff(times)
    usual = float(np.median(steps))
    uneven = np.abs(steps - usual) > _UNEVEN * abs(usual)
    if uneven.any():
        first = int(uneven.argmax())
        problem = f"found {times[first + 1]:g} after {times[first]:g}, expected {usual:g} s more"
        raise InputError(source, f"line {first + 3}, {TIME}", problem)
    if usual < (1.0 - _UNEVEN) * least:
        problem = f"found samples {usual:g} s apart, expected at least {least:g} s"
        raise InputError(source, TIME, problem)
    return float(times[-1]) / len(steps)
