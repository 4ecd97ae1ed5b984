"""Kinds of actuators: what the signals of the oscillators do to the cables.

Their kernels, which need numba, are imported only where a law is asked for.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, ClassVar

from pydantic import Field

from tetra_drake.scenario import quantities
from tetra_drake.scenario.quantities import Length, Speed, Time
from tetra_drake.scenario.section import Kinds, Section

if TYPE_CHECKING:
    from tetra_drake.physics.actuator import Actuator


class Force(Section):
    """Signals are forces, superimposed on cables without limits (thesis section 2.1.3)."""

    lacking: ClassVar[tuple[str, ...]] = ("actuator_limited",)
    """Metrics that walks with such actuators do not have."""

    def law(self) -> Actuator:
        """Law as the kernels take it."""
        from tetra_drake.physics.actuator import DIRECT, Actuator

        return Actuator.of(DIRECT)

    def excess(self, signal: float, *, free_length: float) -> str:
        """What signals up to `signal` (N) ask beyond the actuator's limits, of a cable whose
        commanded free length (m) then is least; empty if nothing."""
        return ""


class LimitedActuator(Section):
    """An actuator of limited force and speed on each driven cable, which then never pushes."""

    lacking: ClassVar[tuple[str, ...]] = ()

    max_force: quantities.Force = Field(gt=0)
    max_speed: Speed = Field(gt=0)
    time_constant: Time = Field(gt=0)
    """Time constant of the lag with which the actuator follows its command."""


class Winch(LimitedActuator):
    """A winch on each driven cable: signals command its free length.

    It winds at most at max_speed (1 - tension / max_force); above max_force it is driven backward.
    """

    time_constant: Time = Field(default=0.02, gt=0)
    """Time constant of the lag with which the free length follows its command. The default is the
    1 / (2 pi f) of a position loop with a bandwidth f of 8 Hz, as small geared motors have."""
    least_length: Length = Field(default=0.0, ge=0)
    """Least free length of a cable."""

    def law(self) -> Actuator:
        from tetra_drake.physics.actuator import WINCH, Actuator

        return Actuator.of(WINCH, **dict(self))

    def excess(self, signal: float, *, free_length: float) -> str:
        """See Force.excess()."""
        if free_length >= self.least_length:
            return ""
        asked, least = 1e3 * free_length, 1e3 * self.least_length
        return f"ask for a free length of {asked:.3g} mm, a winch winds to {least:.3g} mm at least"


class TensionMotor(LimitedActuator):
    """A motor on each driven cable that controls its tension: signals, spring and damper of the
    cable together command it.

    It pulls at most with max_force (1 - winding speed / max_speed), and never with more than
    max_force.
    """

    def law(self) -> Actuator:
        from tetra_drake.physics.actuator import TENSION_MOTOR, Actuator

        return Actuator.of(TENSION_MOTOR, **dict(self))

    def excess(self, signal: float, *, free_length: float) -> str:
        """See Force.excess()."""
        if signal <= self.max_force:
            return ""
        return f"ask for {signal:.3g} N, a motor pulls with {self.max_force:.3g} N at most"


Actuation = Annotated[Force | Winch | TensionMotor, Kinds()]
"""The tagged kinds of actuators; without a tag it is the first."""
