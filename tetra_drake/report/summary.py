"""The results of a run in a few lines, beside its scenario's reference."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from tetra_drake.evolution.reevaluation import best_distances
from tetra_drake.evolution.run import Run, gait_label
from tetra_drake.evolution.trials import TrialStatus
from tetra_drake.formatting import aligned, duration, fixed, signed
from tetra_drake.machine import available_cores
from tetra_drake.optimizers.steady_state import CHILDREN
from tetra_drake.scenario.metric_units import METRICS
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.units import INCH, customary

if TYPE_CHECKING:
    import pandas


class Comparison(NamedTuple):
    """A number of ours and the reference's, with units; "" where the reference has none."""

    name: str
    ours: str
    reference: str


class MetricRow(NamedTuple):
    """A metric of some gaits as people read it."""

    name: str
    unit: str
    values: list[str]


def metric_rows(gaits: Sequence[pandas.Series]) -> list[MetricRow]:
    """Fitness and metrics of gaits, rows of `Run.evaluations`; what none of them has, as in older
    records, is left out. In the end, the share of time that each tetrahedron is lifted, in %."""
    rows = [MetricRow("fitness", "", [fixed(gait["fitness"], 3) for gait in gaits])]
    for name, unit in METRICS.items():
        size, read = customary(unit)
        values = [fixed(gait[name] / size, 3) for gait in gaits]
        rows.append(MetricRow(name.replace("_", " "), read, values))
        if name == "distance":
            worst = [fixed(gait.get("worst_distance_in", math.nan), 3) for gait in gaits]
            rows.append(MetricRow("distance, worst draw", "in", worst))
    kept = [fixed(100.0 * gait.get("kept", math.nan), 0) for gait in gaits]
    rows.append(MetricRow("draws kept, disturbed", "%", kept))
    shares = [[gait[n] for n in gait.index if n.startswith("lifted_T")] for gait in gaits]
    percents = [" ".join(fixed(100.0 * share, 0) for share in each) for each in shares]
    rows.append(MetricRow(f"lifted, T1 to T{len(shares[0])}", "%", percents))
    return [row for row in rows if any(value.strip("- ") for value in row.values)]


def summary(run: Run) -> str:
    """The lines printed at the end of a run. Distances are those of the fittest gaits."""
    lines = [_trial(status) for status in run.statuses]
    for trial, _, on_diagram in best_distances(run):
        if math.isfinite(on_diagram):
            lines[trial] += f" ({fixed(on_diagram)} in on the Drake diagram)"
    reference = run.manifest.scenario.reference
    source = reference.source if reference else ""
    rows = [Comparison("", "this run", source), *comparisons(run)]
    lines += [line.rstrip() for line in aligned(rows).splitlines()]
    lines += _metrics_of_the_best(run)
    replay, report = run.directory / "replay.html", run.directory / "report.html"
    if replay.exists() and report.exists():
        lines.append(f"open {replay} in a browser to see the best gait walk, {report} for more")
    return "\n".join(lines)


def _metrics_of_the_best(run: Run) -> list[str]:
    """The metrics of the fittest gait beside those of its trial's best initial one."""
    if run.best().empty:
        return []
    trial, best = run.fittest()
    gaits = [run.evaluation(trial, index) for index in (run.initial_best(trial), best)]
    rows = [MetricRow("", "", ["initial", "fittest"]), *metric_rows(gaits)]
    widths = [max(len(row.values[i]) for row in rows) for i in range(2)]
    lines = [f"fittest gait, {gait_label(gaits[1])}, beside its trial's fittest initial one:"]
    for name, unit, values in rows:
        cells = [value.rjust(width) for value, width in zip(values, widths, strict=True)]
        lines.append(f"{name:<24}{'  '.join(cells)} {unit}".rstrip())
    return lines


def _trial(status: TrialStatus) -> str:
    text = f"trial {status.number}: {status.stop or 'not ended'} after iteration {status.iteration}"
    text += f", {status.evaluations} evaluations, {status.failures} failed; "
    if math.isfinite(status.mean_fitness):
        initial, mean = status.initial_mean_fitness, status.mean_fitness
        text += f"mean fitness {fixed(initial)} -> {fixed(mean)}, "
    initial, best = status.initial_best_distance_in, status.best_distance_in
    return text + f"best distance {fixed(initial)} -> {fixed(best)} in"


def whole_experiment(scenario: Scenario, *, seconds: float) -> str:
    """What evolving on a whole scenario takes on this machine's cores, and its command; seconds:
    wall time per evaluation on the compiled engine."""
    settings, cores, name = scenario.evolution, available_cores(), scenario.name
    evaluations = settings.trials * settings.budget
    time = duration(evaluations * seconds / cores)
    return (
        f"this is a first look; scenario {name}, {settings.trials} trials of at most "
        f"{settings.max_iterations} iterations, takes about {time} (h:mm:ss) on the {cores} cores "
        f"here: tetra-drake evolve --scenario {name} --engine compiled --out runs/{name}"
    )


def comparisons(run: Run) -> list[Comparison]:
    """The results of a run beside the reference's.

    Distances are those of the fittest gaits; the best gait is the fittest of all. Improvements are
    in inches, and in percent where the initial distances are long enough to compare with.
    """
    statuses, reference = run.statuses, run.manifest.scenario.reference
    best = max(statuses, key=lambda status: status.best_fitness)
    initial = [status.initial_best_distance_in for status in statuses]
    evaluations = sum(status.evaluations for status in statuses)
    wall_time = sum(status.wall_time for status in statuses)
    iteration_time = CHILDREN * wall_time / max(evaluations, 1)

    def row(name: str, ours: str, key: str, unit: str) -> Comparison:
        theirs = getattr(reference, key, None)
        shown = "" if theirs is None else f"{theirs / (INCH if unit == 'in' else 1.0):.4g} {unit}"
        return Comparison(name, ours, shown)

    return [
        row(
            "best initial gait",
            f"{fixed(_finite(initial).max())} in",
            "best_initial_distance",
            "in",
        ),
        row("best evolved gait", f"{fixed(best.best_distance_in)} in", "best_distance", "in"),
        row("improvement, mean of trials", _improvement(statuses), "mean_improvement", "%"),
        row("improvement, best gait's trial", _improvement([best]), "best_improvement", "%"),
        row("time per two evaluations", f"{fixed(iteration_time)} s", "iteration_time", "s"),
    ]


def _improvement(statuses: Sequence[TrialStatus]) -> str:
    """Mean gain of trials in inches, and in percent if all trials have one."""
    gain = f"{signed(_finite([status.gain_in for status in statuses]).mean())} in"
    percent = float(np.mean([status.gain_percent for status in statuses]))
    return f"{gain} ({fixed(percent, 0)} %)" if math.isfinite(percent) else gain


def _finite(values: Sequence[float]) -> np.ndarray:
    """The finite ones of the values; NaN alone if there is none."""
    return np.array([value for value in values if math.isfinite(value)] or [math.nan])
