"""Kinds of actuators: the effect of the oscillators' signals on the cables.

The kernels need numba, so functions import them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NamedTuple, Self

import numpy as np
from pydantic import Field

from tetra_drake.scenario.metrics import LIMITS
from tetra_drake.settings import quantities
from tetra_drake.settings.quantities import Length, Speed, Time
from tetra_drake.settings.section import Kinds, Section

if TYPE_CHECKING:
    from tetra_drake.laws.actuator import Actuator
    from tetra_drake.laws.cable import CableLaw


class DrivenCables(NamedTuple):
    """Properties of the driven cables: arrays (..., driven cables), in SI units."""

    law: CableLaw
    signal: Any
    length: Any
    rate: Any
    """Rate of the length, in m/s."""
    tension: Any
    free_length: Any
    """Free length; winches change it."""

    @classmethod
    def at_rest(cls, law: CableLaw, length: Any, signal: Any) -> Self:
        """Cables of these lengths (m) at rest, with signals (N), at their original free lengths."""
        from tetra_drake.laws.cable import cable_tension

        rate: Any = np.zeros(len(length))
        tension = np.maximum(cable_tension(length, rate, signal, law), 0.0)
        return cls(law, signal, length, rate, tension, law.free_length)


class ActuatorKind(Section):
    """Base class of the kinds of actuators. Each driven cable has an actuator."""

    lacking: ClassVar[tuple[str, ...]] = ()
    """Properties that some metrics need and these actuators do not have."""
    commanded: ClassVar[str]
    """Commanded quantity with its unit: the end of a column's name in command files."""
    command_unit: ClassVar[float] = 1.0
    """Size of the unit of `commanded` in SI."""
    plays_cable: ClassVar[bool] = False
    """True if software imitates the spring and damper of the cable. A command then contains their
    effect."""

    def actuator(self) -> Actuator:
        """The actuators in the form of the kernels."""
        raise NotImplementedError

    def excess(self, signal: float, *, free_length: float) -> str:
        """Text if signals up to `signal` (N) exceed the actuator's limits; empty if they do not.
        `free_length` (m) is the least commanded free length with these signals."""
        return ""

    def drives(self, cables: DrivenCables) -> Any:
        """States of the actuators (..., drives); see laws.actuator."""
        raise NotImplementedError

    def commands(self, cables: DrivenCables) -> Any:
        """Setpoints of the actuators, in SI units."""
        raise NotImplementedError

    def signals(self, commands: Any, law: CableLaw) -> Any:
        """Signals (N) with the same effect as setpoints (..., driven cables)."""
        return commands


class Force(ActuatorKind):
    """Ideal actuators: the signals are forces on the cables, without limits (thesis section
    2.1.3)."""

    lacking = (LIMITS,)
    commanded = "force_N"

    def actuator(self) -> Actuator:
        from tetra_drake.laws import actuator

        return actuator.Actuator.of(actuator.DIRECT)

    def drives(self, cables: DrivenCables) -> Any:
        return cables.signal[..., :0]

    def commands(self, cables: DrivenCables) -> Any:
        return cables.signal


class LimitedActuator(ActuatorKind):
    """An actuator of limited force and speed on each driven cable. The cable never pushes."""

    max_force: quantities.Force = Field(gt=0)
    """Tension at which the actuator stalls. A greater tension pulls a winch backward."""
    max_speed: Speed = Field(gt=0)
    """Speed without tension."""
    time_constant: Time = Field(gt=0)
    """Time constant of the lag with which the actuator follows its command."""


class Winch(LimitedActuator):
    """A winch on each driven cable: signals command its free length. See laws.actuator."""

    commanded = "free_length_mm"
    command_unit = 1e-3

    time_constant: Time = Field(default=0.02, gt=0)
    """Time constant of the lag with which the free length follows its command. The default is the
    1 / (2 pi f) of a position loop with a bandwidth f of 8 Hz, typical of small geared motors."""
    least_length: Length = Field(default=0.0, ge=0)
    """Least free length of a cable."""

    def actuator(self) -> Actuator:
        from tetra_drake.laws import actuator

        return actuator.Actuator.of(actuator.WINCH, **dict(self))

    def excess(self, signal: float, *, free_length: float) -> str:
        if free_length >= self.least_length:
            return ""
        asked, least = 1e3 * free_length, 1e3 * self.least_length
        return f"ask for a free length of {asked:.3g} mm, a winch winds to {least:.3g} mm at least"

    def drives(self, cables: DrivenCables) -> Any:
        return cables.free_length

    def commands(self, cables: DrivenCables) -> Any:
        return cables.law.free_length - cables.signal / cables.law.stiffness

    def signals(self, commands: Any, law: CableLaw) -> Any:
        return law.stiffness * (law.free_length - commands)


class TensionMotor(LimitedActuator):
    """A motor on each driven cable that controls the tension. The commanded tension is the sum of
    the signal and the forces of the cable's spring and damper. See laws.actuator."""

    commanded = "tension_N"
    plays_cable = True

    def actuator(self) -> Actuator:
        from tetra_drake.laws import actuator

        return actuator.Actuator.of(actuator.TENSION_MOTOR, **dict(self))

    def excess(self, signal: float, *, free_length: float) -> str:
        if signal <= self.max_force:
            return ""
        return f"ask for {signal:.3g} N, a motor pulls with {self.max_force:.3g} N at most"

    def drives(self, cables: DrivenCables) -> Any:
        return cables.tension

    def commands(self, cables: DrivenCables) -> Any:
        from tetra_drake.laws.cable import cable_tension

        law, signal, length, rate, _, _ = cables
        return np.clip(cable_tension(length, rate, signal, law), 0.0, self.max_force)


Actuation = Annotated[Force | Winch | TensionMotor, Kinds()]
"""Union of the kinds of actuators. A mapping without a tag is of the first kind."""
