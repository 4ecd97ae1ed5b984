"""Signals of the actuators: made by the network of a gait, or given by a command or a controller.

Without feedback a network does not depend on the robot's motion. So its signals can be computed
before the simulation, as in the thesis.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.files import whole_file
from tetra_drake.kernels.packed import Packed
from tetra_drake.laws.matsuoka import NO_OSCILLATORS
from tetra_drake.laws.oscillator import Oscillators, make_states, write_outputs
from tetra_drake.robot.gait import Gait, SteeringSignal
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.policies import DrivenRobots
from tetra_drake.settings.plugins import origin

MARK_DECIMALS = 9
"""Decimals of the times (s) at which a step must end. A step between two times that differ in
rounding would be too short."""


LoopLaw = Callable[[DrivenRobots, Any, np.ndarray], np.ndarray]
"""Function from the constants of N robots, their Readings and the parameters (N, parameters) of a
policy to their signals (N, m) in N; see PolicyKind.signals()."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Pilot:
    """Closed loop that drives a robot: a policy with its parameters, or a controller."""

    law: LoopLaw
    values: np.ndarray
    """Parameters (parameters,), in the order of Scenario.parameters; none of a controller."""
    robots: DrivenRobots
    """Constants of the one robot, without the axis of robots."""
    period: float
    """Time (s) between actions, a multiple of `cpg.listing_step`."""
    end: float
    """Time (s) of the end of the simulation, before which the last action is."""
    seen: Callable[[Any], Any] | None
    """What the robot's sensors show of its exact Readings; None for the same."""

    @functools.cached_property
    def kind(self) -> str:
        """The policy's settings, or the controller, and the kind of actuators, as a text. Robots
        with equal ones can be steered together."""
        return repr((getattr(self.law, "__self__", self.law), self.robots.actuation))

    @functools.cached_property
    def source(self) -> str:
        """What gives the signals, for messages: the policy and its plug-in, or "controller"."""
        policy = getattr(self.law, "__self__", None)
        return "controller" if policy is None else origin(policy)

    def acts_after(self, time: float) -> float:
        """Time (s) of the next action after an action at `time` (s); infinite for the last one."""
        after = round(self.period * (round(time / self.period) + 1), MARK_DECIMALS)
        return after if after < self.end - 0.5 * 10.0**-MARK_DECIMALS else math.inf


@dataclass(frozen=True, eq=False, kw_only=True)
class DrivenRobot:
    """A robot with the source of its signals: a gait, or given signals."""

    robot: Robot
    name: str
    """Name of the source of the signals."""
    samples: np.ndarray
    """Given signals (k, m) in N at multiples of `cpg.listing_step`, linear in between. The last
    ones are held. A controller or a policy gives the first ones, a command at least two,
    oscillators none."""
    gait: Gait | None = None
    """The gait whose oscillators or policy make the signals; None if they are given."""
    steering: SteeringSignal | None = None
    """Turn, or function from time to the turn, in place of the gait's turn; None for the gait's."""
    pilot: Pilot | None = None
    """The policy or controller that sets the signals while the robot moves; None without one."""

    @classmethod
    def of(cls, robot: Robot, gait: Gait, *, steering: SteeringSignal | None = None) -> Self:
        """A robot driven by the oscillators of a gait. `steering`, a turn (-1 to 1) or a function
        from time (s) to it, replaces the gait's turn. For a policy see
        robot.command.driven_robot()."""
        none = np.zeros((0, robot.structure.signals))
        return cls(robot=robot, name=gait.name, samples=none, gait=gait, steering=steering)

    @property
    def oscillating(self) -> Gait | None:
        """The gait if its oscillators make the signals; None for a policy and for given signals."""
        return None if self.pilot else self.gait

    @property
    def start_up(self) -> float:
        """Time (s) from which the signals act: `cpg.start_up` for oscillators, otherwise 0. Before
        it they are zero."""
        return self.robot.scenario.cpg.start_up if self.oscillating else 0.0

    @property
    def steady_start(self) -> float:
        """Time (s) from which mean values are taken: `simulation.steady_from`, or the start-up time
        if this is later."""
        return max(self.robot.scenario.simulation.settling_time, self.start_up)

    @property
    def is_live(self) -> bool:
        """True if a network is integrated together with the robot's motion (`cpg.signals: live`).
        False if its signals are computed beforehand, or given."""
        return bool(self.oscillating) and self.robot.scenario.cpg.signals == "live"

    @property
    def sample_count(self) -> int:
        """Number of samples of the signals, one per `cpg.listing_step`: of the given ones, or of
        the network's output."""
        if self.oscillating is None:
            return len(self.samples)
        scenario = self.robot.scenario
        steps = scenario.simulation.duration / scenario.cpg.listing_step
        return round(steps) if scenario.cpg.signals == "listing" else math.ceil(steps) + 1

    def signals_at(self, times: np.ndarray) -> np.ndarray:
        """Signals (times, m) in N at `times` (s), interpolated between samples; zero before the
        start-up time. For a gait they are from signal_samples(), which refuses a gait with
        feedback."""
        samples = self._all_samples
        grid = self.robot.scenario.cpg.listing_step * np.arange(len(samples))
        values = interpolated(times, grid, samples)
        values[times < self.start_up - 1e-9] = 0.0
        return values

    @functools.cached_property
    def _all_samples(self) -> np.ndarray:
        """Samples (k, m) in N of the signals at multiples of `cpg.listing_step`: the given ones, or
        a network's output."""
        gait = self.oscillating
        return self.samples if gait is None else signal_samples(self.robot, gait, self.steering)

    @functools.cached_property
    def marks(self) -> np.ndarray:
        """Times (s) at which a step of the integrator must end, ascending: the start t = 0, the
        start-up time, `simulation.steady_from`, the end, and where a change of the given signals
        begins or ends."""
        settings, step = self.robot.scenario.simulation, self.robot.scenario.cpg.listing_step
        changing = np.flatnonzero((np.diff(self.samples, axis=0) != 0.0).any(axis=1))
        ends = step * np.add.outer([0, 1], changing).ravel()
        instants = np.append([0.0, settings.settling_time, self.start_up], ends)
        marks = np.unique(instants.round(MARK_DECIMALS))
        before = marks[marks < settings.duration - 0.5 * 10.0**-MARK_DECIMALS]
        return np.append(before, settings.duration)

    @property
    def oscillators(self) -> Oscillators:
        """Oscillators that make the signals; none if they are given."""
        return self.robot.oscillators(self.oscillating) if self.oscillating else NO_OSCILLATORS

    @property
    def turns(self) -> np.ndarray:
        """Turns, -1 to 1, at multiples of `cpg.listing_step`: how much more input left oscillators
        have than right ones, see Robot.turns(). One value if the turn is constant; a single 0
        without a gait."""
        gait = self.oscillating
        return self.robot.turns(gait, self.steering) if gait else np.zeros(1)


def interpolated(times: np.ndarray, given: Any, signals: Any) -> np.ndarray:
    """Signals (times, m) at `times` (s), linear between the `signals` (k, m) at the `given` times
    (k,), and held at the end."""
    values = np.empty((np.size(times), np.shape(signals)[1]))
    for column, each in enumerate(np.transpose(signals)):
        values[:, column] = np.interp(times, given, each)
    return values


def signal_samples(robot: Robot, gait: Gait, steering: SteeringSignal | None = None) -> np.ndarray:
    """Signals (samples, m) in N of a gait without feedback, at multiples of `cpg.listing_step` from
    t = 0 until after the duration.

    They are `cpg.gain` times the output of the network, y_extensor - y_flexor. Between samples they
    are linear. They are not set to zero before the start-up time. The turn within a step is the
    turn at its middle.

    With `cpg.signals: listing`, the network is integrated with forward Euler as in listing B:
    sample i is the state after i + 1 steps, and the network ends one step before the duration. With
    `live`, the classical Runge-Kutta method of order 4 is used, with an error of 1e-5. The last
    output of the network is held for two more samples.

    Raises InputError if the gait does not fit. Raises InputError for a gait with feedback, because
    its signals depend on the robot's motion.
    """
    cpg, oscillators = robot.scenario.cpg, robot.oscillators(gait)
    if oscillators.gains.any():
        problem = "has feedback; its signals exist only while the robot is simulated"
        raise InputError(f"gait {gait.name}", "gains", problem)
    turns = robot.turns(gait, steering)
    midway = 0.5 * (turns[:-1] + turns[1:]) if turns.size > 1 else turns
    inputs = robot.tonic_input(midway)
    parts = Packed((oscillators, make_states(oscillators)))
    output = np.empty((DrivenRobot.of(robot, gait).sample_count, robot.structure.signals))
    write_outputs(parts, inputs, cpg.listing_step, cpg.signals == "listing", output)
    return cpg.gain * np.vstack([output, output[-1:], output[-1:]])


def save_signals(path: str | Path, robot: Robot, gait: Gait, *, rate: float | None = None) -> None:
    """Writes the signals of a gait without feedback to the CSV file `path`, with the columns
    time_s, signal_1 ... signal_m.

    The first lines begin with # and describe the columns. Forces are in the scenario's unit.

    Args:
        rate: samples per second (Hz); one per `cpg.listing_step` by default.

    Raises:
        InputError: if the gait is a policy's or has feedback, the rate is above its default, or
            the file cannot be written.
    """
    scenario, cpg, units = robot.scenario, robot.scenario.cpg, robot.scenario.units
    duration = scenario.simulation.duration
    most = 1.0 / cpg.listing_step
    if rate is not None and not 0.0 < rate <= most * (1.0 + 1e-9):
        problem = f"found {rate:g} Hz, expected more than 0 and at most {most:g} Hz"
        raise InputError("rate", "", problem)
    period = cpg.listing_step if rate is None else 1.0 / rate
    times = period * np.arange(math.floor(duration / period + 1e-9) + 1)
    signals = DrivenRobot.of(robot, gait).signals_at(times)
    names = [f"signal_{i + 1}" for i in range(robot.structure.signals)]
    cables = np.array(robot.structure.cable_names)
    driven = [" + ".join(cables[list(group)]) for group in robot.structure.groups]
    header = [
        f"# {gait.name} on scenario {scenario.name}, signals: {cpg.signals}",
        f"# time_s: time in s; signal_i: force in {units.force_name} that shortens the cables",
        *(f"# {name}: {cables_of}" for name, cables_of in zip(names, driven, strict=True)),
        ",".join(["time_s", *names]),
    ]
    with whole_file(path) as temporary:
        columns, top = np.column_stack([times, signals / units.force]), "\n".join(header)
        np.savetxt(temporary, columns, delimiter=",", header=top, comments="", fmt="%.12g")
