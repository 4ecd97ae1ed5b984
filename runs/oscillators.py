"""What holds evolution back, and what the oscillators that it finds can do.

    python runs/oscillators.py [--page | NAME ...]

Evolves each experiment of oscillators/experiments.yaml in ten trials, in out/runs, and judges the
best gaits: at the same peak of the signals, on disturbed robots, on rough ground and on steps.
trials.jsonl in the folder oscillators/ gets a line for each trial; experiments that are there are
skipped. imitation.json has the network whose signals come nearest to the best ones. Then the script
writes the page README.md and its figure.
"""

from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cma
import numpy as np
import pandas
from matplotlib.figure import Figure
from page import rendered
from record import SCRATCH, load_experiments
from records import append, read
from script import draw_dots, evolved, measured, script
from sine import PERIOD, load_sines, peak, steady_signals

from tetra_drake.engines.simulate import simulate, simulate_many
from tetra_drake.evolution.run import Run
from tetra_drake.figures.style import save_figure
from tetra_drake.files import json_number, read_json, write_whole
from tetra_drake.lab.study.robustness import PERCENT, by_gait, robustness
from tetra_drake.optimizers import optimizer_of
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.parameter_space import ParameterSpace
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.optimizer_kinds import CmaEs
from tetra_drake.scenario.scenario import Scenario

HERE = Path(__file__).parent / "oscillators"
RECORDS, IMITATION = "trials.jsonl", "imitation.json"
EXPERIMENTS = load_experiments(HERE / "experiments.yaml")
PEAK = 2.16
"""Peak (N) of the signals at which distances are compared."""
BUDGETS = 1000, 2000, 4000
"""Numbers of gaits after which the best ones of a trial are judged."""


def alike(space: ParameterSpace, evolution: Any, generator: np.random.Generator) -> Any:
    """CMA-ES over gaits whose weights are equal where oscillators are equally far apart: a weight
    is the first one with its distance and its kind of neurons."""
    keys = list[tuple[object, ...]]()
    for name in space.names:
        pair = re.fullmatch(r"weight (\d+)->(\d+) (\w+)", name)
        keys.append((int(pair[1]) - int(pair[2]), pair[3]) if pair else (name,))
    first = np.array([keys.index(key) for key in keys])
    is_free = first == np.arange(len(first))
    fewer = dataclasses.replace(space, high=np.where(is_free, space.high, space.low))
    inner = optimizer_of(CmaEs())(fewer, evolution, generator)
    return SimpleNamespace(ask=lambda: [each[first] for each in inner.ask()], tell=inner.tell)


def wave(signals: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """The strongest wave in signals (times, oscillators): its frequency (Hz), the lags (degrees)
    from each oscillator to the next, and its complex amplitudes."""
    points = 8 * len(signals)
    spectrum = np.fft.rfft(signals - signals.mean(axis=0), points, axis=0) * 2.0 / len(signals)
    strongest = int(np.abs(spectrum).sum(axis=1).argmax())
    lags = np.degrees(-np.diff(np.angle(spectrum[strongest])))
    frequency = float(np.fft.rfftfreq(points, PERIOD)[strongest])
    return frequency, np.mod(lags + 180.0, 360.0) - 180.0, spectrum[strongest]


def share(signals: np.ndarray, lags: np.ndarray) -> float:
    """Share of the power of signals that is one wave with these lags and equal amplitudes."""
    shape = np.exp(1j * np.radians(np.cumsum([0.0, *lags])))
    power = np.mean(signals**2, axis=0).sum()
    return float(2.0 * abs(shape @ wave(signals)[2] / shape.size) ** 2 / power)


def nearest(scenario: Scenario, lags: np.ndarray) -> Gait:
    """The network of 10,000 whose signals have the largest share() for these lags."""
    space, robot = ParameterSpace.of(scenario), Robot.of(scenario)
    is_free = space.low < space.high
    low, high = space.low[is_free], space.high[is_free]

    def gait(weights: np.ndarray) -> Gait:
        vector = space.low.copy()
        vector[is_free] = weights
        return space.gait(vector, name="nearest")

    options = {"bounds": [low, high], "maxfevals": 10_000, "popsize": 16, "seed": 2, "verbose": -9}
    weights, _ = cma.fmin2(
        lambda each: -share(steady_signals(robot, gait(each)), lags),
        0.5 * (low + high),
        0.3 * float(high[0] - low[0]),
        options,
    )
    return gait(weights)


def sine(frequency: float, lags: np.ndarray, amplitudes: np.ndarray) -> Gait:
    """Phase oscillators of this frequency (Hz), with these lags (degrees) and amplitudes."""
    numbers = {"frequency": frequency, "coupling": 8.0}
    numbers |= {f"amplitude {k}": each for k, each in enumerate(amplitudes, 1)}
    return Gait("", numbers | {f"lag {k}->{k + 1}": x for k, x in enumerate(np.radians(lags), 1)})


def imitation(found: dict[str, Any]) -> dict[str, Any]:
    """How near networks come to the best signals, and what the rest costs: distances (in) of sines
    with the best lags, with the network's, with its amplitudes too, with the lags and frequency of
    evolved networks, and of the network itself."""
    best, evolved_ones = found["phases"]["lags"], found["both"]
    tau = {f"gait_bounds.tau_a_{end}": "0.07 s" for end in ("min", "max")}
    scenario = EXPERIMENTS["low"].scenario("nearest").with_changes(tau)
    gait = nearest(scenario.with_changes({"cpg.listing_step": "2 ms"}), best)
    signals = steady_signals(Robot.of(scenario), gait)
    frequency, lags, wave_of = wave(signals)
    amplitudes = np.abs(wave_of) / np.abs(wave_of).max()
    network = scenario.with_changes(
        {"cpg.gain": f"{scenario.cpg.gain * PEAK / peak(scenario, gait)} N"}
    )
    sines = EXPERIMENTS["phases"].scenario("sines")
    shapes = [(best, np.ones(4)), (lags, np.ones(4)), (lags, amplitudes)]
    gaits = [sine(frequency, *shape) for shape in shapes]
    gaits += [sine(evolved_ones["frequency_hz"], evolved_ones["lags"], np.ones(4)), gait]
    scenarios = [*[sines] * 4, network]
    walks = [simulate(*each) for each in zip(scenarios, gaits, strict=True)]
    return {
        "share": round(share(signals, best), 3),
        "lags_deg": np.round(lags).tolist(),
        "amplitudes": np.round(amplitudes, 2).tolist(),
        "distances_in": [round(walk.metrics.distance_in, 1) for walk in walks],
    }


def judged(run: Run, trial: int) -> dict[str, Any]:
    """What the best gait of a trial does. All distances (in) are at the same PEAK."""
    table, scenario = run.evaluations[run.evaluations["trial"] == trial], run.scenario
    best = [int(table["fitness"][table["index"] < budget].idxmax()) for budget in BUDGETS]
    gaits = [run.gait(trial, int(table.loc[place, "index"])) for place in best]
    frequency, lags, _ = wave(steady_signals(Robot.of(scenario), gaits[-1]))
    peaks = [peak(scenario, gait) for gait in gaits]
    gains = [scenario.cpg.gain * PEAK / each for each in peaks]
    fair = [scenario.with_changes({"cpg.gain": f"{gain} N"}) for gain in gains]
    grounds = [load_scenario(name).terrain for name in ("rough", "steps")]
    others = [fair[-1].with_changes({"terrain": one, "robot.contacts": "all"}) for one in grounds]
    walks = simulate_many([*fair, *others], [*gaits, gaits[-1], gaits[-1]])
    *inches, rough, steps = (json_number(round(measured(walk, "distance_in"), 2)) for walk in walks)
    draws = robustness(fair[-1], gaits[-1], percent=PERCENT, alone=False)
    return {
        "trial": trial,
        "distances_in": inches,
        "peak_n": round(peaks[-1], 3),
        "frequency_hz": round(frequency, 2),
        "lags_deg": [round(float(lag)) for lag in lags],
        "rough_in": rough,
        "steps_in": steps,
        "kept": float(by_gait(draws)["kept"].iloc[0]),
    }


def numbers(records: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Numbers of the page: medians and ranges of the trials, by experiment."""
    found, rest = {}, ["peak_n", "frequency_hz", "rough_in", "steps_in", "kept"]
    for name, own in pandas.DataFrame(records).groupby("experiment", sort=False):
        inches, lags = (np.array([*own[key]]) for key in ("distances_in", "lags_deg"))
        spread = np.array([np.median(inches, 0), inches.min(0), inches.max(0)]).T
        rows = {"trials": inches[:, -1], "spread": spread, "lags": np.median(lags, axis=0)}
        found[str(name)] = rows | own[rest].astype(float).median().to_dict()
    return found


def trials_figure(found: dict[str, Any], line: float) -> Figure:
    """Distances of all trials by experiment; the line is the best sine."""
    figure = Figure(figsize=(8.0, 0.4 * len(found) + 1.0), layout="constrained")
    axes = figure.subplots()
    trials = {EXPERIMENTS[name].title: each["trials"] for name, each in found.items()}
    draw_dots(axes, trials, best=line)
    axes.set(xlabel=f"distance in 15 s at a peak of {PEAK} N, inches")
    return figure


def farthest_sine(found: dict[str, Any]) -> float:
    """Distance (in) of the farthest sine of two numbers."""
    return float(max(found["sine"]["trials"]))


def page(found: dict[str, Any]) -> str:
    """Text of the page from numbers()."""
    farthest = farthest_sine(found)
    copy = read_json(HERE / IMITATION, "record")
    rows = {"experiments": EXPERIMENTS, "found": found, "copy": copy, "sines": load_sines()}
    return rendered("oscillators.md", **rows, sine=farthest, peak=PEAK)


@script
def main(names: Sequence[str]) -> None:
    """Makes what is missing, and writes the page."""
    done = {one["experiment"] for one in read(HERE / RECORDS)}
    for name in [] if "--page" in names else names or EXPERIMENTS:
        if name not in done:
            optimizer = alike if name == "alike" else None
            run = evolved(EXPERIMENTS[name].scenario(name), SCRATCH / name, optimizer)
            lines = [judged(run, trial) for trial in range(run.scenario.evolution.trials)]
            append(HERE / RECORDS, [{"experiment": name} | one for one in lines])
            print(name, [one["distances_in"][-1] for one in lines], flush=True)
    found = numbers(read(HERE / RECORDS))
    if not (HERE / IMITATION).exists():
        write_whole(HERE / IMITATION, json.dumps(imitation(found)) + "\n")
    save_figure(trials_figure(found, farthest_sine(found)), HERE, "trials", kinds=["svg"])
    write_whole(HERE / "README.md", page(found))
