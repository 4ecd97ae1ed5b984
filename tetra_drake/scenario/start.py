"""Start of a robot: how its bodies are turned and move at t = 0. A push, too."""

from __future__ import annotations

import math
import operator
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field, model_validator

from tetra_drake.settings.quantities import THREE, Angle, Keyed, quantity
from tetra_drake.settings.refusals import refuse
from tetra_drake.settings.section import Section

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

_NONE = Field(default=[0.0, 0.0, 0.0])


class Turn(Section):
    """Rotation: about an axis; then by roll, pitch and yaw about x, y and z of the world."""

    axis: Annotated[list[float], THREE] = Field(default=[0.0, 0.0, 1.0])
    angle: Angle = 0.0
    roll: Angle = 0.0
    pitch: Angle = 0.0
    yaw: Angle = 0.0

    @model_validator(mode="after")
    def _check(self) -> Turn:
        if not 0.0 < math.hypot(*self.axis) < math.inf:
            refuse("axis", f"found {self.axis}, expected a direction")
        return self


class BodyStart(Section):
    """Start of one body, in addition to the robot's."""

    velocity: Annotated[list[Annotated[float, *quantity("m/s")]], THREE] = _NONE
    """Velocity [x, y, z] of the centre of mass."""
    spin: Annotated[list[Annotated[float, *quantity("rad/s")]], THREE] = _NONE
    """Angular velocity [x, y, z], about the centre of mass."""
    turned: Turn | None = Field(default=None, exclude_if=operator.not_)
    """Rotation about the centre of mass: about `axis` by `angle`, then by roll, pitch and yaw."""

    @property
    def rotation(self) -> Rotation:
        """The rotation as SciPy has it."""
        from scipy.spatial.transform import Rotation

        turn = self.turned or Turn()
        about_axis = turn.angle * np.divide(turn.axis, math.hypot(*turn.axis))
        after = Rotation.from_euler("xyz", [turn.roll, turn.pitch, turn.yaw])
        return after * Rotation.from_rotvec(about_axis)


class Start(BodyStart):
    """Start of a robot, along the axes of the world or of an incline. It may not move what the
    world or a joint holds. Feet that turn into the ground raise the robot."""

    rest: bool = True
    """True to start from equilibrium, False from the positions in the file."""
    bodies: Keyed[str, BodyStart] = Field(default={})
    """What bodies have in addition, by their names."""


class Push(Section):
    """Impulse on a body or a node."""

    impulse: Annotated[list[Annotated[float, *quantity("N*s")]], THREE]
    """Impulse [x, y, z], along the axes of the world."""
    on: str
    """Name of a node, or of a body, which is pushed at its centre of mass."""
