"""The table that sets the experiment's results beside the thesis's."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tetra_drake import thesis
from tetra_drake.evolution.optimizers.steady_state import CHILDREN
from tetra_drake.evolution.summary import improvement_percent
from tetra_drake.experiment.markdown import fixed, markdown_table
from tetra_drake.experiment.recorded import Experiment, RecordedRun
from tetra_drake.experiment.variations import DEFAULT
from tetra_drake.figures.evolution import table_8_two_best

if TYPE_CHECKING:
    import pandas

ARROW = "\N{RIGHTWARDS ARROW}"
DASH = "\N{EN DASH}"

_NEAR_LIMIT = 0.01  # s


@dataclass(frozen=True)
class Row:
    """One number of the thesis's and what the runs have in its place."""

    name: str
    thesis: str
    ours: list[str]
    """In the order of the runs."""
    remark: str = ""
    """What there is to say where they differ."""


def comparison_table(experiment: Experiment) -> str:
    """The thesis's numbers, the runs', and a sentence where they differ, as Markdown."""
    runs = list(experiment.values())
    rows = [
        *_size(runs),
        *_initial(runs),
        *_evolved(runs),
        *_gait(runs),
        *_optimum(runs),
    ]
    headings = ["", "thesis", *(f"ours, `{run.name}`" for run in runs), "where they differ"]
    return markdown_table(
        headings,
        [[row.name, row.thesis, *row.ours, row.remark] for row in rows],
        text_columns=(0, len(headings) - 1),
    )


def _size(runs: list[RecordedRun]) -> Iterator[Row]:
    yield Row("trials", "10", [_trials(run) for run in runs])
    iterations = {run.name: [status.iteration for status in run.statuses] for run in runs}
    limits = {run.name: run.scenario.evolution.max_iterations for run in runs}
    at_limit = [
        f"{sum(i >= limits[name] for i in done)} of {len(done)} in `{name}`"
        for name, done in iterations.items()
    ]
    yield Row(
        "iterations of a trial, median (most)",
        "at most 2000",
        [f"{np.median(done):.0f} ({max(done)})" for done in iterations.values()],
        f"Trials that reached the limit of iterations: {_listed(at_limit)}. In the thesis the best "
        "one did.",
    )
    seconds = {
        run.name: CHILDREN * float(run.tables.evaluations["wall_time_s"].median()) for run in runs
    }
    yield Row(
        "seconds per iteration",
        f"{thesis.SECONDS_PER_ITERATION:g}",
        [f"{value:.2g}" for value in seconds.values()],
        "Median, of two simulations; "
        f"{_times_faster(seconds, thesis.SECONDS_PER_ITERATION)}, on another computer.",
    )


def _initial(runs: list[RecordedRun]) -> Iterator[Row]:
    best = {
        run.name: max(status.initial_best_distance_in for status in run.statuses) for run in runs
    }
    yield Row(
        "best initial distance, in",
        f"about {thesis.BEST_INITIAL_DISTANCE_IN:g}",
        [fixed(value) for value in best.values()],
        _farther(best, thesis.BEST_INITIAL_DISTANCE_IN),
    )
    backward = {run.name: float((run.initial["distance_in"] < 0.0).mean()) for run in runs}
    unlike = [f"`{name}`" for name, share in backward.items() if not 0.4 <= share < 0.5]
    yield Row(
        "initial gaits that go backward",
        thesis.SHARE_BACKWARD,
        [f"{100.0 * backward[run.name]:.0f} % of {len(run.initial)}" for run in runs],
        f"Not within 40 to 50 %: {_listed(unlike)}." if unlike else "",
    )


def _evolved(runs: list[RecordedRun]) -> Iterator[Row]:
    best = {run.name: run.best_trial.best_distance_in for run in runs}
    yield Row(
        "best evolved distance, in",
        f"{thesis.BEST_EVOLVED_DISTANCE_IN:g}",
        [fixed(value) for value in best.values()],
        _farther(best, thesis.BEST_EVOLVED_DISTANCE_IN),
    )
    yield Row(
        "the same gait on the Drake diagram, in",
        DASH,
        [fixed(_on_diagram(run)) for run in runs],
    )
    means = {
        run.name: [(s.initial_mean_fitness, s.mean_fitness) for s in run.statuses] for run in runs
    }
    risen = {name: sum(last > first for first, last in ends) for name, ends in means.items()}
    short = [
        f"in {risen[name]} of {len(ends)} trials of `{name}`, which is worse"
        for name, ends in means.items()
        if risen[name] < len(ends)
    ]
    yield Row(
        "mean fitness, average trial, in",
        "rises in all trials",
        [_rise(*np.mean(ends, axis=0)) for ends in means.values()],
        (f"It rises only {_listed(short)}. " if short else "It rises in all trials. ")
        + "The mean of an initial population can be zero or less, so there is no percentage.",
    )
    yield Row(
        "mean fitness, best trial, in",
        DASH,
        [_rise(run.best_trial.initial_mean_fitness, run.best_trial.mean_fitness) for run in runs],
    )
    average = {
        run.name: _mean([improvement_percent(status) for status in run.statuses]) for run in runs
    }
    yield Row(
        "rise of the best distance, average trial",
        f"{thesis.MEAN_IMPROVEMENT_PERCENT:g} %",
        [f"{fixed(value, 0)} %" for value in average.values()],
        _larger(average, thesis.MEAN_IMPROVEMENT_PERCENT),
    )
    of_best = {run.name: improvement_percent(run.best_trial) for run in runs}
    own = 100.0 * (thesis.BEST_EVOLVED_DISTANCE_IN / thesis.BEST_INITIAL_DISTANCE_IN - 1.0)
    yield Row(
        "rise of the best distance, trial with the best gait",
        f"{thesis.BEST_IMPROVEMENT_PERCENT:g} %",
        [f"{fixed(value, 0)} %" for value in of_best.values()],
        f"{_larger(of_best, thesis.BEST_IMPROVEMENT_PERCENT)} The thesis's own "
        f"{thesis.BEST_EVOLVED_DISTANCE_IN:g} in is {own:.0f} % above its "
        f"{thesis.BEST_INITIAL_DISTANCE_IN:g} in: its percentages have another start.",
    )


def _gait(runs: list[RecordedRun]) -> Iterator[Row]:
    names = [", ".join(run.analysis.best_gaits["off_ground"].iloc[0]) for run in runs]
    yield Row(
        f"time off the ground of {names[0]}, best gait, %",
        "no number",
        [_percentages(_best_walk(run, "off_ground")) for run in runs],
        "The thesis shows (Fig. 20) that normal forces are zero at times. Here: from "
        f"{runs[0].scenario.simulation.steady_from:g} s on, while none of its contact nodes bears "
        "a normal force.",
    )
    single = runs[0].analysis
    swing = {run.name: run.analysis.oscillator_frequency_hz for run in runs}
    for_theirs = 1.0 / (2.0 * math.pi * thesis.OSCILLATOR_FREQUENCY_HZ)
    yield Row(
        f"frequency of a single oscillator, τ_A = {single.oscillator_tau_a_s:g} s, Hz",
        f"about {thesis.OSCILLATOR_FREQUENCY_HZ:g}",
        [fixed(value) for value in swing.values()],
        "The thesis does not say for which τ_A. The equations give 1/(2π τ_A): "
        f"{thesis.OSCILLATOR_FREQUENCY_HZ:g} Hz for {for_theirs:.3f} s.",
    )
    yield Row(
        "frequency of each signal, best gait, Hz",
        "no number",
        [
            ", ".join(fixed(_nan(value)) for value in _best_walk(run, "frequencies_hz").values())
            for run in runs
        ],
        "Where the spectrum of the signal has its peak.",
    )


def _optimum(runs: list[RecordedRun]) -> Iterator[Row]:
    limits = {run.name: run.scenario.gait_bounds.tau_a_min for run in runs}
    taus = {run.name: run.best["tau_a_s"] for run in runs}
    near = [
        f"{(tau < limits[name] + _NEAR_LIMIT).sum()} of {len(tau)} in `{name}`"
        for name, tau in taus.items()
    ]
    fixed_taus = [
        f"`{run.name}`" for run in runs if run.scenario.evolution.tau_mutation == "listing"
    ]
    note = f" Mutation never changes τ_A in {_listed(fixed_taus)}." if fixed_taus else ""
    yield Row(
        "τ_A of the best gaits, median (most), s",
        f"to the limit, {runs[0].scenario.gait_bounds.tau_a_min:g}",
        [f"{fixed(tau.median(), 3)} ({fixed(tau.max(), 3)})" for tau in taus.values()],
        f"Trials whose best gait is within {_NEAR_LIMIT:g} s of the limit: {_listed(near)}.{note}",
    )
    tables = [table_8_two_best(run.tables, run.best_trial.number) for run in runs]
    differences = [None if table is None else table["difference"] for table in tables]
    weights = thesis.TWO_BEST_WEIGHTS
    shown: list[tuple[str, str, Callable[..., str]]] = [
        ("fitness, in", f"{thesis.TWO_BEST_FITNESS:g}", lambda d: fixed(d["fitness"], 4)),
        (
            "weights, least to most",
            f"{min(weights):g} to {max(weights):g}",
            lambda d: f"{fixed(_weights(d).min(), 4)} to {fixed(_weights(d).max(), 4)}",
        ),
        ("τ_A, s", f"{thesis.TWO_BEST_TAU_S:g}", lambda d: fixed(d["tau_A"], 4)),
    ]
    remarks = ["Of the trial with the best gait (Table 8).", "", ""]
    for (name, theirs, text), remark in zip(shown, remarks, strict=True):
        ours = ["-" if difference is None else text(difference) for difference in differences]
        yield Row(f"difference of the two best genomes: {name}", theirs, ours, remark)


def _weights(difference: pandas.Series) -> pandas.Series:
    return difference[[name for name in difference.index if name.startswith("w")]]


def _trials(run: RecordedRun) -> str:
    ended = sum(status.stop is not None for status in run.statuses)
    trials = run.scenario.evolution.trials
    return f"{trials}" if ended == trials else f"{ended} of {trials} ended"


def _best_walk(run: RecordedRun, column: str) -> dict[str, float]:
    """What the analysis holds of the run's best gait."""
    walks = run.analysis.best_gaits.set_index("trial")
    found: dict[str, float] = walks.loc[run.best_trial.number, column]
    return found


def _mean(values: list[float]) -> float:
    finite = [value for value in values if math.isfinite(value)]
    return float(np.mean(finite)) if finite else math.nan


def _on_diagram(run: RecordedRun) -> float:
    """The distance (in) of the run's best gait on the Drake diagram, default settings."""
    again = run.analysis.resimulations.set_index(["trial", "setting"])["distance_in"]
    return float(again[(run.best_trial.number, DEFAULT)])


def _nan(value: float | None) -> float:
    return math.nan if value is None else value


def _percentages(shares: Mapping[str, float]) -> str:
    return ", ".join(f"{100.0 * share:.0f}" for share in shares.values())


def _rise(first: float, last: float) -> str:
    return f"{fixed(first)} {ARROW} {fixed(last)}"


def _farther(ours: Mapping[str, float], theirs: float) -> str:
    percent = {name: 100.0 * (value / theirs - 1.0) for name, value in ours.items()}
    more = [f"`{name}` ({value:.0f} %)" for name, value in percent.items() if value >= 0.0]
    less = [f"`{name}` ({-value:.0f} %)" for name, value in percent.items() if value < 0.0]
    return _verdict("Farther", more, "less far", less)


def _larger(ours: Mapping[str, float], theirs: float) -> str:
    more = [f"`{name}`" for name, value in ours.items() if value >= theirs]
    less = [f"`{name}`" for name, value in ours.items() if value < theirs]
    return _verdict("Larger", more, "smaller", less)


def _verdict(better: str, more: list[str], worse: str, less: list[str]) -> str:
    parts = [f"{better} in {_listed(more)}"] if more else []
    parts += [f"{worse}, which is worse, in {_listed(less)}"] if less else []
    text = "; ".join(parts)
    return f"{text[:1].upper()}{text[1:]}." if text else ""


def _times_faster(ours: Mapping[str, float], theirs: float) -> str:
    return _listed(
        [
            f"{_times(theirs / value)} faster in `{name}`"
            if value <= theirs
            else f"{_times(value / theirs)} slower, which is worse, in `{name}`"
            for name, value in ours.items()
        ]
    )


def _times(factor: float) -> str:
    return f"{factor:.0f} times" if factor >= 10.0 else f"{factor:.1f} times"


def _listed(items: list[str]) -> str:
    return " and ".join([", ".join(items[:-1]), items[-1]] if len(items) > 1 else items)
