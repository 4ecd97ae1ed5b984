"""Loads on the actuators in a simulation, and the actuators' limits."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pandas
import xarray

from tetra_drake.laws import actuator
from tetra_drake.laws.actuator import DrivenCables
from tetra_drake.laws.cable import CableLaw
from tetra_drake.robot.robot import Robot

_TOLERANCE = 1e-9
"""Distance (m or N) from a limit that still counts as at the limit. Without it, the tension of a
motor would never be at its limit."""


class Loads(NamedTuple):
    """Loads on the actuators of the driven cables in a simulation."""

    commands: np.ndarray
    """Setpoints (times, driven cables); samples of a Command."""
    limited: np.ndarray
    """1 where a limit binds, otherwise 0 (times, driven cables); NaN without limits."""
    table: pandas.DataFrame
    """A row per driven cable, with units in the names of the columns: peaks, and means over the
    steady stretch. Limits that do not exist are NaN. Forces and lengths are as in
    laws.actuator.Exertion."""


def actuator_loads(robot: Robot, trajectory: xarray.Dataset) -> Loads:
    """Loads on the actuators in a trajectory of a robot."""
    kind, constants = robot.scenario.actuation, robot.model.actuator
    cables, limits = robot.structure.cables[robot.driven], actuator.Limits(*constants.limits)
    walk = trajectory.isel(cable=robot.driven)
    law, length, tension = CableLaw.of(cables), walk.length.values, walk.tension.values
    signal = trajectory.signal.values[:, cables["signal"]]
    a, b = cables["node_a"], cables["node_b"]
    p_WN, v_WN = trajectory.p_WN.values, trajectory.v_WN.values
    rate = ((p_WN[:, b] - p_WN[:, a]) * (v_WN[:, b] - v_WN[:, a])).sum(axis=2) / length

    driven = DrivenCables(law, signal, length, rate, tension, walk.free_length.values)
    load, left, limited = tension, length, np.full_like(length, math.nan)
    drives = kind.drives(driven)

    @np.vectorize
    def pull(
        drive: float, length: float, rate: float, signal: float, *law: float
    ) -> actuator.ActuatorForce:
        return actuator.actuator_force(constants, drive, length, rate, signal, CableLaw(*law))

    if actuator.has_drive(constants):
        _, _, drive_rate, limited, beside = pull(drives + _TOLERANCE, length, rate, signal, *law)
        load, left = tension - beside, actuator.wound(constants, drives, length)
        rate = actuator.wound(constants, drive_rate, rate)
    settling_time, start_up = robot.scenario.simulation.settling_time, robot.scenario.cpg.start_up
    power, steady = -load * rate, trajectory.time.values >= max(settling_time, start_up)
    columns = {
        "peak_force_N": load.max(axis=0),
        "limit_of_force_N": limits.max_force,
        "peak_speed_mm_per_s": 1e3 * np.abs(rate).max(axis=0),
        "limit_of_speed_mm_per_s": 1e3 * limits.max_speed,
        "travel_mm": 1e3 * np.ptp(left, axis=0),
        "least_length_mm": 1e3 * left.min(axis=0),
        "limit_of_length_mm": 1e3 * limits.least_length,
        "peak_power_W": power.max(axis=0),
        "limit_of_power_W": 0.25 * limits.max_force * limits.max_speed,  # at half limits
        "mean_power_W": _mean(np.maximum(power, 0.0)[steady]),
        "time_at_a_limit_percent": 100.0 * _mean(limited[steady]),
    }
    table = pandas.DataFrame(columns, index=walk.cable.to_index())
    return Loads(kind.commands(driven), limited, table)


def _mean(samples: np.ndarray) -> np.ndarray:
    """Mean of each column. NaN without samples: a simulation may end before its steady stretch."""
    return samples.mean(axis=0) if len(samples) else np.full(samples.shape[1], math.nan)
