"""Driven robots: robots with the source of their signals.

A network of oscillators makes the signals of a gait. Otherwise they are given: by a command
beforehand, or by a controller while the robot moves.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Self

import numpy as np

from tetra_drake.laws.feedback import Gains, Senses
from tetra_drake.laws.oscillator import Network
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.network import SteeringSignal
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.signals import interpolated, sample_count, signal_samples

MARK_DECIMALS = 9
"""Decimals of the times (s) at which a step must end. A step between two times that differ in
rounding would be too short."""


@dataclass(frozen=True, eq=False, kw_only=True)
class DrivenRobot:
    """A robot with the source of its signals: a gait, or given signals."""

    robot: Robot
    name: str
    """Name of the source of the signals."""
    samples: np.ndarray
    """Given signals (k, m) in N at multiples of `cpg.listing_step`, linear in between. The last
    ones are held. A controller gives the first ones, a command at least two, a gait none."""
    gait: Gait | None = None
    """The gait whose network makes the signals; None if they are given."""
    steering: SteeringSignal | None = None
    """The turn, in place of the gait's."""

    @classmethod
    def of(cls, robot: Robot, gait: Gait, *, steering: SteeringSignal | None = None) -> Self:
        """A robot driven by the network of a gait."""
        none = np.zeros((0, robot.structure.signals))
        return cls(robot=robot, name=gait.name, samples=none, gait=gait, steering=steering)

    @property
    def start_up(self) -> float:
        """Time (s) from which the signals act."""
        return self.robot.scenario.cpg.start_up if self.gait else 0.0

    @property
    def steady_start(self) -> float:
        """Start (s) of the steady stretch. Mean values are over this stretch."""
        return max(self.robot.scenario.simulation.settling_time, self.start_up)

    @property
    def is_controlled(self) -> bool:
        """True if a controller sets the signals while the robot moves."""
        return len(self.samples) == 1

    @property
    def is_live(self) -> bool:
        """True if a network is integrated together with the robot."""
        return self.gait is not None and self.robot.scenario.cpg.signals == "live"

    @property
    def sample_count(self) -> int:
        """Number of samples of the signals."""
        return sample_count(self.robot) if self.gait else len(self.samples)

    def signals_at(self, times: np.ndarray) -> np.ndarray:
        """Signals (times, m) in N at `times` (s); zero before the start-up time."""
        step = self.robot.scenario.cpg.listing_step
        return interpolated(self._all_samples, times, step=step, start_up=self.start_up)

    @functools.cached_property
    def _all_samples(self) -> np.ndarray:
        """Samples (k, m) in N of the signals, a network's included."""
        if self.gait is None:
            return self.samples
        return signal_samples(self.robot, self.gait, self.steering)

    @property
    def changes(self) -> dict[float, np.ndarray]:
        """Signals (m,) in N after each change of the given signals, by the time (s) at which the
        change begins."""
        begins = self.robot.scenario.cpg.listing_step * self._changing
        after = self.samples[self._changing + 1]
        return dict(zip(begins.round(MARK_DECIMALS).tolist(), after, strict=True))

    @functools.cached_property
    def _changing(self) -> np.ndarray:
        """Indices of the given samples that differ from the next."""
        return np.flatnonzero((np.diff(self.samples, axis=0) != 0.0).any(axis=1))

    @functools.cached_property
    def marks(self) -> np.ndarray:
        """Times (s) at which a step must end, ascending: start, start-up, `simulation.steady_from`,
        end, and where a change of the given signals begins or ends."""
        settings, step = self.robot.scenario.simulation, self.robot.scenario.cpg.listing_step
        ends = step * np.add.outer([0, 1], self._changing).ravel()
        instants = np.append([0.0, settings.settling_time, self.start_up], ends)
        marks = np.unique(instants.round(MARK_DECIMALS))
        before = marks[marks < settings.duration - 0.5 * 10.0**-MARK_DECIMALS]
        return np.append(before, settings.duration)

    @property
    def network(self) -> Network:
        """Network that makes the signals. It has no neurons if the signals are given."""
        if self.gait is not None:
            return self.robot.network(self.gait)
        return Network.of(np.zeros((0, 0)), tau_a=1.0, tau_b=1.0, self_inhibition_weight=0.0)

    @property
    def senses(self) -> Senses:
        """Constants of the network's sensors."""
        return self.robot.senses if self.gait else self.robot.senses_of(())

    @property
    def gains(self) -> np.ndarray:
        """Gains of the network's feedback, in the order of PATHWAYS; zeros if there is none."""
        gains = self.gait.gains if self.gait else Gains()
        return np.array([gain for _, gain in gains])

    @property
    def turns(self) -> np.ndarray:
        """Steering, -1 to 1, at multiples of `cpg.listing_step`; see Robot.turns()."""
        return self.robot.turns(self.gait, self.steering) if self.gait else np.zeros(1)
