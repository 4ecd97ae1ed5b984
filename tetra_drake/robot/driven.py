"""Driven robots: robots with the source of their signals.

DrivenByGait    a network of oscillators makes the signals
DrivenRobot     a command gives them beforehand, or a controller while the robot moves
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Self

import numpy as np

from tetra_drake.laws.feedback import PATHWAYS, Senses
from tetra_drake.laws.oscillator import Network
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.robot import Robot, SteeringSignal
from tetra_drake.robot.signals import interpolated, sample_count, signal_samples

MARK_DECIMALS = 9
"""Decimals of the times (s) at which a step must end. A step between two times that differ in
rounding would be too short."""


@dataclass(frozen=True, eq=False, kw_only=True)
class DrivenRobot:
    """A robot whose signals are given: by a command, or by a controller (see Batch.advance)."""

    robot: Robot
    name: str
    """Name of the source of the signals."""
    samples: np.ndarray
    """Given signals (k, m) in N at multiples of `cpg.listing_step`, linear in between. The last
    ones are held. A controller gives the first ones, a command at least two."""
    gait: Gait | None = None

    @property
    def start_up(self) -> float:
        """Time (s) from which the signals act."""
        return 0.0

    @property
    def steady_start(self) -> float:
        """Start (s) of the steady stretch. Mean values are over this stretch."""
        return max(self.robot.scenario.simulation.settling_time, self.start_up)

    @property
    def is_controlled(self) -> bool:
        """True if a controller gives further signals."""
        return len(self.samples) == 1

    @property
    def sample_count(self) -> int:
        """Number of samples of the signals."""
        return len(self.samples)

    def signals_at(self, times: np.ndarray) -> np.ndarray:
        """Signals (times, m) in N at `times` (s)."""
        step = self.robot.scenario.cpg.listing_step
        return interpolated(self._known, times, step=step, start_up=self.start_up)

    @property
    def _known(self) -> np.ndarray:
        """Samples (k, m) in N of the signals, a network's included."""
        return self.samples

    @property
    def changes(self) -> dict[float, np.ndarray]:
        """Signals (m,) in N after each change, by the time (s) at which it begins: one of the
        marks."""
        begins = self.robot.scenario.cpg.listing_step * self._changing
        after = self.samples[self._changing + 1]
        return dict(zip(begins.round(MARK_DECIMALS).tolist(), after, strict=True))

    @functools.cached_property
    def _changing(self) -> np.ndarray:
        """Indices of the samples that differ from the next."""
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
    def is_live(self) -> bool:
        """True if a network is integrated together with the robot."""
        return False

    @property
    def network(self) -> Network:
        """The network that makes the signals; one without neurons if none does."""
        return Network.of(np.zeros((0, 0)), tau_a=1.0, tau_b=1.0, self_inhibition_weight=0.0)

    @property
    def senses(self) -> Senses:
        """Constants of the network's sensors."""
        return self.robot.senses_of(())

    @property
    def gains(self) -> np.ndarray:
        """Gains of the network's feedback, in the order of PATHWAYS."""
        return np.zeros(len(PATHWAYS))

    @property
    def turns(self) -> np.ndarray:
        """Turns of the network's steering; see Robot.turns()."""
        return np.zeros(1)


@dataclass(frozen=True, eq=False, kw_only=True)
class DrivenByGait(DrivenRobot):
    """A robot whose signals a network of oscillators makes."""

    gait: Gait
    steering: SteeringSignal | None = None
    """The turn, in place of the gait's."""

    @classmethod
    def of(cls, robot: Robot, gait: Gait, *, steering: SteeringSignal | None = None) -> Self:
        """A robot with the network of a gait."""
        none = np.zeros((0, robot.structure.signals))
        return cls(robot=robot, name=gait.name, samples=none, gait=gait, steering=steering)

    @property
    def start_up(self) -> float:
        return self.robot.scenario.cpg.start_up

    @property
    def sample_count(self) -> int:
        return sample_count(self.robot)

    @functools.cached_property
    def _known(self) -> np.ndarray:
        return signal_samples(self.robot, self.gait, self.steering)

    @property
    def is_live(self) -> bool:
        return self.robot.scenario.cpg.signals == "live"

    @property
    def network(self) -> Network:
        return self.robot.network(self.gait)

    @property
    def senses(self) -> Senses:
        return self.robot.senses

    @property
    def gains(self) -> np.ndarray:
        return np.array([gain for _, gain in self.gait.gains])

    @property
    def turns(self) -> np.ndarray:
        return self.robot.turns(self.gait, self.steering)
