"""The loads on the actuators of a walk, beside what they can do."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pandas
import xarray

from tetra_drake.physics.actuator import (
    DIRECT,
    WINCH,
    ActuatorForce,
    Limits,
    actuator_force,
)
from tetra_drake.physics.cable import CableLaw, cable_tension
from tetra_drake.results.metrics import steady_start
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
    """Peaks at any time and means over the steady stretch, a row for each driven cable, with units
    in the names; NaN where there is no limit. What is wound is the free length with winches, else
    the cable."""


def actuator_loads(robot: Robot, trajectory: xarray.Dataset) -> Loads:
    """The loads in a trajectory of a robot that walks by a gait."""
    cables, actuator = robot.structure.cables[robot.driven], robot.model.actuator
    law, limits = CableLaw(*(cables[name] for name in CableLaw._fields)), Limits(*actuator.limits)
    walk = trajectory.isel(cable=robot.driven)
    tension, length, free_length = walk.tension.values, walk.length.values, walk.free_length.values
    signal = trajectory.signal.values[:, cables["signal"]]
    a, b = cables["node_a"], cables["node_b"]
    p_WN, v_WN = trajectory.p_WN.values, trajectory.v_WN.values
    rate = ((p_WN[:, b] - p_WN[:, a]) * (v_WN[:, b] - v_WN[:, a])).sum(axis=2) / length

    @np.vectorize
    def pull(drive: float, length: float, rate: float, signal: float, *law: float) -> ActuatorForce:
        return actuator_force(actuator, drive, length, rate, signal, CableLaw(*law))

    if actuator.kind == DIRECT:
        commands, left, limited = signal, length, np.full_like(length, math.nan)
    elif actuator.kind == WINCH:
        commands, left = law.free_length - signal / law.stiffness, free_length
        _, _, rate, limited = pull(left + _HAIR, length, rate, signal, *law)
    else:
        commands = np.clip(cable_tension(length, rate, signal, law), 0.0, limits.max_force)
        left, limited = length, pull(tension + _HAIR, length, rate, signal, *law)[3]
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
    return Loads(commands, limited, pandas.DataFrame(columns, index=walk.cable.to_index()))


def _mean(samples: np.ndarray) -> np.ndarray:
    """The mean of each column; NaN without samples, as in a simulation that ends before it is
    steady."""
    return samples.mean(axis=0) if len(samples) else np.full(samples.shape[1], math.nan)
