"""The results of a run in a few lines, beside its scenario's reference."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from tetra_drake.engines.simulate import available_cores
from tetra_drake.evolution.optimizers.steady_state import CHILDREN
from tetra_drake.evolution.reevaluation import best_distances
from tetra_drake.evolution.tables import Run, gait_label
from tetra_drake.evolution.trials import TrialStatus
from tetra_drake.formatting import duration, fixed
from tetra_drake.scenario.metrics import METRICS
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
    lines += [f"{name:<32}{ours:>10}   {theirs}".rstrip() for name, ours, theirs in rows]
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
    """The results of a run beside the reference's. Distances are those of the fittest gaits; the
    best trial is the one with the fittest gait of all."""
    statuses, reference = run.statuses, run.manifest.scenario.reference
    rises = [status.improvement_percent for status in statuses]
    best_trial = max(statuses, key=lambda status: status.best_fitness)

    def row(name: str, values: Sequence[float], key: str, unit: str) -> Comparison:
        theirs = getattr(reference, key, None)
        shown = "" if theirs is None else f"{theirs / (INCH if unit == 'in' else 1.0):.4g} {unit}"
        finite = [value for value in values if math.isfinite(value)] or [math.nan]
        ours = max(finite) if unit == "in" else float(np.mean(finite))
        return Comparison(name, f"{fixed(ours)} {unit}", shown)

    evaluations = sum(status.evaluations for status in statuses)
    times = [CHILDREN * status.wall_time / max(evaluations, 1) for status in statuses]
    initial = [status.initial_best_distance_in for status in statuses]
    best = [status.best_distance_in for status in statuses]
    return [
        row("best initial gait", initial, "best_initial_distance", "in"),
        row("best evolved gait", best, "best_distance", "in"),
        row("improvement, mean of trials", rises, "mean_improvement", "%"),
        row("improvement, best trial", [best_trial.improvement_percent], "best_improvement", "%"),
        row("time per two evaluations", [sum(times)], "iteration_time", "s"),
    ]
