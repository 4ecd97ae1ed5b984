"""The actuation signals of a gait, computed before the robot is simulated.

Without feedback the network does not depend on the robot, so its output can be computed alone
and fed to the cables, as the thesis does.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.files import whole_file
from tetra_drake.physics.oscillator import make_neurons, network_output
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.robot import Robot, SteeringSignal, initial_neurons
from tetra_drake.scenario.units import POUND_FORCE


def raw_output(robot: Robot, gait: Gait, steering: SteeringSignal | None = None) -> np.ndarray:
    """y_extensor - y_flexor (samples, m) at 0, one `listing_step`, two ... from `cpg.signals`.

    `listing`: forward Euler as in listing B, which stamps the state after i + 1 steps with the
    time of i steps; the last sample is one step before the end. `live`: the classical Runge-Kutta
    method of order 4, whose error is 1e-5, to the end or beyond. Within a step the turn is that of
    its middle. Raises InputError for a gait that does not fit, or one
    with feedback, whose signals depend on the robot.
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
    """Number of samples of a robot's command or else of raw_output(); the signals keep the last."""
    if len(robot.commanded):
        return len(robot.commanded)
    scenario = robot.scenario
    steps = scenario.simulation.duration / scenario.cpg.listing_step
    return round(steps) if scenario.cpg.signals == "listing" else math.ceil(steps) + 1


def signal_samples(robot: Robot, gait: Gait, steering: SteeringSignal | None = None) -> np.ndarray:
    """The signals (samples, m) in N at 0, one `cpg.listing_step`, two ... to beyond the duration.

    Between samples the signals are linear. Start-up is not applied. If the robot follows a
    command, the signals are those, and the gait has no part in them.
    """
    if len(robot.commanded):
        return robot.commanded
    raw = raw_output(robot, gait, steering)
    return robot.scenario.cpg.gain * np.vstack([raw, raw[-1:], raw[-1:]])


def signals_at(
    robot: Robot, gait: Gait, times: np.ndarray, *, steering: SteeringSignal | None = None
) -> np.ndarray:
    """The signals (times, m) in N that cables are fed at `times` (s), zero before the start-up."""
    samples, cpg = signal_samples(robot, gait, steering), robot.scenario.cpg
    grid = cpg.listing_step * np.arange(len(samples))
    signals = np.empty((len(times), samples.shape[1]))
    for oscillator, column in enumerate(samples.T):
        signals[:, oscillator] = np.interp(times, grid, column)
    signals[times < cpg.start_up - 1e-9] = 0.0
    return signals


UNITS = {"lbf": POUND_FORCE, "N": 1.0}
"""Units of force in which save_signals() writes."""


def save_signals(
    path: str | Path, robot: Robot, gait: Gait, *, unit: str = "lbf", rate: float | None = None
) -> None:
    """Writes the signals that the cables of a gait are fed as CSV: time_s, signal_1 ... signal_m.

    The first lines, which begin with #, say what the columns are.

    Args:
        unit: one of UNITS.
        rate: samples per second (Hz); one per `cpg.listing_step` by default.

    Raises:
        InputError: where the rate is beyond its default, or the file cannot be written.
    """
    scenario, cpg = robot.scenario, robot.scenario.cpg
    duration = scenario.simulation.duration
    most = 1.0 / cpg.listing_step
    if rate is not None and not 0.0 < rate <= most * (1.0 + 1e-9):
        problem = f"found {rate:g} Hz, expected more than 0 and at most {most:g} Hz"
        raise InputError("rate", "", problem)
    period = cpg.listing_step if rate is None else 1.0 / rate
    times = period * np.arange(math.floor(duration / period + 1e-9) + 1)
    signals = signals_at(robot, gait, times) / UNITS[unit]
    names = [f"signal_{i + 1}" for i in range(robot.structure.signals)]
    cables = zip(names, robot.structure.driven_cables, strict=True)
    header = [
        f"# {gait.name} on scenario {scenario.name}, signals: {cpg.signals}",
        f"# time_s: time in s; signal_i: force in {unit} that shortens the cables",
        *(f"# {name}: {driven}" for name, driven in cables),
        ",".join(["time_s", *names]),
    ]
    with whole_file(path) as temporary:
        columns, top = np.column_stack([times, signals]), "\n".join(header)
        np.savetxt(temporary, columns, delimiter=",", header=top, comments="", fmt="%.12g")
