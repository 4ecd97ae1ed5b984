"""Actuation signals of a gait, computed before the simulation.

Without feedback the network does not depend on the robot. So its signals can be computed before the
robot is simulated, as in the thesis.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.files import whole_file
from tetra_drake.laws.oscillator import make_neurons, network_output
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.network import SteeringSignal, initial_neurons
from tetra_drake.robot.robot import Robot


def raw_output(robot: Robot, gait: Gait, steering: SteeringSignal | None = None) -> np.ndarray:
    """Output of the network, y_extensor - y_flexor (samples, m), at multiples of `listing_step`.

    With `cpg.signals: listing`, forward Euler as in listing B: sample i is the state after i + 1
    steps, and the last sample is one step before the end. With `live`, the classical Runge-Kutta
    method of order 4, with an error of 1e-5. The turn within a step is the turn at its middle.

    Raises InputError if the gait does not fit. Raises InputError for a gait with feedback, because
    its signals depend on the robot's motion.
    """
    cpg, oscillators = robot.scenario.cpg, robot.structure.signals
    if any(gain for _, gain in gait.gains):
        problem = "has feedback; its signals exist only while the robot is simulated"
        raise InputError(f"gait {gait.name}", "gains", problem)
    network, turns = robot.network(gait), robot.turns(gait, steering)
    midway = 0.5 * (turns[:-1] + turns[1:]) if turns.size > 1 else turns
    inputs = robot.tonic_input(midway)
    neurons = make_neurons(initial_neurons(cpg, oscillators))
    output = np.empty((sample_count(robot), oscillators))
    listing = cpg.signals == "listing"
    network_output(network, inputs, cpg.listing_step, listing, neurons, output)
    return output


def sample_count(robot: Robot) -> int:
    """Number of samples of raw_output()."""
    scenario = robot.scenario
    steps = scenario.simulation.duration / scenario.cpg.listing_step
    return round(steps) if scenario.cpg.signals == "listing" else math.ceil(steps) + 1


def signal_samples(robot: Robot, gait: Gait, steering: SteeringSignal | None = None) -> np.ndarray:
    """Signals (samples, m) in N at multiples of `cpg.listing_step`, until after the duration.

    Between samples the signals are linear. They are not set to zero before the start-up time.
    """
    raw = raw_output(robot, gait, steering)
    return robot.scenario.cpg.gain * np.vstack([raw, raw[-1:], raw[-1:]])


def interpolated(
    samples: np.ndarray, times: np.ndarray, *, step: float, start_up: float
) -> np.ndarray:
    """Signals (times, m) at `times` (s), from samples (k, m) that are `step` (s) apart; zero before
    the start-up time (s)."""
    grid, values = step * np.arange(len(samples)), np.empty((len(times), samples.shape[1]))
    for column, given in enumerate(samples.T):
        values[:, column] = np.interp(times, grid, given)
    values[times < start_up - 1e-9] = 0.0
    return values


def save_signals(path: str | Path, robot: Robot, gait: Gait, *, rate: float | None = None) -> None:
    """Writes the signals of a gait as CSV with the columns time_s, signal_1 ... signal_m.

    The first lines begin with # and describe the columns. Forces are in the scenario's unit.

    Args:
        rate: samples per second (Hz); one per `cpg.listing_step` by default.

    Raises:
        InputError: if the rate is above its default, or the file cannot be written.
    """
    scenario, cpg, units = robot.scenario, robot.scenario.cpg, robot.scenario.units
    duration = scenario.simulation.duration
    most = 1.0 / cpg.listing_step
    if rate is not None and not 0.0 < rate <= most * (1.0 + 1e-9):
        problem = f"found {rate:g} Hz, expected more than 0 and at most {most:g} Hz"
        raise InputError("rate", "", problem)
    period = cpg.listing_step if rate is None else 1.0 / rate
    times = period * np.arange(math.floor(duration / period + 1e-9) + 1)
    samples = signal_samples(robot, gait)
    signals = interpolated(samples, times, step=cpg.listing_step, start_up=cpg.start_up)
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
