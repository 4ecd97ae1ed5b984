"""Kinds of actuators: what the signals of the oscillators do to the cables."""

from typing import Annotated, ClassVar

from tetra_drake.scenario.sections import Kinds, Section, quantity


class Force(Section):
    """Signals are forces, superimposed on cables without limits (thesis section 2.1.3)."""

    lacking: ClassVar[tuple[str, ...]] = ("actuator_limited",)
    """Metrics that walks with such actuators do not have."""


class Winch(Section):
    """A winch on each driven cable, which then never pushes: signals command its free length.

    It winds at most at max_speed (1 - tension / max_force); above max_force it is driven backward.
    """

    lacking: ClassVar[tuple[str, ...]] = ()

    max_force: float = quantity("N", gt=0)
    max_speed: float = quantity("m/s", gt=0)
    time_constant: float = quantity("s", gt=0)
    """Time constant of the lag with which the free length follows its command."""
    least_length: float = quantity("m", default=0.0, ge=0)
    """Least free length of a cable."""


class TensionMotor(Section):
    """A motor on each driven cable that controls its tension: signals, spring and damper of the
    cable together command it.

    It pulls at most with max_force (1 - winding speed / max_speed), and never with more than
    max_force.
    """

    lacking: ClassVar[tuple[str, ...]] = ()

    max_force: float = quantity("N", gt=0)
    max_speed: float = quantity("m/s", gt=0)
    time_constant: float = quantity("s", gt=0)
    """Time constant of the lag with which the tension follows its command."""


ActuatorKind = Force | Winch | TensionMotor

Actuation = Annotated[ActuatorKind, Kinds()]
"""The tagged kinds of actuators; without a tag it is the first."""
