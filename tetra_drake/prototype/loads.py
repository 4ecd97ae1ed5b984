"""The loads on the actuators of a walk, beside what they can do."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from tetra_drake.formatting import Table, fixed
from tetra_drake.physics.actuator import (
    DIRECT,
    WINCH,
    CableLaw,
    Limits,
    Pull,
    motor_pull,
    winch_pull,
)
from tetra_drake.robot.robot import Robot

if TYPE_CHECKING:
    import xarray

_HAIR = 1e-9
"""m or N: a drive so near to a limit is at it, as the tension of a motor is never beyond."""


class Quantity(NamedTuple):
    """A number of each driven cable, in a unit that people read."""

    name: str
    unit: str
    values: np.ndarray
    """(driven cables,)."""
    limit: float | None = None
    """NaN if it is not known; None for a quantity without limit."""

    @property
    def column(self) -> str:
        """Its column in a file, such as "peak_speed_mm_per_s"."""
        unit = self.unit.replace("/", "_per_").replace("%", "percent")
        return f"{self.name.replace(' ', '_')}_{unit}"


@dataclass(frozen=True)
class Loads:
    """What the actuators of the driven cables do in a walk; SI units."""

    cables: tuple[str, ...]
    times: np.ndarray
    """(times,)."""
    commands: np.ndarray
    """(times, driven cables), as are the next ones: the samples of a Command."""
    tension: np.ndarray
    speed: np.ndarray
    """Winding speed."""
    left: np.ndarray
    """What is left to wind: the free length with winches, else the length of the cable."""
    limited: np.ndarray
    """1 where a limit binds, or else 0; NaN for forces, which have no limits."""
    limits: Limits
    """Those of each actuator; NaN where there is none."""

    @classmethod
    def of(cls, robot: Robot, trajectory: xarray.Dataset) -> Loads:
        """The loads in a trajectory of a robot that walks by a gait."""
        driven, (kind, numbers) = robot.driven, robot.model.actuator
        laws, limits = robot.structure.cables[driven], Limits(*numbers)
        length, tension = (trajectory[name].values[:, driven] for name in ("length", "tension"))
        signal = trajectory.signal.values[:, laws["signal"]]
        p_WN, v_WN = trajectory.p_WN.values, trajectory.v_WN.values
        p_AB = p_WN[:, laws["node_b"]] - p_WN[:, laws["node_a"]]
        v_AB = v_WN[:, laws["node_b"]] - v_WN[:, laws["node_a"]]
        rate = (p_AB * v_AB).sum(axis=2) / length
        commands, left, winding = signal, length, rate
        limited = np.full_like(rate, math.nan)
        if kind == DIRECT:
            limits = Limits(*[math.nan] * len(numbers))
        elif kind == WINCH:
            commands = laws["free_length"] - signal / laws["stiffness"]
            left = trajectory.free_length.values[:, driven]
            winding, limited = _drive_rates(winch_pull, left, length, rate, signal, laws, limits)
        else:
            drive = _drive_rates(motor_pull, tension, length, rate, signal, laws, limits)
            commands, limited = tension + limits.time_constant * drive[0], drive[1]
            limits = limits._replace(least_length=math.nan)
        return cls(
            cables=tuple(robot.structure.cable_names[cable] for cable in driven),
            times=trajectory.time.values,
            commands=commands,
            tension=tension,
            speed=-winding,
            left=left,
            limited=limited,
            limits=limits,
        )

    def quantities(self) -> list[Quantity]:
        """What a motor must be able to do."""
        power, limits = self.tension * self.speed, self.limits
        most_power = 0.25 * limits.max_force * limits.max_speed  # at half the force, half the speed
        least_length = 1e3 * limits.least_length
        return [
            Quantity("peak force", "N", self.tension.max(axis=0), limits.max_force),
            Quantity(
                "peak speed", "mm/s", 1e3 * abs(self.speed).max(axis=0), 1e3 * limits.max_speed
            ),
            Quantity("travel", "mm", 1e3 * np.ptp(self.left, axis=0)),
            Quantity("least length", "mm", 1e3 * self.left.min(axis=0), least_length),
            Quantity("peak power", "W", power.max(axis=0), most_power),
            Quantity("mean power", "W", np.maximum(power, 0.0).mean(axis=0)),
            Quantity("time at a limit", "%", 100.0 * self.limited.mean(axis=0)),
        ]

    def text(self) -> str:
        """The loads as CSV: a row for each driven cable; cells without a number are empty."""
        columns = {"cable": list(self.cables)}
        for quantity in self.quantities():
            columns[quantity.column] = [_cell(value) for value in quantity.values.tolist()]
            if quantity.limit is not None:
                columns[f"limit_of_{quantity.column}"] = [_cell(quantity.limit)] * len(self.cables)
        text = io.StringIO()
        rows = zip(*columns.values(), strict=True)
        csv.writer(text, lineterminator="\n").writerows([columns, *rows])
        return text.getvalue()

    def verdict(self) -> str:
        """The worst of all loads beside the limits, and whether the actuators can bear them."""
        rows = []
        for quantity in self.quantities():
            values, heading = quantity.values, f"{quantity.name} ({quantity.unit})"
            worst = values.min() if quantity.name.startswith("least") else values.max()
            rows.append(
                [
                    heading,
                    fixed(worst),
                    fixed(math.nan if quantity.limit is None else quantity.limit),
                ]
            )
        table = Table(["of all actuators", "worst", "limit"], rows).text()
        if math.isnan(self.limits.max_force):
            return f"{table}\nNo motor is given: one that plays this must bear these numbers."
        if not self.limited.any():
            return f"{table}\nThe actuators can play it: no limit binds."
        first, cable = np.argwhere(self.limited)[0].tolist()
        share = fixed(100.0 * self.limited.mean())
        place = f"first at {self.times[first]:.3f} s ({self.cables[cable]})"
        return (
            f"{table}\nThe actuators cannot play it: a limit binds {share} % of the time, {place}."
        )


def _drive_rates(
    pull: Callable[..., Pull],
    drive: np.ndarray,
    length: np.ndarray,
    rate: np.ndarray,
    signal: np.ndarray,
    laws: np.ndarray,
    limits: Limits,
) -> tuple[np.ndarray, np.ndarray]:
    """Rates of drives, and where limits bind, by the law of their actuators: arrays (times, driven
    cables)."""

    def one(*numbers: float) -> tuple[float, float]:
        state, law = numbers[:4], CableLaw(*numbers[4:])
        pulled = pull(*state, law, limits)
        return pulled.rate, pulled.limited

    law = (laws[name] for name in CableLaw._fields)
    rates, limited = np.vectorize(one)(drive + _HAIR, length, rate, signal, *law)
    return rates, limited


def _cell(value: float) -> str:
    """A number in a file; empty where it is NaN."""
    return "" if math.isnan(value) else f"{value:.6g}"
