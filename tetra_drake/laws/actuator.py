"""Actuators: the effect of a signal S on the cable that it drives.

    direct         adds a force to the tension, without limits (Eq. 6)
    winch          winds the cable. Its state is the free length; the command is l0 - S / k
    tension motor  controls the tension. Its state is the tension; the command is the tension of
                   Eq. 6, so software imitates the spring and the damper of the cable

The state of an actuator is called its *drive*: the free length (m) of a winch, or the tension (N)
of a tension motor. A direct force has no drive.

To add a kind with a drive, write its number, its force function, a line in shipped_force(), and a
settings section. The force function also returns the tension that the cable's own spring and damper
exert beside the actuator. A kind of a plug-in has its force function in an ActuatorFunctions, and
the number of the kind that has the same state: WINCH or TENSION_MOTOR.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, NamedTuple, Self

import numpy as np
from pydantic import Field, model_validator

from tetra_drake.kernels.compiling import inlined
from tetra_drake.kernels.lanes import Real, Table, maximum, minimum, named, select
from tetra_drake.kernels.own import OwnFunctions, with_own
from tetra_drake.laws.cable import (
    CableLaw,
    cable_tension,
    elastic_tension,
    most_tension,
    slack_tension,
)
from tetra_drake.settings.quantities import ForceQuantity, Length, Speed, Time
from tetra_drake.settings.refusals import hint, refuse
from tetra_drake.settings.section import Kinds, Section
from tetra_drake.settings.units import quantity_to_si

LIMITS = "limited actuators"
"""Name of a property of robots: their actuators have limits. Some metrics need it."""

DIRECT, WINCH, TENSION_MOTOR = range(3)
"""Numbers of the kinds of actuators in kernels."""

SOFTEST = 1e-300
"""Least stiffness (N/m) in a quotient. A cut cable has none; its winch turns freely."""

DRIVE, RATE, LIMITED, BESIDE, DRIVE_COLUMNS = range(5)
"""Columns of the table `drives`, and their number: state of an actuator (its drive), rate of the
state per s, 1 if a limit binds or 0, and ActuatorForce.beside. Each actuator with a state has a
row."""


class Limits(NamedTuple):
    """Limits of an actuator in SI units; NaN without a limit."""

    max_force: Real = math.nan
    max_speed: Real = math.nan
    time_constant: Real = math.nan
    least_length: Real = math.nan


class Actuator(NamedTuple):
    """Kind and limits of a robot's actuators; all driven cables have the same."""

    kind: int
    constants: Table
    """The fields of Limits, or of the constants of `own`, as an array."""
    own: ActuatorFunctions | None = None
    """Functions of a plug-in's actuators."""


class ActuatorForce(NamedTuple):
    """Result of an actuator's law: tension of a driven cable, and rate of the actuator's state. The
    state (drive) is the free length (m) of a winch, or the tension (N) of a tension motor."""

    tension: Real
    """Tension in N."""
    tension_per_rate: Real
    """Derivative of the tension with respect to the rate of the length, dT/d(dl/dt), in N s/m."""
    rate: Real
    """Rate of the actuator's state, per s."""
    limited: Real
    """1 if a limit of the actuator binds, otherwise 0."""
    beside: Real
    """Part of the tension (N) that the cable's own spring and damper exert beside the actuator; 0
    if the actuator bears the whole tension."""


class Exertion(NamedTuple):
    """Forces of an actuator and length of its cable at an instant. Work and power are computed from
    them."""

    load: Real
    """Force (N) that the actuator bears. An ideal actuator counts as bearing the whole tension."""
    pull: Real
    """Force (N) that does the actuator's work: the signal of an ideal actuator, otherwise the
    load."""
    left: Real
    """Length (m) of cable that is not wound: free length for a winch, otherwise cable length."""
    limited: Real
    """1 if a limit of the actuator binds, otherwise 0."""


@dataclass(frozen=True)
class ActuatorFunctions(OwnFunctions):
    """Functions of the actuators of a plug-in. Constants with the names of Limits are limits."""

    force: Callable[..., ActuatorForce]
    """Tension and rate of the state, like winch_force(); arguments: drive, length, rate, signal,
    law of the cable, constants."""


def limits_of(actuator: Actuator) -> Limits:
    """Limits of actuators; NaN without a limit."""
    names = actuator.own.constants._fields if actuator.own else Limits._fields
    numbers = zip(names, actuator.constants.tolist(), strict=True)
    return Limits(**{name: number for name, number in numbers if name in Limits._fields})


@inlined
def has_drive(actuator: Actuator) -> bool:
    """True if the actuators have a state (drive): winches and tension motors."""
    return actuator.kind != DIRECT


@inlined
def wound(actuator: Actuator, drive: Any, otherwise: Any) -> Any:
    """Selects `drive` if the actuators are winches, whose state is the free length of the cable,
    and `otherwise` for other actuators. Both may be lengths (m) or their rates (m/s), as numbers or
    arrays."""
    if actuator.kind == WINCH:
        return drive
    return otherwise


@inlined
def exertion(
    actuator: Actuator, drives: Table, drive: int, tension: Real, length: Real, signal: Real
) -> Exertion:
    """Forces of an actuator whose cable has a tension (N), a length (m) and a signal (N).

    `drives` is the table (drives, DRIVE_COLUMNS) of the actuators' states, rates and limits.
    `drive` is the actuator's row in it. Ideal actuators, which add a force to the tension, have no
    row: `drive` is not used then.
    """
    if not has_drive(actuator):
        return Exertion(load=tension, pull=signal, left=length, limited=0.0 * length)
    load, left = tension - drives[drive, BESIDE], wound(actuator, drives[drive, DRIVE], length)
    return Exertion(load=load, pull=load, left=left, limited=drives[drive, LIMITED])


@inlined
def winch_force(
    drive: Real, length: Real, rate: Real, signal: Real, law: CableLaw, limits: Limits
) -> ActuatorForce:
    """Tension that a winch gives a cable with a length (m) that grows at a rate (m/s), and the rate
    of its state.

    The winch's state `drive` is the free length (m). Its command is the free length l0 - signal /
    k, with l0 and k from `law` and the signal in N. The cable goes slack as a passive one does; see
    laws.cable. The winch follows its command with a lag. It pays out with at most max_speed, and
    winds with at most max_speed (1 - tension / max_force). Above max_force the cable pulls it
    backward. The tension depends on the winding speed because of the cable's damping, and the
    winding speed depends on the tension because of the force-speed line. Both equations are linear,
    within limits, and are solved together. A command below least_length counts as least_length, so
    the winch slows down before it. A sudden stop would be a jump of the tension, which an
    integrator cannot handle.
    """
    elastic = elastic_tension(length - drive, law)
    stiffness = maximum(law.stiffness, SOFTEST)
    wanted = (law.free_length - signal / stiffness - drive) / limits.time_constant
    allowed = maximum(wanted, (limits.least_length - drive) / limits.time_constant)
    allowed = minimum(allowed, limits.max_speed)
    per_force = limits.max_speed / limits.max_force
    stiffening = 1.0 + per_force * law.damping
    on_line = (per_force * (elastic + law.damping * rate) - limits.max_speed) / stiffening
    on_line = minimum(on_line, per_force * most_tension(elastic) - limits.max_speed)
    slowed = on_line > maximum(allowed, -limits.max_speed)
    winds = maximum(allowed, maximum(on_line, -limits.max_speed))
    tension, tension_per_rate = slack_tension(elastic, rate - winds, law)
    return ActuatorForce(
        tension=tension,
        tension_per_rate=select(slowed, tension_per_rate / stiffening, tension_per_rate),
        rate=winds,
        limited=select(winds != wanted, 1.0, 0.0),
        beside=0.0 * drive,
    )


@inlined
def motor_force(
    drive: Real, length: Real, rate: Real, signal: Real, law: CableLaw, limits: Limits
) -> ActuatorForce:
    """Tension that a tension motor gives a cable with a length (m) that grows at a rate (m/s), and
    the rate of its state.

    The motor's state `drive` is the tension (N). Its command is the tension of Eq. 6 of the thesis,
    spring plus damper plus `signal` (N): software imitates the cable, but the motor does not push.
    The motor keeps its cable taut at any length. It follows its command with a lag. Its tension is
    at most max_force (1 - winding speed / max_speed). The winding speed is the speed at which the
    cable gets shorter.
    """
    left = minimum(maximum(1.0 + rate / limits.max_speed, 0.0), 1.0)
    most = limits.max_force * left
    on_line = (drive > most) & (left > 0.0) & (left < 1.0)
    command = cable_tension(length, rate, signal, law)
    target = minimum(maximum(command, 0.0), limits.max_force)
    limited = (drive > most) | (command > limits.max_force)
    return ActuatorForce(
        tension=law.intact * minimum(drive, most),
        tension_per_rate=select(on_line, law.intact * limits.max_force / limits.max_speed, 0.0),
        rate=(target - drive) / limits.time_constant,
        limited=select(limited, 1.0, 0.0),
        beside=0.0 * drive,
    )


@inlined
def shipped_force(law: Any, *more: Any) -> Any:
    """The function actuator_force() for an Actuator of this module, `law`."""
    limits = named(Limits, law.constants)
    if law.kind == WINCH:
        return winch_force(*more, limits)  # type: ignore[call-arg]
    if law.kind == TENSION_MOTOR:
        return motor_force(*more, limits)  # type: ignore[call-arg]
    raise ValueError("unknown kind of actuators")


actuator_force = with_own("force", shipped_force)
"""Tension that an actuator gives a cable, and the rate of the actuator's state: an ActuatorForce.

Arguments: Actuator; its state, which is the free length (m) of a winch or the tension (N) of a
tension motor; length (m) of the cable and its rate (m/s); actuation (N) that the controller wants;
constants of the cable. Raises ValueError for ideal actuators (kind DIRECT), which have no state.
"""


# Settings: a section for each kind of actuator.


class DrivenCables(NamedTuple):
    """Properties of the driven cables at one or several instants: arrays (..., driven cables), in
    SI units."""

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
        """Cables of these lengths (m) at rest, with signals (N) and their original free lengths.
        `length` and `signal` are arrays (driven cables,)."""
        rate: Any = np.zeros(len(length))
        tension = np.maximum(cable_tension(length, rate, signal, law), 0.0)
        return cls(law, signal, length, rate, tension, law.free_length)


class ActuatorKind(Section):
    """Base class for the settings of actuators. Each driven cable has an actuator.

    The methods here are for ideal actuators, which have no state.
    """

    kind: ClassVar[int]
    """Number of the kind in kernels, such as WINCH."""
    lacking: ClassVar[tuple[str, ...]] = ()
    """Properties, such as LIMITS, that some metrics need and these actuators do not have."""
    commanded: ClassVar[str]
    """Commanded quantity with its unit, such as force_N: the end of a column's name in command
    files."""
    command_unit: ClassVar[float] = 1.0
    """Unit of the commanded quantity in SI, such as 1e-3 for mm."""
    keeps_spring: ClassVar[bool] = False
    """True if the cable's own spring and damper act beside the actuator."""
    plays_cable: ClassVar[bool] = False
    """True if software imitates the spring and damper of the cable. A command then contains their
    effect."""

    own: ClassVar[ActuatorFunctions | None] = None
    """Functions of a plug-in's actuators; None for the actuators of this module."""

    def actuator(self) -> Actuator:
        """Kind and limits of the actuators for the kernels. The limits are the settings of this
        section: their names are the fields of Limits."""
        constants = self.own.table(self) if self.own else np.array(Limits(**dict(self)))
        return Actuator(self.kind, constants, self.own)

    def excess(self, signal: float, *, free_length: float) -> str:
        """Text for a message if signals up to `signal` (N) exceed the actuator's limits, such as
        "ask for 90 N, a motor pulls with 50 N at most"; otherwise empty.

        `free_length` (m) is the least free length that the signals command.
        """
        return ""

    def drives(self, cables: DrivenCables) -> Any:
        """States that the actuators (..., driven cables) have if their cables are as given: free
        lengths (m) of winches, or tensions (N) of tension motors. Empty if actuators have no
        state."""
        return cables.signal[..., :0]

    def commands(self, cables: DrivenCables) -> Any:
        """Setpoints of the actuators (..., driven cables) for the signals of given cables, in SI
        units: force, free length or tension, depending on the kind."""
        return cables.signal

    def signals(self, commands: Any, law: CableLaw) -> Any:
        """Signals (N) with the same effect as the setpoints `commands` (..., driven cables), which
        are forces, free lengths or tensions in SI units. `law` has the constants of the cables."""
        return commands


class Force(ActuatorKind):
    """Ideal actuators without limits: signals are forces that add to the cables' tensions (thesis
    section 2.1.3)."""

    kind = DIRECT
    lacking = (LIMITS,)
    commanded = "force_N"
    keeps_spring = True


MOTORS = {"AX-12A": (1.5, 59.0), "XM540-W270": (10.6, 30.0), "Pololu-4743": (2.06, 200.0)}
"""Stall torque (N m) and no-load speed (revolutions per minute) of motors with gears at 12 V. The
first two are from emanual.robotis.com/docs/en/dxl, pages ax-12a and xm540-w270; the third is from
Pololu's data sheet "37D Metal Gearmotors", Rev 1.2 (50:1, 210 kg mm)."""


class LimitedActuator(ActuatorKind):
    """An actuator of limited force and speed on each driven cable. The cable never pushes."""

    keys_of_files: ClassVar = {
        "motor": f"Motor whose data sheet gives max_force and max_speed: {', '.join(MOTORS)}.",
        "spool": "Radius of the spool that this motor turns.",
    }

    max_force: ForceQuantity = Field(gt=0)
    """Tension at which the actuator stalls. A greater one pulls a winch backward."""
    max_speed: Speed = Field(gt=0)
    """Speed at which the actuator winds a cable without tension."""
    time_constant: Time = Field(gt=0)
    """Time constant of the tension behind its command."""

    @model_validator(mode="before")
    @classmethod
    def _of_motor(cls, tree: Any) -> Any:
        """Replaces a motor and its spool by a force and a speed."""
        if not isinstance(tree, dict) or not cls.keys_of_files.keys() & tree.keys():
            return tree
        given = {"motor": "", "spool": ""} | tree
        motor, spool = str(given.pop("motor")), str(given.pop("spool"))
        if motor not in MOTORS:
            refuse("motor", f"found '{motor}'; {hint(motor, MOTORS)}")
        try:
            torque, speed, radius = *MOTORS[motor], quantity_to_si(spool, "m")
        except ValueError as error:
            refuse("spool", str(error))
        if radius <= 0.0:
            refuse("spool", f"found '{spool}', expected a radius above 0")
        winds = speed * math.tau / 60.0 * radius
        return given | {"max_force": f"{torque / radius!r} N", "max_speed": f"{winds!r} m/s"}


class Winch(LimitedActuator):
    """A winch on each driven cable. A signal S commands the free length l0 - S / k; k is the
    cable's stiffness, l0 its original free length. See laws.actuator."""

    kind = WINCH
    commanded = "free_length_mm"
    command_unit = 1e-3

    time_constant: Time = Field(default=0.02, gt=0)
    """Time constant of the free length behind its command; by default of small geared motors
    (8 Hz)."""
    least_length: Length = Field(default=0.0, ge=0)
    """Least free length to which the winch winds a cable."""

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

    kind = TENSION_MOTOR
    commanded = "tension_N"
    plays_cable = True

    def excess(self, signal: float, *, free_length: float) -> str:
        if signal <= self.max_force:
            return ""
        return f"ask for {signal:.3g} N, a motor pulls with {self.max_force:.3g} N at most"

    def drives(self, cables: DrivenCables) -> Any:
        return cables.tension

    def commands(self, cables: DrivenCables) -> Any:
        law, signal, length, rate, _, _ = cables
        return np.clip(cable_tension(length, rate, signal, law), 0.0, self.max_force)


Actuation = Annotated[Force | Winch | TensionMotor, Kinds(ActuatorKind)]
"""Settings of the actuators, of any kind. Without a YAML tag such as !Winch they are a Force."""
