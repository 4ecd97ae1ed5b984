"""Robots without a network: driven by a command, or by a controller."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.laws.cable import CableLaw
from tetra_drake.robot.gait import Gait, with_body
from tetra_drake.robot.network import SteeringSignal
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.signals import DrivenRobot
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


Driver = Gait | Command
"""A gait or a command: what drives the actuators if there is no controller."""


def driven_robot(
    scenario: Scenario, driver: Driver, *, steering: SteeringSignal | None = None
) -> DrivenRobot:
    """The robot of a scenario, driven by a gait or a command.

    The signals of a command are linear between multiples of `cpg.listing_step` (s). A change of
    setpoint begins at the time of its sample and takes one such step. `steering`, a function from
    time (s) to the turn (-1 to 1), replaces the constant turn of a gait; a command ignores it.
    Raises InputError for a command without samples, or whose number of cables is not the robot's
    number of driven cables. The robot of a gait with a body has this body.
    """
    if isinstance(driver, Gait):
        scenario, driver = with_body(scenario, driver)
        return DrivenRobot.of(Robot.of(scenario), driver, steering=steering)
    robot = Robot.of(scenario).without_network()
    driven = robot.driven
    problem = "" if len(driver.samples) else "has none, expected one at least"
    if driver.samples.shape[1:] != driven.shape:
        problem = f"is of shape {driver.samples.shape}, expected {driven.size} driven cables"
    if problem:
        raise InputError(f"command {driver.name}", "samples", problem)
    step = scenario.cpg.listing_step
    times = step * (np.arange(math.ceil(scenario.simulation.duration / step) + 2) - 1)
    latest = np.floor(times / driver.period + 1e-6).astype(int)
    held = driver.samples[np.clip(latest, 0, len(driver.samples) - 1)]
    signals = scenario.actuation.signals(held, CableLaw.of(robot.structure.cables[driven]))
    robot = dataclasses.replace(robot, first_signals=signals[0])
    return DrivenRobot(robot=robot, name=driver.name, samples=signals)


def controlled_robot(scenario: Scenario) -> Robot:
    """The robot of a scenario for a controller, which sets one signal for each driven cable in
    place of an oscillator network.

    Its `first_signals`, the signals at t = 0, let the actuators start in the same state as with the
    network."""
    by_network, actuation = Robot.of(scenario), scenario.actuation
    setpoints = actuation.commands(by_network.starting_cables())
    robot = by_network.without_network()
    law = CableLaw.of(robot.structure.cables[robot.driven])
    return dataclasses.replace(robot, first_signals=actuation.signals(setpoints, law))
