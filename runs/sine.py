"""Travelling sines in place of a network: how far they move the robots of recorded runs.

    python runs/sine.py [NAME ...]

A sine has two numbers: its frequency, and its lag from each junction to the next. Its amplitude is
the peak of the signals of the run's best gait. The script writes the farthest of TRIED sines of
each recorded run, by default of the runs in thesis/sine.json, to this file.
"""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from script import measured, script

from tetra_drake.engines.simulate import simulate_many
from tetra_drake.evolution.run import Run, load_run
from tetra_drake.files import read_json, write_whole
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.parameter_space import ParameterSpace, Vector
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.signals import DrivenRobot
from tetra_drake.scenario.scenario import Scenario

HERE = Path(__file__).parent
RECORD = HERE / "thesis" / "sine.json"
FREQUENCIES, LAGS = np.arange(0.3, 2.6, 0.2), np.arange(15.0, 151.0, 15.0)
"""Frequencies in Hz; lags in degrees, with which the wave runs from the rear to the front."""
TRIED = FREQUENCIES.size * LAGS.size
PERIOD = 0.01
"""Time (s) between samples of signals."""


def oscillators(amplitude: float, *, start_up: float = 1.25) -> str:
    """Oscillators whose gaits are travelling sines of this amplitude (N), as text of a scenario."""
    own = f"gain: {amplitude!r} N, start_up: {start_up!r} s"
    return f"!Phase {{{own}, amplitude: [1, 1], coupling: [5 /s, 5 /s], common: [lag]}}"


def grid(space: ParameterSpace) -> list[Vector]:
    """Vectors of all sines in the space of such oscillators."""
    vectors = np.tile(space.low, (TRIED, 1))
    places = [space.names.index(name) for name in ("frequency", "lag 1->2")]
    vectors[:, places] = [*itertools.product(FREQUENCIES, np.radians(LAGS))]
    return [*vectors]


def steady_times(scenario: Scenario) -> np.ndarray:
    """Times (s) after the first 5 s, every PERIOD."""
    return np.arange(5.0, scenario.simulation.duration, PERIOD)


def steady_signals(robot: Robot, gait: Gait) -> np.ndarray:
    """Signals (times, oscillators) in N of a gait at the steady times."""
    return DrivenRobot.of(robot, gait).signals_at(steady_times(robot.scenario))


def peak(scenario: Scenario, gait: Gait) -> float:
    """Peak (N) of the steady signals of a gait."""
    return float(np.abs(steady_signals(Robot.of(scenario), gait)).max())


def load_sines() -> dict[str, dict[str, float]]:
    """The recorded sines by run. Raises InputError if the record cannot be read."""
    sines: dict[str, dict[str, float]] = read_json(RECORD, "record; run `python runs/sine.py`")
    return sines


def farthest(run: Run) -> dict[str, float]:
    """Numbers of the sine that moves a run's robot farthest forward."""
    amplitude = peak(run.scenario, run.best_gait())
    scenario = run.scenario.on_engine("compiled")
    cpg = oscillators(amplitude, start_up=scenario.cpg.start_up)
    scenario = scenario.with_changes({"cpg": cpg})
    space = ParameterSpace.of(scenario)
    gaits = [space.gait(vector, name="sine") for vector in grid(space)]
    inches = [measured(walk, "distance_in") for walk in simulate_many(scenario, gaits)]
    best = int(np.nanargmax(inches))
    numbers = gaits[best].parameters
    return {
        "amplitude_n": round(amplitude, 3),
        "frequency_hz": round(numbers["frequency"], 1),
        "lag_deg": round(math.degrees(numbers["lag 1->2"])),
        "distance_in": round(inches[best], 2),
    }


@script
def main(names: Sequence[str]) -> None:
    """Writes the record and prints it."""
    found = load_sines()
    for name in names or [*found]:
        found[name] = farthest(load_run(HERE / name))
        write_whole(RECORD, json.dumps(found, indent=1) + "\n")
        print(name, found[name], flush=True)
