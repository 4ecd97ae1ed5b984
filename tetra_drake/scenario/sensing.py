"""Sensors of a robot: the errors with which policies and controllers see its readings."""

from __future__ import annotations

import operator
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from tetra_drake.settings.quantities import by_name
from tetra_drake.settings.section import Section

UNITS = {"lengths": "m", "rates": "m/s", "tensions": "N", "normal_forces": "N"}
UNITS |= {"q_WB": "rad", "w_WB": "rad/s", "p_WN": "m", "v_WN": "m/s"}
"""Units of the errors of readings, by the names of the readings; see robot.readings.Readings."""


def _positive(number: Any) -> Any:
    """The type of a number that is not negative."""
    return Annotated[number, Field(ge=0)]


Errors = Annotated[dict[str, float], *by_name(UNITS, _positive)]
Delays = Annotated[dict[str, float], *by_name(dict.fromkeys(UNITS, "s"), _positive)]


class Sensing(Section):
    """Errors of the sensors through which policies and controllers see a robot, by the names of the
    readings; see the class Readings. What is not named is seen exactly. Orientations q_WB have
    errors about each axis of the body."""

    noise: Errors = Field(default={}, exclude_if=operator.not_)
    """Standard deviation of each number, anew in each control period."""
    bias: Errors = Field(default={}, exclude_if=operator.not_)
    """Standard deviation of the constant error of each sensor."""
    resolution: Errors = Field(default={}, exclude_if=operator.not_)
    """Step of the numbers that are read; of the components of a quaternion, half of it."""
    delay: Delays = Field(default={}, exclude_if=operator.not_)
    """Age of the numbers that are read, a multiple of the control period. Before, the robot is seen
    at its start."""
    seed: int = Field(default=0, ge=0)
    """Seed of noise and constant errors. A draw of disturbances, or a seed of td.Simulation, takes
    its place."""

    def seen(self, name: str, exact: Any, *, step: int) -> np.ndarray:
        """What the sensors show of the reading called `name`, whose exact numbers are `exact`, in
        the control period of number `step`."""
        width = (*np.shape(exact)[:-1], 3) if name == "q_WB" else np.shape(exact)
        error = np.zeros(width)
        for scale, when in ((self.bias, 0), (self.noise, step + 1)):
            if name in scale:
                random = np.random.default_rng([self.seed, [*UNITS].index(name), when])
                error += scale[name] * random.standard_normal(width)
        rounded = self.resolution.get(name, 0.0)
        if name != "q_WB":
            return _rounded(exact + error, rounded)
        seen = _rounded(_turned(exact, error), 0.5 * rounded)
        return seen / np.linalg.norm(seen, axis=-1, keepdims=True)


def _rounded(values: np.ndarray, step: float) -> np.ndarray:
    return step * np.round(values / step) if step else values


def _turned(q_WB: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Quaternions (..., 4), w first, after rotations by vectors (..., 3) in rad in the body's
    frame."""
    from scipy.spatial.transform import Rotation

    turned = Rotation.from_quat(np.roll(q_WB, -1, axis=-1)) * Rotation.from_rotvec(vectors)
    seen = np.roll(turned.as_quat(), 1, axis=-1)
    return np.where((seen * q_WB).sum(axis=-1, keepdims=True) < 0.0, -seen, seen)
