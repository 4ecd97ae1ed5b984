"""Readings of the thesis's text where it is open, ten trials each, compared with its results.

    python runs/readings.py [NAME ...]

Evolves the readings of these names, or all, on the compiled engine with the same seed, and writes
their numbers to thesis/readings.json. After an interruption the script goes on where it stopped;
finished readings are skipped. `python runs/thesis_page.py` shows the numbers.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pandas
from script import chosen, evolved, read_record, read_settings, script, with_defaults

from tetra_drake.evolution.run import Run, load_run
from tetra_drake.files import check_file, read_json, write_whole
from tetra_drake.formatting import ranged
from tetra_drake.lab.study.statistics import interval_of_resamples, resampled
from tetra_drake.optimizers.steady_state import has_levelled_off
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.optimizer_kinds import SteadyState

HERE = Path(__file__).parent
RECORD = HERE / "thesis" / "readings.json"
SCRATCH = Path("out/readings")

Record: TypeAlias = dict[str, list[dict[str, float]]]
"""Numbers of the trials by reading."""

FILE = HERE / "readings.yaml"
DEFAULTS, READINGS, FUTURE, THESIS = read_settings(FILE).values()
"""Readings, and variations that the thesis proposes, by name. THESIS has its results."""
ALL = READINGS | FUTURE
COARSE, FIXED = (READINGS[f"slip-{name}"]["changes"]["engine"] for name in ("coarse", "fixed"))
"""Engines of two readings."""


def run_of(name: str) -> Run:
    """The run of a reading, evolved as far as it is not yet."""
    reading = with_defaults(ALL[name], DEFAULTS, FILE)
    if reading["trials_of"]:
        return run_of(reading["trials_of"])
    if reading["run"]:
        return load_run(HERE / reading["run"])
    base = load_scenario(reading["base"]).on_engine("compiled")
    changes = {"name": f"reading-{name}"} | reading["changes"]
    return evolved(base.with_changes(changes), SCRATCH / name)


def last_iteration(means: Sequence[float], settings: SteadyState) -> int:
    """Iteration after which a trial with these mean fitnesses stops."""
    stops = (i for i in range(len(means)) if has_levelled_off(means[: i + 1], settings))
    return next(stops, len(means) - 1)


def numbers_of(run: Run, trial: int, settings: SteadyState) -> dict[str, float]:
    """Numbers of one of our trials that the thesis gives for its trials. Lengths are in inches."""
    lines = run.iterations.query("trial == @trial").set_index("iteration")
    means = lines["mean_fitness"].to_list()
    last = last_iteration(means, settings)
    made = run.evaluations.query("trial == @trial and iteration <= @last").set_index("index")
    initial, best = made[made["iteration"] == 0], made.loc[lines.at[last, "best_evaluation"]]
    return {
        "initial_best_in": initial.at[initial["fitness"].idxmax(), "distance_in"],
        "initial_farthest_in": initial["distance_in"].max(),
        "backward": (initial["distance"] < 0.0).mean(),
        "best_in": best["distance_in"],
        "farthest_in": made["distance_in"].max(),
        "tau_a_s": best["tau_A"],
        "initial_mean": means[0],
        "mean_200": means[min(last, settings.stop_after)],
        "mean": means[last],
        "last_rise": means[last] - means[max(0, last - settings.stop_window)],
        "iterations": last,
    }


def numbers(name: str) -> list[dict[str, float]]:
    """Numbers of the trials of a reading."""
    run = run_of(name)
    settings = SteadyState(**dict(run.scenario.optimizer) | ALL[name].get("stop", {}))
    trials = range(run.scenario.evolution.trials)
    rows = [numbers_of(run, trial, settings) for trial in trials]
    return [{key: float(f"{value:.5g}") for key, value in row.items()} for row in rows]


# How near a reading is to the thesis.


def results(trials: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Results (...) of our trials, by the names in THESIS. `trials` is their table, or the columns
    (..., trials) of several."""
    names = "initial_best_in", "best_in", "backward"
    initial, best, backward = (np.asarray(trials[name]) for name in names)
    rise, longest = best / initial, best.argmax(axis=-1)[..., np.newaxis]
    return {
        "initial": initial.max(axis=-1),
        "backward": backward.mean(axis=-1),
        "evolved": best.max(axis=-1),
        "rise": rise.mean(axis=-1),
        "best_rise": np.take_along_axis(rise, longest, axis=-1)[..., 0],
    }


def factor(trials: Mapping[str, Any]) -> np.ndarray:
    """Factor (...) by which our results differ from THESIS: the exponential of the root mean square
    of the logarithms of their ratios. `trials` is as for results()."""
    ours = results(trials)
    ratios = [np.maximum(ours[key], 1e-3) / THESIS[key] for key in THESIS]
    return np.asarray(np.exp(np.sqrt(np.mean(np.square(np.log(ratios)), axis=0))))


def factor_interval(trials: pandas.DataFrame) -> tuple[float, float]:
    """95 % interval of the factor, by bootstrap over the trials."""
    drawn = resampled(np.arange(len(trials)), np.random.default_rng(0))[:500]
    return interval_of_resamples(factor({name: trials[name].to_numpy()[drawn] for name in trials}))


def load_tables() -> dict[str, pandas.DataFrame]:
    """The recorded trials, see tables_of(). Raises InputError if the record cannot be read."""
    return read_record(RECORD, tables_of, "readings.py")


def tables_of(record: Record) -> dict[str, pandas.DataFrame]:
    """Tables of the trials by reading, the nearest to the thesis first."""
    tables = {name: pandas.DataFrame(trials) for name, trials in record.items()}
    for table in tables.values():
        table["rise"] = 100.0 * (table["best_in"] / table["initial_best_in"] - 1.0)
    return dict(sorted(tables.items(), key=lambda item: factor(item[1])))


def off_by(trials: pandas.DataFrame) -> str:
    """Text of the factor by which our results differ from THESIS, with its interval."""
    return ranged(float(factor(trials)), *factor_interval(trials))


@script
def main(names: Sequence[str]) -> None:
    """Records the readings of these names, or all. Raises InputError."""
    names = chosen(names, ALL)
    check_file(RECORD)
    for name in names:
        record = read_json(RECORD, "record") if RECORD.exists() else {}
        if name not in record:
            made = record | {name: numbers(name)}
            text = json.dumps({key: made[key] for key in ALL if key in made}, indent=1)
            write_whole(RECORD, text + "\n")
    for name, trials in load_tables().items():
        print(f"{name}: off by a factor of {off_by(trials)}")
