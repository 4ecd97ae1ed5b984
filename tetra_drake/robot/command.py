"""Robots without a network: driven by a command, a controller or a policy."""

from __future__ import annotations

import dataclasses
import math
import numbers
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from tetra_drake.errors import InputError, check_positive, check_type, checked_numbers
from tetra_drake.laws.cable import CableLaw, Curve
from tetra_drake.robot.gait import Gait, SteeringSignal, check_parameters
from tetra_drake.robot.parameter_space import with_body
from tetra_drake.robot.readings import Readings, first_readings
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.sensors import Sensors, shown
from tetra_drake.robot.signals import DrivenRobot, LoopLaw, Pilot
from tetra_drake.scenario.policies import DrivenRobots
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
        check_positive(source, "period", self.period)
        check_type(source, "samples", self.samples, np.ndarray)
        shape = max(1, len(self.samples)), driven.size
        checked_numbers(self.samples, shape, source=source, key="samples", finite=True)


Controller = Callable[[float, Readings], npt.ArrayLike]
"""Function from the time (s) and the readings of one robot to its actions (actions,)."""

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
    setpoint begins at the time of its sample and takes one such step. `steering`, a turn
    (-1 to 1) or a function from time (s) to it, replaces the turn of a gait; a command ignores it.
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
            raise InputError("steering", "", f"found a turn, but {driver.name} is for a policy")
        own = scenario.policy.gait_parameters(robot.structure)
        given = check_parameters(driver.parameters, own, f"gait {driver.name}", "parameters")
        values, step = np.array([*given.values()], dtype=float), scenario.cpg.listing_step
        period = step * round(scenario.simulation.control_period / step)
        return _looped(robot, scenario.policy.signals, values, period, gait=driver)
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


def robot_of_controller(
    scenario: Scenario, controller: Controller, *, period: float | None = None
) -> DrivenRobot:
    """The robot of a scenario, driven by a controller, which acts once in each `period` (s); see
    checked_period(). Raises InputError if the period is wrong, or the actions at the start; later,
    while the robot moves, if other actions are wrong."""

    def law(robots: DrivenRobots, readings: Readings, _: np.ndarray) -> np.ndarray:
        one = readings.rows(0)
        given, shape = controller(float(one.time), one), robots.rest.shape
        return robots.signals_of(checked_actions(given, shape, source="controller", finite=True))

    driven = _looped(Robot.of(scenario), law, np.zeros(0), checked_period(period, scenario))
    return dataclasses.replace(driven, name=getattr(controller, "__name__", "controller"))


def checked_period(period: float | None, scenario: Scenario) -> float:
    """A control period (s), by default the scenario's, as a multiple of `cpg.listing_step`. Raises
    InputError unless it is one, or if it is longer than the simulation."""
    source, key, step = "Simulation", "control_period", scenario.cpg.listing_step
    if period is None:
        period = scenario.simulation.control_period
        source, key = f"scenario {scenario.name}", "simulation.control_period"
    is_number = isinstance(period, numbers.Real) and not isinstance(period, bool)
    within = is_number and 0.0 < period <= max(scenario.simulation.duration, step)
    steps = round(period / step) if within else 0
    if steps < 1 or abs(period - steps * step) > 1e-6 * step:
        expected = f"a multiple of cpg.listing_step, {step:g} s, up to simulation.duration"
        raise InputError(source, key, f"found {period!r:.60}, expected {expected}")
    return steps * step


def checked_actions(
    actions: npt.ArrayLike, shape: tuple[int, ...], *, source: str, finite: bool = False
) -> np.ndarray:
    """Converts actions to an array of `shape` (N, actions); for a single robot they may be
    (actions,). Raises InputError, which names `source`, if they have another shape, or are not real
    numbers; with `finite` also for nan and inf."""
    shapes = (shape[1:], shape) if shape[0] == 1 else (shape,)
    numbers = checked_numbers(actions, *shapes, source=source, key="actions", finite=finite)
    return numbers.reshape(shape)


def _looped(
    robot: Robot, law: LoopLaw, values: np.ndarray, period: float, *, gait: Gait | None = None
) -> DrivenRobot:
    """A robot that a policy or a controller drives, whose first signals act from the start on. For
    the arguments see Pilot; `gait` is None for a controller."""
    scenario, controlled, structure = robot.scenario, robot.controlled, robot.structure
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
    end = scenario.simulation.duration
    seen = Sensors(scenario, period) if scenario.sensing else None
    pilot = Pilot(law=law, values=values, robots=robots, period=period, end=end, seen=seen)
    samples = signals_of_one(pilot, first_readings(controlled))[np.newaxis]
    controlled = dataclasses.replace(controlled, first_signals=samples[0])
    name = gait.name if gait else ""
    return DrivenRobot(robot=controlled, name=name, samples=samples, gait=gait, pilot=pilot)


def signals_of_one(pilot: Pilot, readings: Readings) -> np.ndarray:
    """Signals (m,) in N that a policy or a controller gives for the readings of its robot, which
    have no axis of robots. Raises the errors of policy_signals()."""
    return policy_signals([pilot], Readings(*(np.array(each)[np.newaxis] for each in readings)))[0]


def policy_signals(pilots: Sequence[Pilot], readings: Readings) -> np.ndarray:
    """Signals (N, m) in N that the policies or controllers of N robots give for their readings.
    Raises InputError if a user's function returns anything but finite numbers of this shape."""
    signals = np.empty((len(pilots), len(pilots[0].robots.ends)))
    groups: dict[str, list[int]] = {}
    for row, pilot in enumerate(pilots):
        groups.setdefault(pilot.kind, []).append(row)
    for rows in groups.values():
        some = [pilots[row] for row in rows]
        arrays = [pilot.robots[2:] for pilot in some]
        together = DrivenRobots(*some[0].robots[:2], *_stacked(arrays))
        values = np.array([pilot.values for pilot in some])
        sensors = {row: pilot.seen for row, pilot in enumerate(some) if pilot.seen}
        seen = shown(readings.rows(rows), sensors)
        given, shape = some[0].law(together, seen, values), signals[rows].shape
        source = some[0].source
        signals[rows] = checked_numbers(given, shape, source=source, key="signals", finite=True)
    return signals


def _stacked(parts: Sequence[Any]) -> Any:
    """Named tuple of arrays, nested ones included, that stacks the arrays of several robots."""
    if not isinstance(parts[0], tuple):
        return np.stack(parts)
    if isinstance(parts[0], Curve):
        return Curve.stacked(parts)
    fields = [_stacked(each) for each in zip(*parts, strict=True)]
    return type(parts[0])._make(fields) if hasattr(parts[0], "_make") else fields
