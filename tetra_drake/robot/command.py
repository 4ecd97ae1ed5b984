"""Commands of actuators: samples for each driven cable, in place of the signals of a network."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.physics.cable import CableLaw
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.scenario import Scenario

_NONE_COUPLED = -1
"""Reach of oscillators none of which inhibit each other."""


@dataclass(frozen=True, eq=False)
class Command:
    """What actuators are commanded at evenly spaced times from 0 on; each sample is held until the
    next one, the last one for ever."""

    name: str
    period: float
    """Time (s) between samples."""
    samples: np.ndarray
    """(samples, driven cables): in SI units of the quantity that the kind of actuators says."""

    @property
    def gait(self) -> Gait:
        """A gait of the command's name, with a network that never acts."""
        return Gait(name=self.name, weights=(), tau_a=1.0, tau_b=1.0)


def commanded_robot(scenario: Scenario, command: Command) -> Robot:
    """The robot of a scenario that follows a command.

    Raises InputError if the command is for another number of cables.
    """
    robot = robot_without_network(scenario)
    driven = robot.driven
    if command.samples.shape[1:] != driven.shape:
        problem = f"is of shape {command.samples.shape}, expected {driven.size} driven cables"
        raise InputError(f"command {command.name}", "samples", problem)
    held = held_samples(command, scenario.cpg.listing_step, scenario.simulation.duration)
    signals = scenario.actuation.signals(held, CableLaw.of(robot.structure.cables[driven]))
    return dataclasses.replace(robot, commanded=signals)


def robot_without_network(scenario: Scenario) -> Robot:
    """The robot of a scenario in which each driven cable has a signal of its own.

    There is no network, so no start-up and no feedback. Springs and dampers that actuators play are
    in their commands, and missing here.
    """
    structure = Robot.of(scenario).structure.with_oscillator_per_cable(
        without_law=scenario.actuation.plays_cable
    )
    without_network = {"signals": "listing", "feedback": [], "start_up": 0.0}
    cpg = scenario.cpg.model_copy(update=without_network | {"reach": _NONE_COUPLED})
    return Robot.of(scenario.with_sections(cpg=cpg), structure)


def held_samples(command: Command, step: float, duration: float) -> np.ndarray:
    """The command at 0, one `step` (s), two ... to beyond the duration (s).

    Signals are linear between these times, so a change begins at its time and takes a step.
    """
    times = step * (np.arange(math.ceil(duration / step) + 2) - 1)
    latest = np.floor(times / command.period + 1e-6).astype(int)
    return command.samples[np.clip(latest, 0, len(command.samples) - 1)]
