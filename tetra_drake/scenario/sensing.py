"""Sensors of a robot: the errors with which policies and controllers see its readings."""

from __future__ import annotations

import operator
from typing import Annotated, Any

import numpy as np
from pydantic import Field, model_validator

from tetra_drake.settings.quantities import by_name
from tetra_drake.settings.refusals import refuse
from tetra_drake.settings.section import Section

UNITS = {"lengths": "m", "rates": "m/s", "tensions": "N", "normal_forces": "N"}
UNITS |= {"q_WB": "rad", "w_WB": "rad/s", "p_WN": "m", "v_WN": "m/s"}
"""Units of the errors of readings, by the names of the readings; see robot.readings.Readings."""

Errors = Annotated[dict[str, float], *by_name(UNITS)]
Delays = Annotated[dict[str, float], *by_name(dict.fromkeys(UNITS, "s"))]


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

    @model_validator(mode="after")
    def _check(self) -> Sensing:
        for key in ("noise", "bias", "resolution", "delay"):
            for name, number in getattr(self, key).items():
                if number < 0.0:
                    refuse(f"{key}.{name}", f"found {number:g}, expected 0 or more")
        return self

    def seen(self, name: str, exact: Any, *, step: int) -> np.ndarray:
        """What the sensors show of the reading called `name`, whose exact numbers are `exact`, in
        the control period of number `step`."""
        number = [*UNITS].index(name)
        width = (*np.shape(exact)[:-1], 3) if name == "q_WB" else np.shape(exact)
        error = np.zeros(width)
        for scale, when in ((self.bias, 0), (self.noise, step + 1)):
            if name in scale:
                random = np.random.default_rng([self.seed, number, when])
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
