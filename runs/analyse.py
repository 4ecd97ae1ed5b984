"""Simulates the best gaits of recorded runs under other conditions.

    python runs/analyse.py runs/thesis [RUN ...]

Writes analysis.json to each run's folder, for tables.py.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas
import xarray

from tetra_drake.engines.simulate import available_cores, simulate
from tetra_drake.errors import InputError
from tetra_drake.evolution.evaluation import GaitEvaluation
from tetra_drake.evolution.executors import evaluate_all, process_executor
from tetra_drake.evolution.robustness import PERCENT, judge, to_json
from tetra_drake.evolution.tables import load_run
from tetra_drake.files import json_number, write_whole
from tetra_drake.results.measures import dominant_frequency, lifted, share_of_time
from tetra_drake.results.result import versions
from tetra_drake.robot.gait import Gait, ParameterSpace
from tetra_drake.robot.signals import signal_samples
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.units import INCH

SCHEMA = 2
ANALYSIS = "analysis.json"

DEFAULT = "default"
"""The integrator setting that the others are compared with."""

OSCILLATOR_TAU_A = 0.3
"""s, the time constant of the thesis's figures of a single oscillator."""

_MEAN, _KEPT = ("mean", "mean_low", "mean_high"), ("kept", "kept_low", "kept_high")
_COLUMNS = {
    "best_gaits": ("trial", "evaluation", "distance_in", "off_ground", "frequencies_hz"),
    "resimulations": ("trial", "setting", "distance_in", "failure"),
    "gaits": ("gait", "undisturbed", "5 %", "50 %", "95 %", *_MEAN, *_KEPT, "failed"),
    "over_gaits": ("of", "median", "low", "high"),
    "changes": ("what", "median", "worst", "failed", "correlation", "correlation_size"),
}
_NUMBERS = ["distance_in", "correlation", "correlation_size"]
"""What may be null in all rows."""


@dataclass(frozen=True)
class Analysis:
    """Content of analysis.json; distances in inches if not said otherwise, NaN where a simulation
    failed."""

    oscillator_frequency_hz: float
    """Of a single oscillator with OSCILLATOR_TAU_A."""
    best_gaits: pandas.DataFrame
    """The fittest gait of each trial on the run's own engine: trial, evaluation, distance_in,
    off_ground (share of the steady stretch by tetrahedron), frequencies_hz (by junction)."""
    resimulations: pandas.DataFrame
    """Those gaits on the Drake diagram: trial, setting, distance_in, failure."""
    gaits: pandas.DataFrame
    """Those gaits under draws of the default disturbances, as of robustness.by_gait(), in m."""
    over_gaits: pandas.DataFrame
    """As of robustness.over_gaits(), in m."""
    changes: pandas.DataFrame
    """As of robustness.by_change(), in m."""


def load_analysis(directory: Path) -> Analysis:
    """Reads analysis.json of a run; InputError if it is missing or damaged."""
    path = directory / ANALYSIS
    try:
        raw: Any = json.loads(path.read_text(encoding="utf-8"))
        rows = raw | raw["robustness"]
        frames = {key: pandas.DataFrame(rows[key])[list(_COLUMNS[key])] for key in _COLUMNS}
        for frame in frames.values():
            numbers = frame.columns.intersection(_NUMBERS)
            frame[numbers] = frame[numbers].astype(float)
        return Analysis(oscillator_frequency_hz=raw["oscillator"]["frequency_hz"], **frames)
    except (OSError, ValueError, KeyError, TypeError) as error:
        problem = f"cannot be read ({error}); run `python runs/analyse.py {directory}`"
        raise InputError(path, "", problem) from error


def analyse(
    directory: Path, *, workers: int, executor: Callable[[int], Executor] = process_executor
) -> None:
    """Simulates what Analysis holds for a run's best gaits and writes analysis.json.

    `executor` is for the Drake diagrams.
    """
    run = load_run(directory)
    scenario = run.manifest.scenario
    run.fittest()  # InputError if there is none
    best = [(int(trial), int(index)) for trial, index in run.best()[["trial", "index"]].to_numpy()]
    gaits = {trial: run.gait(trial, index) for trial, index in best}
    content = {
        "schema": SCHEMA,
        "versions": versions(),
        "oscillator": {"tau_a_s": OSCILLATOR_TAU_A, "frequency_hz": oscillator_frequency(scenario)},
        "best_gaits": [
            {"trial": trial, "evaluation": index, **walk(scenario, gaits[trial])}
            for trial, index in best
        ],
        "resimulations": resimulate(scenario, gaits, workers, executor),
        "robustness": to_json(judge(scenario, gaits, percent=PERCENT, workers=workers)),
    }
    text = json.dumps(content, indent=1, allow_nan=False, ensure_ascii=False)
    write_whole(directory / ANALYSIS, text + "\n")


def resimulate(
    scenario: Scenario,
    gaits: Mapping[int, Gait],
    workers: int,
    executor: Callable[[int], Executor],
) -> list[dict[str, Any]]:
    """The gaits on the Drake diagram with every integrator setting."""
    space = ParameterSpace.of(scenario)
    vectors = [space.vector(gait) for gait in gaits.values()]
    rows = []
    for name, changed in integrator_settings(scenario).items():
        found = dict(
            evaluate_all(GaitEvaluation(changed), vectors, workers=workers, executor=executor)
        )
        rows += [
            {"trial": trial, "setting": name, **_outcome(found[i].metrics, found[i].failure)}
            for i, trial in enumerate(gaits)
        ]
    return rows


def integrator_settings(scenario: Scenario) -> dict[str, Scenario]:
    """The scenario on the Drake diagram with several integrator settings, by their names."""
    accuracy = scenario.simulation.accuracy
    witness = {"mode_changes": "witness"}
    explicit = {"scheme": "runge_kutta3", "accuracy": 1e-3, "max_step": 2e-3}
    changes: dict[str, dict[str, Any]] = {
        DEFAULT: {},
        "accuracy × 10": {"accuracy": accuracy / 10.0},
        "accuracy × 100": {"accuracy": accuracy / 100.0},
        "witness, steps ≤ 2 ms": {"max_step": 2e-3} | witness,
        "runge_kutta3": explicit,
        "runge_kutta3, witness": explicit | witness,
    }
    return {
        name: scenario.with_changes(
            {"simulation.engine": "drake"}
            | {f"simulation.{key}": value for key, value in change.items()}
        )
        for name, change in changes.items()
    }


def walk(scenario: Scenario, gait: Gait) -> dict[str, Any]:
    """What a gait does on the run's own engine, as in Analysis.best_gaits."""
    result = simulate(scenario=scenario, gait=gait, record=True)
    assert result.trajectory is not None
    since = scenario.simulation.steady_from
    frequencies = signal_frequencies(result.trajectory, since=since)
    return {
        "distance_in": result.metrics.distance_in,
        "off_ground": shares_off_ground(result.trajectory, since=since),
        "frequencies_hz": {name: json_number(value) for name, value in frequencies.items()},
    }


def oscillator_frequency(scenario: Scenario) -> float:
    """Frequency (Hz) of a single oscillator with OSCILLATOR_TAU_A, from 5 s on."""
    single = scenario.with_changes(
        {"robot.tetrahedra": 2, "cpg.signals": "recorded", "simulation.duration": 15.0}
    )
    gait = Gait("single", weights=(), tau_a=OSCILLATOR_TAU_A, tau_b=2.0 * OSCILLATOR_TAU_A)
    signal = signal_samples(single, gait)[:, 0]
    times = single.cpg.listing_step * np.arange(len(signal))
    return dominant_frequency(times[times >= 5.0], signal[times >= 5.0])


def _outcome(metrics: Mapping[str, Any], failure: str | None) -> dict[str, Any]:
    distance = metrics.get("distance", math.nan) / INCH
    return {"distance_in": json_number(distance), "failure": failure}


def shares_off_ground(trajectory: xarray.Dataset, *, since: float) -> dict[str, float]:
    """Share of the time, 0 to 1, in which each tetrahedron is lifted, from `since` (s) on."""
    off = lifted(trajectory.sel(time=slice(since, None)))
    return {str(name): share_of_time(off.sel(tetrahedron=name)) for name in off.tetrahedron.values}


def signal_frequencies(trajectory: xarray.Dataset, *, since: float) -> dict[str, float]:
    """Frequency (Hz) of each oscillator's signal, from `since` (s) on; see dominant_frequency."""
    signals = trajectory.signal.sel(time=slice(since, None))
    return {
        str(name): dominant_frequency(signals.time.values, signals.sel(oscillator=name).values)
        for name in signals.oscillator.values
    }


def main(arguments: Sequence[str]) -> None:
    """Analyses the runs of the given folders."""
    for directory in map(Path, arguments):
        analyse(directory, workers=available_cores())


if __name__ == "__main__":
    main(sys.argv[1:])
