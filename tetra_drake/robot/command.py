"""Commands for actuators: samples for each driven cable, in place of a network's signals."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.laws.cable import CableLaw
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.robot import Robot, make_structure
from tetra_drake.scenario.scenario import Scenario

_NONE_COUPLED = -1
"""Reach (see robot.weights) with which no oscillator inhibits another."""


@dataclass(frozen=True, eq=False)
class Command:
    """Setpoints of actuators at evenly spaced times, beginning at 0.

    A sample holds until the next one. The last sample holds for ever.
    """

    name: str
    period: float
    """Time (s) between samples."""
    samples: np.ndarray
    """Setpoints (samples, driven cables). The kind of actuators defines the quantity; SI units."""

    @property
    def gait(self) -> Gait:
        """A gait with the command's name. Its network has no effect."""
        return Gait(name=self.name, weights=(), tau_a=1.0, tau_b=1.0)


def commanded_robot(scenario: Scenario, command: Command) -> Robot:
    """The robot of a scenario, driven by a command in place of a network.

    Raises InputError if the command has another number of cables.
    """
    robot = robot_without_network(scenario)
    driven = robot.driven
    if command.samples.shape[1:] != driven.shape:
        problem = f"is of shape {command.samples.shape}, expected {driven.size} driven cables"
        raise InputError(f"command {command.name}", "samples", problem)
    held = held_samples(command, scenario.cpg.listing_step, scenario.simulation.duration)
    signals = scenario.actuation.signals(held, CableLaw.of(robot.structure.cables[driven]))
    return dataclasses.replace(robot, commanded=signals)


def controlled_robot(scenario: Scenario) -> Robot:
    """The robot of a scenario, with one signal for each driven cable. Its command is a single
    sample, with which the actuators do at the start what they would do without a network."""
    robot, actuation = robot_without_network(scenario), scenario.actuation
    setpoints = actuation.commands(Robot.of(scenario).starting_cables())
    law = CableLaw.of(robot.structure.cables[robot.driven])
    return dataclasses.replace(robot, commanded=actuation.signals(setpoints, law)[np.newaxis])


def robot_without_network(scenario: Scenario) -> Robot:
    """The robot of a scenario, with one signal for each driven cable.

    It has no network, no start-up and no feedback. Actuators that imitate springs and dampers do
    not do so here, because the command contains their effect.
    """
    without_law = scenario.actuation.plays_cable
    structure = make_structure(scenario).with_oscillator_per_cable(without_law=without_law)
    without_network = {"signals": "listing", "feedback": [], "start_up": 0.0}
    cpg = scenario.cpg.model_copy(update=without_network | {"reach": _NONE_COUPLED})
    return Robot.of(scenario.with_sections(cpg=cpg), structure)


def held_samples(command: Command, step: float, duration: float) -> np.ndarray:
    """The setpoints of a command at multiples of `step` (s), until after `duration` (s).

    Signals are linear between these times. A change of setpoint begins at its time and takes one
    step.
    """
    times = step * (np.arange(math.ceil(duration / step) + 2) - 1)
    latest = np.floor(times / command.period + 1e-6).astype(int)
    return command.samples[np.clip(latest, 0, len(command.samples) - 1)]
