"""Texts that `simulate` and `evolve` print: the numbers of a result, and those of a run."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tetra_drake.evolution.reevaluation import best_distances
from tetra_drake.evolution.run import Run, gait_label
from tetra_drake.evolution.trials import TrialStatus
from tetra_drake.formatting import Table, fixed, signed
from tetra_drake.optimizers.steady_state import CHILDREN
from tetra_drake.results.metrics import headline_metric, unmet_requirements
from tetra_drake.results.result import SimulationResult
from tetra_drake.scenario.metric_units import METRICS
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.units import customary

if TYPE_CHECKING:
    import pandas


def metrics_table(gaits: Mapping[str, Mapping[str, Any] | pandas.Series]) -> Table:
    """Fitness and metrics of gaits, a column for each, given as rows of `Run.evaluations`; metrics
    that none of them has are left out."""
    columns = list(gaits.values())
    cells = {"fitness": [fixed(gait["fitness"], 3) for gait in columns]}
    for name, unit in METRICS.items():
        size, read = customary(unit)
        title = name.replace("_", " ")
        heading = f"{title} ({read})" if read else title
        cells[heading] = [fixed(gait[name] / size, 3) for gait in columns]
        if name == "distance":
            worst = [gait.get("worst_distance_in", math.nan) for gait in columns]
            cells["distance, worst draw (in)"] = [fixed(inches, 3) for inches in worst]
    kept = [gait.get("kept", math.nan) for gait in columns]
    cells["draws kept, disturbed (%)"] = [fixed(100.0 * share, 0) for share in kept]
    bodies = [name for name in dict(columns[0]) if name.startswith("lifted_T")]
    cells["lifted, body by body (%)"] = [
        " ".join(fixed(100.0 * gait[name], 0) for name in bodies) for gait in columns
    ]
    rows = [[heading, *values] for heading, values in cells.items()]
    with_numbers = [row for row in rows if any(value.strip("- ") for value in row[1:])]
    return Table(["", *gaits], with_numbers)


def result_text(result: SimulationResult) -> str:
    """The metrics of a simulation, what it missed, and what it took."""
    scenario, metrics = result.scenario, result.metrics
    lines = [f"{result.name}: {result.duration:g} s on scenario {scenario.name}"]
    if ground := ground_text(scenario):
        lines.append(f"ground: {ground}")
    table = metrics_table({"": {"fitness": result.fitness} | vars(metrics)})
    first = headline_metric(scenario.objective, vars(metrics)).replace("_", " ")
    rows = sorted(table.rows, key=lambda row: not row[0].startswith(first))
    lines.append(Table(["metric", "value"], rows).text())
    unmet = unmet_requirements(metrics, scenario.require)
    lines += [f"{text} (requirement not met)" for text in unmet]
    seconds, speed = fixed(result.wall_time, 1), fixed(result.duration / result.wall_time, 1)
    work = result.integrator
    lines.append(
        f"simulated in {seconds} s, {speed} times real time: {work.scheme}, "
        f"{scenario.engine.precision}, {work.steps} steps, "
        f"{work.derivative_evaluations} derivative evaluations"
    )
    return "\n".join(lines)


THESIS_GROUND = "flat, the thesis's friction"


def ground_text(scenario: Scenario) -> str:
    """Terrain and friction in a line; empty for the thesis's flat ground and friction.

    For example, "incline (slope 5 deg), Coulomb friction (static 0.5, kinetic 0.5)".
    """
    friction = scenario.engine.friction_text(scenario.friction)
    ground = f"{scenario.terrain.text}, {friction}"
    return "" if ground == THESIS_GROUND else ground


def run_text(run: Run) -> str:
    """The lines printed at the end of a run."""
    texts = [
        "Trials from the first to the last iteration; distances are those of the fittest gaits.",
        trials_table(run).text(),
        Table(["", "this run"], results(run)).text(),
    ]
    if not run.best().empty:
        best = run.fittest()
        gaits = {"initial": run.initial_best(best["trial"]), "fittest": best}
        label = gait_label(best)
        texts.append(f"The fittest gait, {label}, beside its trial's fittest initial one:")
        texts.append(metrics_table(gaits).text())
    replay, report = run.directory / "replay.html", run.directory / "report.html"
    if replay.exists() and report.exists():
        texts.append(f"open {replay} in a browser to see the best gait walk, {report} for more")
    return "\n\n".join(texts)


def trials_table(run: Run) -> Table:
    """The trials of a run from the first to the last iteration, and their best gaits on the Drake
    diagram if they were evaluated there, too."""
    trials = run.statuses
    columns = {
        "trial": [f"{trial.number}" for trial in trials],
        "best distance (in)": [
            _rise(trial.initial_best_distance_in, trial.best_distance_in) for trial in trials
        ],
    }
    if not run.reevaluations.empty:
        distances = {trial: distance for trial, _, distance in best_distances(run)}
        on_diagram = [distances.get(trial.number, math.nan) for trial in trials]
        columns["on the diagram (in)"] = [fixed(distance) for distance in on_diagram]
    if any(math.isfinite(trial.mean_fitness) for trial in trials):
        rises = [_rise(trial.initial_mean_fitness, trial.mean_fitness) for trial in trials]
        columns["mean fitness"] = rises
    columns["iterations"] = [f"{max(trial.iteration, 0)}" for trial in trials]
    columns["evaluations"] = [f"{trial.evaluations}" for trial in trials]
    columns["failed"] = [f"{trial.failures}" for trial in trials]
    columns["state"] = [trial.stop or "not ended" for trial in trials]
    return Table(list(columns), list(zip(*columns.values(), strict=True)))


def _rise(before: float, after: float) -> str:
    return f"{fixed(before)} → {fixed(after)}"


def results(run: Run) -> list[tuple[str, str]]:
    """The results of a run by their names, with units.

    Distances are those of the fittest gaits; the best gait is the fittest of all. Improvements are
    in inches, and in percent where the initial distances are long enough to compare with.
    """
    statuses = run.statuses
    best = max(statuses, key=lambda status: status.best_fitness)
    initial = [status.initial_best_distance_in for status in statuses]
    evaluations = sum(status.evaluations for status in statuses)
    wall_time = sum(status.wall_time for status in statuses)
    iteration_time = CHILDREN * wall_time / max(evaluations, 1)
    return [
        ("best initial gait", f"{fixed(_finite(initial).max())} in"),
        ("best evolved gait", f"{fixed(best.best_distance_in)} in"),
        ("improvement, mean of trials", _improvement(statuses)),
        ("improvement, best gait's trial", _improvement([best])),
        ("time per two evaluations", f"{fixed(iteration_time)} s"),
    ]


def _improvement(statuses: Sequence[TrialStatus]) -> str:
    """Mean gain of trials in inches, and in percent if all trials have one."""
    gain = f"{signed(_finite([status.gain_in for status in statuses]).mean())} in"
    percent = float(np.mean([status.gain_percent for status in statuses]))
    return f"{gain} ({fixed(percent, 0)} %)" if math.isfinite(percent) else gain


def _finite(values: Sequence[float]) -> np.ndarray:
    """The finite ones of the values; NaN alone if there is none."""
    return np.array([value for value in values if math.isfinite(value)] or [math.nan])
