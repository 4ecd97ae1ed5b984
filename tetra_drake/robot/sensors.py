"""Sensors of one robot, between its readings and the policy or controller that sees them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.robot.readings import Readings
from tetra_drake.scenario.sensing import UNITS
from tetra_drake.scenario.world import World


class Sensors:
    """Sensors of a robot, by its scenario's section `sensing`, and what they have yet to show.

    Attributes:
        recent: exact readings of the latest control periods, as far as the longest delay goes back,
            the latest ones last. They are the state of the sensors.
    """

    def __init__(self, scenario: World, period: float) -> None:
        """Makes the sensors of a robot that is read once in each control period (s). Raises
        InputError unless delays are multiples of it."""
        assert scenario.sensing is not None
        self._sensing, self._period, self._lags = scenario.sensing, period, dict[str, int]()
        for name, delay in scenario.sensing.delay.items():
            lag = self._lags[name] = round(delay / period)
            if abs(delay - lag * period) > 1e-6 * period:
                key = f"sensing.delay.{name}"
                expected = f"expected a multiple of the control period, {period:g} s"
                raise InputError(f"scenario {scenario.name}", key, f"found {delay:g} s, {expected}")
        self.recent: Sequence[Readings] = []
        self._first: Readings | None = None

    def __call__(self, exact: Readings) -> Readings:
        """What the sensors show of a robot's exact readings, which have no axis of robots. Earlier
        readings than the latest ones begin anew, from the start."""
        step = round(float(exact.time) / self._period)
        if self._lags:
            self._remember(exact.copied(), step)
        seen = {}
        for name in UNITS:
            late = self.recent[-1 - lag] if (lag := self._lags.get(name)) else exact
            seen[name] = self._sensing.seen(name, np.asarray(getattr(late, name)), step=step)
        return exact._replace(**seen)

    def _remember(self, now: Readings, step: int) -> None:
        longest = max(self._lags.values())
        times = [round(float(readings.time) / self._period) for readings in self.recent]
        latest = max(times, default=math.inf)
        if step == 0:
            self._first = now
        if step - latest not in (0, 1):  # from the start again, or put into another motion
            before = self._first if step < latest and self._first else now
            self.recent, latest = [before] * longest, step
        self.recent = [*self.recent[step != latest :][:longest], now]


def shown(exact: Readings, sensors: Mapping[int, Callable[[Readings], Readings]]) -> Readings:
    """Readings of robots (N, ...) as their sensors show them, written into the exact ones.
    `sensors` are by the row of their robot."""
    for row, own in sensors.items():
        exact.put(row, own(exact.rows(row)))
    return exact
