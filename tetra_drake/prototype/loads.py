"""The loads on the actuators of a walk, beside what they can do."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pandas
import xarray

from tetra_drake.physics.actuator import (
    DIRECT,
    WINCH,
    CableLaw,
    Limits,
    Pull,
    motor_pull,
    winch_pull,
)
from tetra_drake.robot.robot import Robot

_HAIR = 1e-9
"""m or N: a drive so near to a limit is at it, as the tension of a motor is never beyond."""


class Loads(NamedTuple):
    """What the actuators of the driven cables do in a walk."""

    commands: np.ndarray
    """(times, driven cables): the samples of a Command."""
    limited: np.ndarray
    """(times, driven cables): 1 where a limit binds, or else 0; NaN for forces without limits."""
    table: pandas.DataFrame
    """Peaks and means, a row for each driven cable, with units in the names; NaN where there is no
    limit. What is wound is the free length with winches, else the cable."""


def actuator_loads(robot: Robot, trajectory: xarray.Dataset) -> Loads:
    """The loads in a trajectory of a robot that walks by a gait."""
    driven, (kind, numbers) = robot.driven, robot.model.actuator
    laws, limits = robot.structure.cables[driven], Limits(*numbers)
    length, tension = (trajectory[name].values[:, driven] for name in ("length", "tension"))
    signal, left = trajectory.signal.values[:, laws["signal"]], length
    a, b = laws["node_a"], laws["node_b"]
    p_WN, v_WN = trajectory.p_WN.values, trajectory.v_WN.values
    rate = ((p_WN[:, b] - p_WN[:, a]) * (v_WN[:, b] - v_WN[:, a])).sum(axis=2) / length
    if kind == DIRECT:
        limited, unlimited = np.full_like(rate, math.nan), Limits(*[math.nan] * len(numbers))
        return Loads(signal, limited, _table(robot, tension, -rate, left, limited, unlimited))
    pull_of: Callable[..., Pull] = winch_pull if kind == WINCH else motor_pull
    drive = trajectory.free_length.values[:, driven] if kind == WINCH else tension

    def rate_of_drive(*now: float) -> tuple[float, float]:
        pull = pull_of(*now[:4], CableLaw(*now[4:]), limits)
        return pull.rate, pull.limited

    law = [laws[name] for name in CableLaw._fields]
    along = np.vectorize(rate_of_drive)
    drive_rate, limited = along(drive + _HAIR, length, rate, signal, *law)
    if kind == WINCH:
        commands, left, rate = laws["free_length"] - signal / laws["stiffness"], drive, drive_rate
    else:
        commands = tension + limits.time_constant * drive_rate
        limits = limits._replace(least_length=math.nan)
    return Loads(commands, limited, _table(robot, tension, -rate, left, limited, limits))


def _table(
    robot: Robot,
    tension: np.ndarray,
    speed: np.ndarray,
    left: np.ndarray,
    limited: np.ndarray,
    limits: Limits,
) -> pandas.DataFrame:
    """The table of Loads; all arrays are (times, driven cables), `speed` is that of winding."""
    power = tension * speed
    columns = {
        "peak_force_N": tension.max(axis=0),
        "limit_of_force_N": limits.max_force,
        "peak_speed_mm_per_s": 1e3 * np.abs(speed).max(axis=0),
        "limit_of_speed_mm_per_s": 1e3 * limits.max_speed,
        "travel_mm": 1e3 * np.ptp(left, axis=0),
        "least_length_mm": 1e3 * left.min(axis=0),
        "limit_of_length_mm": 1e3 * limits.least_length,
        "peak_power_W": power.max(axis=0),
        "limit_of_power_W": 0.25 * limits.max_force * limits.max_speed,  # half of both
        "mean_power_W": np.maximum(power, 0.0).mean(axis=0),
        "time_at_a_limit_percent": 100.0 * limited.mean(axis=0),
    }
    names = [robot.structure.cable_names[cable] for cable in robot.driven]
    return pandas.DataFrame(columns, index=pandas.Index(names, name="cable"))
