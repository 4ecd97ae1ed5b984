"""Travelling sines in place of a network: how far they move the thesis's robot, by reading.

    python runs/sine.py

A sine has two numbers: its frequency, and its lag from each junction to the next. Its amplitude is
the peak of the signals of the reading's best evolved gait. The script writes the farthest sine of
each recorded run in RUNS to thesis/sine.json.
"""

from __future__ import annotations

import itertools
import json
import math
import sys
from pathlib import Path

import numpy as np

from tetra_drake.engines.simulate import simulate_many
from tetra_drake.errors import InputError
from tetra_drake.evolution.run import Run, load_run
from tetra_drake.files import write_whole
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.command import Command
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.signals import DrivenRobot

HERE = Path(__file__).parent
RECORD = HERE / "thesis" / "sine.json"
RUNS = ["thesis", "thesis-listing", "thesis-reversal", "coulomb"]
FREQUENCIES = np.arange(0.3, 1.15, 0.1)
"""Frequencies in Hz."""
LAGS = np.array([sign * lag for sign in (1, -1) for lag in range(15, 151, 15)])
"""Lags in degrees; a positive one lets the wave run from the rear to the front."""
PERIOD = 2e-3
"""Time (s) between samples of a command."""


def sine(robot: Robot, *, amplitude: float, frequency: float, lag: float) -> Command:
    """A sine on all driven cables of a robot: `amplitude` in N, `frequency` in Hz, and `lag` in
    degrees per junction. It begins at the start-up time of the network."""
    cpg, duration = robot.scenario.cpg, robot.scenario.simulation.duration
    times = np.arange(0.0, duration, PERIOD)
    junction = robot.model.cables.signal[robot.driven]
    phase = math.tau * frequency * times[:, np.newaxis] - np.radians(lag) * junction
    samples = amplitude * np.sin(phase) * (times >= cpg.start_up)[:, np.newaxis]
    return Command(f"{frequency:.1f} Hz, {lag:g} degrees", PERIOD, samples)


def peak(run: Run) -> float:
    """Peak (N) of the signals of a run's best gait after the first 5 s."""
    gait = run.best_gait()
    times = np.arange(5.0, run.scenario.simulation.duration, 0.01)
    signals = DrivenRobot.of(Robot.of(run.scenario), gait).signals_at(times)
    return float(np.abs(signals).max())


def farthest(run: Run) -> dict[str, float]:
    """Numbers of the sine that moves a run's robot farthest forward."""
    robot, amplitude = Robot.of(run.scenario), peak(run)
    pairs = list(itertools.product(FREQUENCIES.tolist(), LAGS.tolist()))
    commands = [sine(robot, amplitude=amplitude, frequency=f, lag=lag) for f, lag in pairs]
    walks = simulate_many(run.scenario.on_engine("compiled"), commands)
    inches = [
        walk.metrics.distance_in if isinstance(walk, SimulationResult) else -math.inf
        for walk in walks
    ]
    best = int(np.argmax(inches))
    frequency, lag = pairs[best]
    return {
        "tried": len(pairs),
        "amplitude_n": round(amplitude, 3),
        "frequency_hz": round(frequency, 1),
        "lag_deg": lag,
        "distance_in": round(inches[best], 2),
    }


def main() -> None:
    """Writes the record and prints it."""
    found = {name: farthest(load_run(HERE / name)) for name in RUNS}
    write_whole(RECORD, json.dumps(found, indent=1) + "\n")
    for name, numbers in found.items():
        print(name, numbers)


if __name__ == "__main__":
    try:
        main()
    except InputError as error:
        sys.exit(f"sine.py: {error}")
