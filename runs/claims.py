"""The thesis's claims about motion, tested on the best gaits of the run `thesis`.

    python runs/claims.py

Writes thesis/motion.json, the numbers of each gait, and prints the table of the claims. Gaits under
directional friction are evolved in out/claims. After an interruption the script continues there.

A claim is tested on cases, such as gaits or tetrahedra. It holds if at least 90 % of its cases meet
the criterion in the table, and does not hold if at most 10 % do.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import page
import pandas
import xarray
from scipy.spatial.transform import Rotation
from script import evolved, read_record, script
from settle import difference_of_means

from tetra_drake.engines.simulate import simulate
from tetra_drake.evolution.run import Run, load_run
from tetra_drake.files import check_file, write_whole
from tetra_drake.formatting import fixed, listed, ranged
from tetra_drake.laws.curves import travelling_index
from tetra_drake.machine import versions
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.measures import dominant_frequency, off_ground
from tetra_drake.scenario.metrics import Metrics
from tetra_drake.scenario.robot_tetrahedra import Tetrahedra
from tetra_drake.settings.units import INCH, POUND_FORCE

HERE = Path(__file__).parent
MOTION = HERE / "thesis/motion.json"
SCRATCH = Path("out/claims")
FACTORS = (1, 2, 4)
"""Factors on friction against slip backward."""
TRIALS = {"evolution.trials": 10, "evolution.evaluations": 1000}
"""Trials for each factor."""
FEET = [f"T{number} bottom_left" for number in range(1, 6)]
"""A foot of each tetrahedron, from the rear. The other one moves as it does."""
MOST, LEAST = 0.9, 0.1
"""Least share of cases of a claim that holds, and greatest share of one that does not."""


# Measures of a gait


def phase_lags(times: np.ndarray, waves: np.ndarray, frequency: float) -> np.ndarray:
    """Lags (positions - 1,) of waves (samples, positions) behind the wave before, in cycles from
    -0.5 to 0.5. The times are evenly spaced."""
    window = np.hanning(len(times)) * np.exp(-1j * math.tau * frequency * times)
    components = window @ (waves - waves.mean(axis=0))
    return -np.angle(components[1:] / components[:-1]) / math.tau


def delay(cause: np.ndarray, effect: np.ndarray, most: int) -> tuple[float, float]:
    """Delay of a signal behind another in samples, at most `most`, and their correlation there. A
    parabola through the greatest correlation and its neighbours gives parts of a sample."""
    signal, late = pandas.Series(cause), pandas.Series(effect)
    values = [signal.corr(late.shift(-lag)) for lag in range(-most, most + 1)]
    top = int(np.argmax(values[1:-1])) + 1
    before, at, after = values[top - 1 : top + 2]
    return top - most + 0.5 * (before - after) / (before - 2.0 * at + after), at


def rhythm(trajectory: xarray.Dataset) -> dict[str, Any]:
    """Rhythm of a gait: its period (s), and numbers of the feet's forward speeds.

    They are: travelling index, lags (cycles) behind the foot before, deviation / mean, percents of
    time below zero, and correlation with the speed one period later. Empty if the signals do not
    oscillate at least twice.
    """
    times, signals = trajectory.time.values, trajectory.signal.values
    speeds = trajectory.v_WN.sel(node=FEET, axis="x").values
    frequency = dominant_frequency(times, signals[:, np.ptp(signals, axis=0).argmax()])
    if not frequency * np.ptp(times) >= 2.0:
        return {}
    later = round(1.0 / (frequency * (times[1] - times[0])))
    return {
        "period": 1.0 / frequency,
        "index": travelling_index(speeds),
        "lags": phase_lags(times, speeds, frequency),
        "uneven": speeds.std(axis=0) / speeds.mean(axis=0),
        "backward": 100.0 * (speeds < 0.0).mean(axis=0),
        "again": [pandas.Series(speed).autocorr(later) for speed in speeds.T],
    }


def travel(trajectory: xarray.Dataset) -> dict[str, np.ndarray]:
    """Percents of the feet's travel along x, and of the time, in flight, in slip and in stick. In
    flight, no normal force acts on a tetrahedron."""
    steps = np.diff(trajectory.p_WN.sel(node=FEET, axis="x").values, axis=0)
    flies = off_ground(trajectory).groupby("contact_body").all("contact").values[1:]
    slips = trajectory.friction_mode.sel(contact=FEET, horizontal="x").values[1:] != 0
    found = {}
    for name, during in {"flight": flies, "slip": slips & ~flies, "stick": ~slips & ~flies}.items():
        found[name] = 100.0 * (steps * during).sum(axis=0) / steps.sum(axis=0)
        found[f"{name}_time"] = 100.0 * during.mean(axis=0)
    return found


def responses(trajectory: xarray.Dataset, period: float) -> dict[str, Any]:
    """Response of each pair of driven cables to its signal S.

    "ratio" is the deviation of the tension T in percent of the deviation of S. Of three effects
    there are the delay (ms) behind S and the correlation at this delay: of T ("late"), of S - T
    ("yields"), and of the cable's shortening ("shortens").
    """
    spacing = float(trajectory.time[1] - trajectory.time[0])
    rows = []
    for oscillator in trajectory.oscillator.values:
        cable = trajectory.sel(cable=f"{oscillator} outer bottom_left", oscillator=oscillator)
        signal, tension = cable.signal.values, cable.tension.values
        if not np.ptp(signal) > 0.0:
            continue  # the others silence this oscillator
        row = {"ratio": 100.0 * tension.std() / signal.std()}
        effects = {"late": tension, "yields": signal - tension, "shortens": -cable.length.values}
        for name, effect in effects.items():
            late, row[f"{name}_shape"] = delay(signal, effect, round(0.5 * period / spacing))
            row[name] = 1e3 * spacing * late
        rows.append(row)
    return columns(rows)


def rotation(trajectory: xarray.Dataset) -> dict[str, np.ndarray]:
    """Ranges (degrees) of each tetrahedron's yaw, pitch and roll, and percents of the variance of
    its foot's height that come with rotation."""
    quaternions = trajectory.q_WB.transpose("body", "time", "quaternion").values
    turned = [Rotation.from_quat(q, scalar_first=True).as_euler("ZYX", True) for q in quaternions]
    yaw, pitch, roll = np.ptp(turned, axis=1).T
    height = trajectory.p_WN.sel(node=FEET, axis="z").values
    swing, rotated = height - height.mean(axis=0), height - trajectory.p_WB.sel(axis="z").values
    lifting = 100.0 * (swing * rotated).mean(axis=0) / swing.var(axis=0)
    return {"yaw": yaw, "pitch": pitch, "roll": roll, "lifting": lifting}


def asymmetry(trajectory: xarray.Dataset) -> float:
    """Greatest difference of left and right forces, relative to the mean of each kind of force."""
    friction = trajectory.friction_force.sel(horizontal="x")
    found = []
    for forces in (trajectory.normal_force, friction, trajectory.tension):
        names = forces[forces.dims[1]].str
        left, right = (forces.values[:, names.endswith(side)] for side in ("left", "right"))
        found.append(np.abs(left - right).max() / np.abs(forces.values).mean())
    return float(max(found))


# The record


def simulated(run: Run, gait: Gait, period: str) -> tuple[Metrics, xarray.Dataset]:
    """Metrics of a gait of a run, and its trajectory from `simulation.steady_from` on. `period` is
    the time between samples."""
    scenario = run.scenario.with_changes({"simulation.sample_period": period})
    result = simulate(scenario, gait, record=True)
    start = scenario.simulation.settling_time
    return result.metrics, result.trajectory.sel(time=slice(start, None))


def of_best(run: Run, gait: Gait) -> dict[str, Any]:
    """The numbers of a best gait, by tetrahedron or pair of cables from the rear where they differ;
    also the least gap of struts (in) and tension (lbf)."""
    metrics, trajectory = simulated(run, gait, "5 ms")
    assert isinstance(run.scenario.robot, Tetrahedra)
    found = rhythm(trajectory) | {"asymmetry": asymmetry(trajectory)}
    found["gap"] = (metrics.clearance - run.scenario.robot.strut_diameter) / INCH
    found["taut"] = metrics.tension / POUND_FORCE
    found |= responses(trajectory, found["period"])
    return found | travel(trajectory) | rotation(trajectory)


def of_initial(run: Run, gait: Gait) -> dict[str, Any]:
    """Distance (in) of an initial gait in the steady walk, and share of feet that lag behind the
    foot before; empty as rhythm()."""
    metrics, trajectory = simulated(run, gait, "10 ms")
    found = rhythm(trajectory)
    if not found:
        return {}
    return {"way": metrics.steady_distance / INCH, "lagging": (found["lags"] > 0.0).mean()}


def by_friction(coulomb: Run, factor: int) -> dict[str, Any]:
    """Distances (in) with a factor on friction against slip backward: of the fittest gaits of new
    trials, and of the fittest gaits of a run."""
    scenario = coulomb.scenario.with_changes({"friction.backward": factor})
    run = evolved(scenario.with_changes(TRIALS), SCRATCH / f"backward_{factor}")
    again = [simulate(scenario, gait).metrics.distance_in for gait in coulomb.gaits()]
    return {"factor": factor, "evolved": run.best()["distance_in"], "replayed": again}


def columns(rows: Iterable[Mapping[str, Any]]) -> dict[str, list[Any]]:
    """Lists of the numbers of several gaits, by name. Empty gaits are left out."""
    full = [row for row in rows if row]
    return {name: [np.asarray(row[name]).tolist() for row in full] for name in full[0]}


def make_record() -> dict[str, Any]:
    """The record: numbers of the best gaits, of the initial gaits, and by factor of friction; also
    the larger of twist and drift (in) of each gait."""
    run, coulomb = load_run(HERE / "thesis"), load_run(HERE / "coulomb")
    best, initial = run.best(), run.initial()
    gaits = [run.gait(row["trial"], row["index"]) for _, row in initial.iterrows()]
    aside = [rows[["twist", "lateral_drift"]].max(axis=1) / INCH for rows in (best, initial)]
    return {
        "versions": versions(),
        "best": columns(of_best(run, gait) for gait in run.gaits()) | {"aside": aside[0].tolist()},
        "initial": columns(of_initial(run, gait) for gait in gaits) | {"aside": aside[1].tolist()},
        "friction": columns(by_friction(coulomb, factor) for factor in FACTORS),
    }


# The table


def over(values: np.ndarray, digits: int = 0) -> str:
    """Median and range of values as text."""
    return page.over([np.median(values), np.min(values), np.max(values)], digits)


def each(values: np.ndarray, digits: int = 0) -> str:
    """Medians over the gaits (gaits, columns) as text."""
    return listed([fixed(median, digits) for median in np.median(values, axis=0)])


def verdict(met: np.ndarray) -> str:
    """Verdict on a claim from the cases that meet its criterion."""
    share = met.mean()
    words = "holds" if share >= MOST else "holds in part" if share > LEAST else "does not hold"
    return f"{words} ({met.sum()} of {met.size})"


def _as_array(values: list[Any]) -> np.ndarray:
    """Numbers of the gaits (gaits, ...); in one row if gaits have different counts of them."""
    counts = {len(value) for value in values if isinstance(value, list)}
    return np.concatenate(values) if len(counts) > 1 else np.array(values)


def claims(record: Mapping[str, Any]) -> str:
    """Table of the claims: criterion for a case, result as median and range, and verdict.

    The template has a line for each claim, so that a criterion in words stands beside its formula.
    """
    numbers = {
        part: {name: _as_array(values) for name, values in record[part].items()}
        for part in ("best", "initial", "friction")
    }
    alike, *directional = numbers["friction"]["evolved"]
    gains = listed([ranged(*difference_of_means(alike, inches)) for inches in directional])
    tools = {"over": over, "each": each, "verdict": verdict, "listed": listed, "gains": gains}
    return page.rendered("claims.md", **numbers, **tools)


@script
def main(_: Sequence[str] = ()) -> None:
    """Writes the record and prints the table."""
    check_file(MOTION)
    write_whole(MOTION, json.dumps(make_record(), indent=1, allow_nan=False) + "\n")
    print(read_record(MOTION, claims, "claims.py"))
