"""Robots without a network: driven by a command, a controller or a policy."""

from __future__ import annotations

import dataclasses
import math
import numbers
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tetra_drake.errors import InputError, check_type
from tetra_drake.laws.cable import CableLaw
from tetra_drake.robot.gait import Gait, check_parameters
from tetra_drake.robot.parameter_space import with_body
from tetra_drake.robot.readings import Readings, first_readings
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.signals import DrivenRobot, Pilot
from tetra_drake.robot.steering import SteeringSignal
from tetra_drake.scenario.policies import DrivenRobots, PolicyKind
from tetra_drake.scenario.scenario import Scenario


@dataclass(frozen=True, eq=False)
class Command:
    """Setpoints of actuators at evenly spaced times from t = 0 on, in place of a gait.

    A sample holds until the next one. The last sample holds for ever.
    """

    name: str
    period: float
    """Time (s) between samples."""
    samples: np.ndarray
    """Setpoints (samples, driven cables) in SI units: forces, free lengths or tensions. The kind of
    `actuation` in the scenario defines which."""

    def at(self, times: np.ndarray) -> np.ndarray:
        """Setpoints (times, driven cables) at `times` (s)."""
        latest = np.floor(times / self.period + 1e-6).astype(int)
        return np.asarray(self.samples[np.clip(latest, 0, len(self.samples) - 1)])

    def check(self, robot: Robot) -> None:
        """Raises InputError if the command does not fit the driven cables of a robot, its period is
        not positive, or its samples are not finite numbers."""
        source, driven = f"command {self.name}", robot.driven
        check_type(source, "period", self.period, numbers.Real)
        if not 0.0 < self.period < math.inf:
            raise InputError(source, "period", f"found {self.period}, expected a number above 0")
        check_type(source, "samples", self.samples, np.ndarray)
        shape, kind = self.samples.shape, self.samples.dtype
        if len(shape) != 2 or shape[1] != driven.size:
            problem = f"is of shape {shape}, expected {driven.size} driven cables"
        elif not len(self.samples):
            problem = "has none, expected one at least"
        elif kind.kind not in "iuf":
            problem = f"found {kind}, expected numbers"
        elif not np.isfinite(self.samples).all():
            problem = "found nan or inf, expected finite numbers"
        else:
            return
        raise InputError(source, "samples", problem)


Driver = Gait | Command
"""A gait or a command: what drives the actuators without a controller."""


def driven_robot(
    scenario: Scenario,
    driver: Driver,
    *,
    steering: SteeringSignal | None = None,
    robot: Robot | None = None,
) -> DrivenRobot:
    """The robot of a scenario, driven by a gait, a command, or the scenario's policy.

    The signals of a command are linear between multiples of `cpg.listing_step` (s). A change of
    setpoint begins at the time of its sample and takes one such step. `steering`, a function from
    time (s) to the turn (-1 to 1), replaces the constant turn of a gait; a command ignores it.
    `robot` is the scenario's robot if it is made already.

    Raises InputError for a command without samples, or whose number of cables is not the robot's
    number of driven cables. Also for a gait with other parameters than the scenario's oscillators
    or policy, and for steering of a policy. The robot of a gait with a body has this body.
    """
    if not isinstance(driver, Command) and driver.body:
        scenario, driver = with_body(scenario, driver)
        robot = None
    robot = robot or Robot.of(scenario)
    if not isinstance(driver, Command):
        if scenario.policy is None:
            return DrivenRobot.of(robot, driver, steering=steering)
        if steering is not None:
            raise InputError("steering", "", f"found a function, and {driver.name} is for a policy")
        return _piloted_robot(robot, driver, scenario.policy)
    robot = robot.without_network()
    driver.check(robot)
    step = scenario.cpg.listing_step
    times = step * (np.arange(math.ceil(scenario.simulation.duration / step) + 2) - 1)
    law = CableLaw.of(robot.structure.cables[robot.driven])
    signals = scenario.actuation.signals(driver.at(times), law)
    robot = dataclasses.replace(robot, first_signals=signals[0])
    return DrivenRobot(robot=robot, name=driver.name, samples=signals)


def controlled_robot(scenario: Scenario) -> Robot:
    """The robot of a scenario for a controller, which sets one signal for each driven cable in
    place of an oscillator network.

    Its `first_signals`, the signals at t = 0, let the actuators start in the same state as with the
    network."""
    return Robot.of(scenario).controlled


def _piloted_robot(robot: Robot, gait: Gait, policy: PolicyKind) -> DrivenRobot:
    """A robot driven by its scenario's policy with the parameters of a gait, whose first signals
    act from the start on. Raises InputError if the gait has other parameters."""
    scenario, step = robot.scenario, robot.scenario.cpg.listing_step
    source, own = f"gait {gait.name}", scenario.parameters
    given = check_parameters(gait.parameters, own, source=source, key="parameters")
    values = np.array([*given.values()], dtype=float)
    controlled, structure = robot.controlled, robot.structure
    cables, struts = robot.starting_cables(), structure.p_WN[structure.struts]
    size = np.linalg.norm(np.diff(struts[0], axis=0)) if len(struts) else scenario.robot.size
    robots = DrivenRobots(
        actuation=scenario.actuation,
        ends=structure.cable_ends[robot.driven],
        cables=cables,
        rest=scenario.actuation.commands(cables),
        amplitude=np.array(scenario.cpg.usual_amplitude),
        lengths=structure.initial_lengths,
        weight=np.array(robot.weight),
        size=np.array(size),
    )
    period = step * round(scenario.simulation.control_period / step)
    pilot = Pilot(policy=policy, values=values, robots=robots, period=period)
    readings = Readings(*(np.array(values)[np.newaxis] for values in first_readings(controlled)))
    samples = policy_signals([pilot], readings)
    controlled = dataclasses.replace(controlled, first_signals=samples[0])
    return DrivenRobot(robot=controlled, name=gait.name, samples=samples, gait=gait, pilot=pilot)


def policy_signals(pilots: Sequence[Pilot], readings: Readings) -> np.ndarray:
    """Signals (N, m) in N that the policies of N robots give for their readings. Raises InputError
    if a user's policy returns anything but finite numbers of this shape."""
    signals = np.empty((len(pilots), len(pilots[0].robots.ends)))
    groups: dict[tuple[str, str], list[int]] = {}
    for row, pilot in enumerate(pilots):
        groups.setdefault(pilot.kind, []).append(row)
    for rows in groups.values():
        some = [pilots[row] for row in rows]
        arrays = [pilot.robots[2:] for pilot in some]
        together = DrivenRobots(*some[0].robots[:2], *_stacked(arrays))
        values = np.array([pilot.values for pilot in some])
        signals[rows] = some[0].policy.signals(together, readings.rows(rows), values)
    return signals


def _stacked(parts: Sequence[Any]) -> Any:
    """Named tuple of arrays, nested ones included, that stacks the arrays of several robots."""
    if not isinstance(parts[0], tuple):
        return np.stack(parts)
    fields = [_stacked(each) for each in zip(*parts, strict=True)]
    return type(parts[0])._make(fields) if hasattr(parts[0], "_make") else fields
