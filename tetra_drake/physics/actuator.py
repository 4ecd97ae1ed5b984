"""Actuators: what a signal does to the cable that it drives.

    direct         superimposes a force, without limits (Eq. 6)
    winch          winds the cable: its free length is a state, commanded as l0 - S / k
    tension motor  pulls the cable by force control: its tension is a state, commanded as the
                   whole law of the cable, of which spring and damper are played by software

A *drive* is the state of an actuator: of a winch the free length (m), of a tension motor the
tension (N). A direct force has none.
"""

from __future__ import annotations

import math
from typing import NamedTuple, Self

import numpy as np

from tetra_drake.physics.cable import CableLaw, cable_tension, elastic_tension
from tetra_drake.simd.compiling import inlined
from tetra_drake.simd.lanes import Real, Table, maximum, minimum, named, select

DIRECT, WINCH, TENSION_MOTOR = range(3)
"""Kinds of actuators."""

DRIVE, RATE, LIMITED, DRIVE_COLUMNS = range(4)
"""Columns of `drives`, a row for each driven cable whose actuator has one: the drive, its rate per
s, 1 where a limit binds or else 0; and their number."""


class Limits(NamedTuple):
    """What an actuator can do, in SI units; NaN where it has no limit."""

    max_force: Real = math.nan
    max_speed: Real = math.nan
    time_constant: Real = math.nan
    least_length: Real = math.nan


class Actuator(NamedTuple):
    """The actuators of all driven cables."""

    kind: int
    limits: Table
    """The numbers of Limits."""

    @classmethod
    def of(cls, kind: int, **limits: float) -> Self:
        """Actuators of a kind, with values of Limits by name."""
        return cls(kind, np.array(Limits(**limits)))


class ActuatorForce(NamedTuple):
    """What an actuator does to its cable."""

    tension: Real
    """N."""
    tension_per_rate: Real
    """dT/d(dl/dt), N s/m: how much the tension rises with the rate of the length."""
    rate: Real
    """Rate of the drive, per s."""
    limited: Real
    """1 where a limit binds, or else 0."""


@inlined
def has_drive(actuator: Actuator) -> bool:
    """True if the actuators have states."""
    return actuator.kind != DIRECT


@inlined
def wound(actuator: Actuator, drive: Table, otherwise: Table) -> Table:
    """The drive if it is the free length of a wound cable, or else `otherwise`; also of tables."""
    if actuator.kind == WINCH:
        return drive
    return otherwise


@inlined
def actuator_force(
    actuator: Actuator, drive: Real, length: Real, rate: Real, signal: Real, law: CableLaw
) -> ActuatorForce:
    """The force of an actuator that has a drive, for a cable of `length` that lengthens at
    `rate`."""
    limits = named(Limits, actuator.limits)
    if actuator.kind == WINCH:
        return winch_force(drive, length, rate, signal, law, limits)
    return motor_force(drive, length, rate, signal, law, limits)


@inlined
def winch_force(
    drive: Real, length: Real, rate: Real, signal: Real, law: CableLaw, limits: Limits
) -> ActuatorForce:
    """The force of a winch whose cable has a free length `drive`.

    It follows its command with a lag, pays out at max_speed at most, and winds at most at
    max_speed (1 - tension / max_force). Above max_force it is driven backward. The tension depends
    on the winding by the cable's damping, and the winding on the tension by the force-speed line:
    both are linear, so they are solved together. A command below least_length counts as
    least_length. So the winch slows down before that; a sudden stop there would be a jump of the
    tension, which no step of an integrator is short enough for.
    """
    elastic = elastic_tension(length - drive, law)
    wanted = (law.free_length - signal / law.stiffness - drive) / limits.time_constant
    allowed = maximum(wanted, (limits.least_length - drive) / limits.time_constant)
    allowed = minimum(allowed, limits.max_speed)
    per_force = limits.max_speed / limits.max_force
    stiffening = 1.0 + per_force * law.damping
    on_line = (per_force * (elastic + law.damping * rate) - limits.max_speed) / stiffening
    slowed = on_line > maximum(allowed, -limits.max_speed)
    winds = maximum(allowed, maximum(on_line, -limits.max_speed))
    tension = elastic + law.damping * (rate - winds)
    tension_per_rate = select(slowed, law.damping / stiffening, law.damping)
    return ActuatorForce(
        tension=maximum(tension, 0.0),
        tension_per_rate=select(tension > 0.0, tension_per_rate, 0.0),
        rate=winds,
        limited=select(winds != wanted, 1.0, 0.0),
    )


@inlined
def motor_force(
    drive: Real, length: Real, rate: Real, signal: Real, law: CableLaw, limits: Limits
) -> ActuatorForce:
    """The force of a tension motor of tension `drive`.

    It follows its command with a lag, pulls with max_force at most, and less the faster it winds:
    max_force (1 - winding speed / max_speed).
    """
    left = minimum(maximum(1.0 + rate / limits.max_speed, 0.0), 1.0)
    most = limits.max_force * left
    on_line = (drive > most) & (left > 0.0) & (left < 1.0)
    command = cable_tension(length, rate, signal, law)
    target = minimum(maximum(command, 0.0), limits.max_force)
    limited = (drive > most) | (command > limits.max_force)
    return ActuatorForce(
        tension=minimum(drive, most),
        tension_per_rate=select(on_line, limits.max_force / limits.max_speed, 0.0),
        rate=(target - drive) / limits.time_constant,
        limited=select(limited, 1.0, 0.0),
    )
