"""The loads on the actuators of a walk, beside what they can do."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pandas
import xarray

from tetra_drake.physics import actuator
from tetra_drake.physics.cable import CableLaw
from tetra_drake.results.metrics import steady_start
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.actuator_kinds import DrivenCables

_HAIR = 1e-9
"""m or N: a drive so near to a limit is at it, as the tension of a motor is never beyond."""


class Loads(NamedTuple):
    """What the actuators of the driven cables do in a walk."""

    commands: np.ndarray
    """(times, driven cables): the samples of a Command."""
    limited: np.ndarray
    """(times, driven cables): 1 where a limit binds, or else 0; NaN for forces without limits."""
    table: pandas.DataFrame
    """Peaks at any time and means over the steady stretch, a row for each driven cable, with units
    in the names; NaN where there is no limit. Lengths and speeds are those of physics.actuator's
    wound()."""


def actuator_loads(robot: Robot, trajectory: xarray.Dataset) -> Loads:
    """The loads in a trajectory of a robot that walks by a gait."""
    kind, constants = robot.scenario.actuation, robot.model.actuator
    cables, limits = robot.structure.cables[robot.driven], actuator.Limits(*constants.limits)
    walk = trajectory.isel(cable=robot.driven)
    law, length, tension = CableLaw.of(cables), walk.length.values, walk.tension.values
    signal = trajectory.signal.values[:, cables["signal"]]
    a, b = cables["node_a"], cables["node_b"]
    p_WN, v_WN = trajectory.p_WN.values, trajectory.v_WN.values
    rate = ((p_WN[:, b] - p_WN[:, a]) * (v_WN[:, b] - v_WN[:, a])).sum(axis=2) / length

    driven = DrivenCables(law, signal, length, rate, tension, walk.free_length.values)
    left, limited, drives = length, np.full_like(length, math.nan), kind.drives(driven)

    @np.vectorize
    def pull(
        drive: float, length: float, rate: float, signal: float, *law: float
    ) -> actuator.ActuatorForce:
        return actuator.actuator_force(constants, drive, length, rate, signal, CableLaw(*law))

    if actuator.has_drive(constants):
        _, _, drive_rate, limited = pull(drives + _HAIR, length, rate, signal, *law)
        left = actuator.wound(constants, drives, length)
        rate = actuator.wound(constants, drive_rate, rate)
    power, steady = -tension * rate, trajectory.time.values >= steady_start(robot.scenario)
    columns = {
        "peak_force_N": tension.max(axis=0),
        "limit_of_force_N": limits.max_force,
        "peak_speed_mm_per_s": 1e3 * np.abs(rate).max(axis=0),
        "limit_of_speed_mm_per_s": 1e3 * limits.max_speed,
        "travel_mm": 1e3 * np.ptp(left, axis=0),
        "least_length_mm": 1e3 * left.min(axis=0),
        "limit_of_length_mm": 1e3 * limits.least_length,
        "peak_power_W": power.max(axis=0),
        "limit_of_power_W": 0.25 * limits.max_force * limits.max_speed,  # half of both
        "mean_power_W": _mean(np.maximum(power, 0.0)[steady]),
        "time_at_a_limit_percent": 100.0 * _mean(limited[steady]),
    }
    table = pandas.DataFrame(columns, index=walk.cable.to_index())
    return Loads(kind.commands(driven), limited, table)


def _mean(samples: np.ndarray) -> np.ndarray:
    """The mean of each column; NaN without samples, as in a simulation that ends before it is
    steady."""
    return samples.mean(axis=0) if len(samples) else np.full(samples.shape[1], math.nan)
