"""Texts of the commands `simulate` and `evolve`: the numbers of a result or of a run."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from tetra_drake.engines.simulate import simulate
from tetra_drake.evolution.run import Run, gait_label
from tetra_drake.evolution.trials import ALL_DONE
from tetra_drake.formatting import TextTable, fixed, rounded, sentence, uncertain
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.remarks import (
    centre_remark,
    overload_remark,
    sinking_remark,
    start_up_remark,
    stillness_remark,
    yielding_remark,
)
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.metrics import (
    METRICS,
    UNITS,
    MetricRanges,
    headline_metric,
    unmet_requirements,
)
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.settings.quantities import separate
from tetra_drake.settings.section import value_at
from tetra_drake.settings.units import Units

if TYPE_CHECKING:
    import pandas

_SHARES = ("kept", *(name for name, metric in METRICS.items() if metric.is_share))
"""Names of the numbers that are shown in percent."""

_TITLES = {"worst_distance": "distance in the worst draw", "kept": "robust"}
"""Titles of numbers that are no metrics."""

_NOTES = {name: metric.note for name, metric in METRICS.items()} | {
    "kept": "draws that cost at most a tenth"
}
"""Notes beside the numbers of a table, by name."""

RANGES = (
    "30 more starts were moved by 1 nm to 1e-7 m; a number that then differs has its range in "
    "brackets"
)
"""Remark on the ranges that metrics_table() shows."""

_NOTHING = 5e-4
"""Threshold for a row of a table: it may be left out if all its numbers, as shown, are smaller."""
_NOISE = 1e-5
"""Threshold for a number of a gait, as shown: smaller ones are 0, as rounding errors add up."""


def metrics_table(
    names: Sequence[str],
    gaits: Sequence[Mapping[str, Any] | pandas.Series],
    scenario: Scenario,
    spread: MetricRanges = MappingProxyType({}),
) -> TextTable:
    """Table of fitness and metrics, with a column per gait under its heading in `names`.

    A gait is a row of `Run.evaluations`, or a mapping with the same keys. The first row is the main
    metric of the objective (see headline_metric()). Numbers that are zero for all gaits are left
    out, unless the scenario's objective or requirements name them. Numbers of the last gait have
    as many digits as its `spread` allows; large ones also have their range.
    """
    first = headline_metric(scenario.objective, gaits[-1])
    always = {"fitness", "distance", *scenario.objective, *scenario.require}
    rows = []
    for name in dict.fromkeys([first, "fitness", "worst_distance", *METRICS, "kept"]):
        size, title = _size_and_title(name, scenario.units)
        values = [gait.get(name, math.nan) / size for gait in gaits]
        has_some = any(math.isfinite(value) and abs(value) >= _NOTHING for value in values)
        if has_some or name in always:
            whole = name in _SHARES
            digits = [fixed(x, 0) if whole or abs(x) < _NOISE else rounded(x) for x in values]
            low, high = (x / size for x in spread.get(name, (math.nan, math.nan)))
            digits[-1] = uncertain(digits[-1], values[-1], low, high)
            rows.append([title, *digits, _NOTES.get(name, "")])
    return TextTable(["", *names, ""], rows, text_columns=(0, len(gaits) + 1))


def _size_and_title(name: str, units: Units) -> tuple[float, str]:
    """Unit for showing the metric `name`, as its size in SI units (0.01 for percent); and the title
    of the metric's row in a table, such as "distance (in)"."""
    title = _TITLES.get(name, name.replace("_", " "))
    if name in _SHARES:
        return 0.01, f"{title} (%)"
    size, unit = units.of("m" if name == "worst_distance" else UNITS.get(name, ""))
    return size, f"{title} ({unit})" if unit else title


def result_text(result: SimulationResult) -> str:
    """Text about a simulation: metrics, requirements that are not met, wall time."""
    scenario, metrics = result.scenario, result.metrics
    lines = [result.title, f"scenario {scenario.name}, {ground_text(scenario)}"]
    gait = {"fitness": result.fitness} | vars(metrics)
    lines.append(metrics_table([""], [gait], scenario, result.spread).text())
    if result.spread:
        lines.append(sentence(RANGES))
    if metrics.tension < 0.0:
        lines.append("A cable had to push: this gait cannot be built.")
    robot = result.robot
    still = stillness_remark(robot, vars(metrics)) if result.gait else ""
    remarks = [start_up_remark(robot) or still, sinking_remark(robot), yielding_remark(robot)]
    remarks.append(centre_remark(robot))
    if result.recorded is not None:
        remarks.append(overload_remark(robot, result.trajectory.tension.max("time").values))
    lines += [sentence(remark) for remark in remarks if remark]
    unmet = unmet_requirements(metrics, scenario.require)
    lines += [f"{text} (requirement not met)" for text in unmet]
    time, factor = _time(result.wall_time), rounded(result.duration / result.wall_time)
    lines.append(f"simulated in {time} ({factor} x real time), engine {result.engine}")
    return "\n".join(lines)


def ground_text(scenario: Scenario) -> str:
    """Terrain and friction in one line.

    For example, "incline (slope 5 deg), Coulomb friction (static 0.5, kinetic 0.5)".
    """
    friction, has_cone = scenario.friction, scenario.engine.has_cone
    return f"{scenario.terrain.text}, {(has_cone and friction.cone_text) or friction.text}"


def run_text(run: Run) -> str:
    """Text about a run, printed at its end: main results, tables of trials and metrics, and paths
    of the pages. With disturbances, simulates the best gait without them."""
    is_alone = run.scenario.disturbances and not run.best().empty
    alone = simulate(run.scenario, run.best_gait()) if is_alone else None
    texts = [TextTable(["", ""], results(run, alone), text_columns=(0, 1)).text().strip("\n")]
    if not run.best().empty:
        if len(run.statuses) > 1:
            texts.append(trials_table(run).text())
        best = run.fittest()
        spread = run.spread_of(best)
        gaits = [run.initial_best(best["trial"]), best]
        texts.append(metrics_table(["initially", "best"], gaits, run.scenario, spread).text())
        remarks = RANGES if spread else "", stillness_remark(Robot.of(run.best_scenario()), best)
        texts += [sentence(remark) for remark in remarks if remark]
    replay, report = run.directory / "replay.html", run.directory / "report.html"
    if replay.exists() and report.exists():
        texts.append(f"to watch the best gait:  {replay}\nfigures and numbers:     {report}")
    return "\n\n".join(texts)


def results(run: Run, alone: SimulationResult | None = None) -> list[tuple[str, str]]:
    """The main results of a run: names and values with units.

    Gaits are described by the main metric of the objective, such as the distance. The best gait is
    the fittest. `alone` is its simulation without the disturbances of the run, if there are some.
    """
    table, best = run.evaluations, run.best()
    failures = table["failure"].notna().sum()
    effort = [("evaluations", f"{len(table)} ({failures} failed)" if failures else f"{len(table)}")]
    if len(table):
        effort.append(("time per evaluation", _time(table["wall_time_s"].mean())))
    if best.empty:
        return effort + [("last failure", failure) for failure in table["failure"].tail(1)]
    fittest = run.fittest()
    starts = [run.initial_best(trial) for trial in best["trial"]]
    initial = max(starts, key=lambda gait: gait["fitness"])
    name = headline_metric(run.scenario.objective, fittest)
    size, unit = run.scenario.units.of(UNITS[name])

    def three(value: float) -> str:
        return f"{rounded(value / size)} {unit}".rstrip()

    least, most = (x / size for x in run.spread_of(fittest).get(name, (math.nan, math.nan)))
    shown = uncertain(rounded(fittest[name] / size), fittest[name] / size, least, most)
    title, own = name.replace("_", " "), f"{shown} {unit}".rstrip() + f", {gait_label(fittest)}"
    of_draws = [(title, f"{three(getattr(alone.metrics, name))}, undisturbed")] if alone else []
    rows = [
        *of_draws,
        (f"mean of {run.scenario.draw_count} draws" if of_draws else title, own),
        ("best initial gait", f"{three(initial[name])}, {gait_label(initial)}"),
        *_body_of_best(run),
    ]
    if len(best) > 1:
        median = three(best[name].median())
        low, high = (three(best[name].quantile(share)) for share in (0.25, 0.75))
        rows.append(("best of each trial", f"median {median}, quartiles {low} and {high}"))
    return rows + effort


def _body_of_best(run: Run) -> list[tuple[str, str]]:
    """Numbers of the body of a run's best gait with their bounds, by key; none without a body."""
    scenario, found = run.scenario, run.best_scenario().model_dump()

    def shown(number: float) -> str:
        return scenario.units.shown(number, getattr(number, "unit", ""))

    return [
        (key, f"{shown(value_at(found, separate(key)[0]))}, from {shown(low)} to {shown(high)}")
        for key, (low, high) in scenario.evolve.items()
    ]


def trials_table(run: Run) -> TextTable:
    """Table of the trials of a run: initial and final best gait, evaluations, state.

    Gaits are described by the main metric of the objective. "in Drake" is the final best gait,
    evaluated again on the Drake diagram. Columns without values are left out.
    """
    import pandas

    name = headline_metric(run.scenario.objective, run.fittest())
    size, title = _size_and_title(name, run.scenario.units)
    best = run.best().set_index("trial")
    in_drake = run.reevaluations.set_index(["trial", "index"])
    columns = ["trial", f"initial {title}", "best", "in Drake", "evaluations", "failed", "end"]
    rows = []
    for status in run.statuses:
        values = [math.nan] * 3
        if status.number in best.index:
            gait = best.loc[status.number]
            key = status.number, gait["index"]
            again = in_drake.loc[key, name] if key in in_drake.index else math.nan
            values = [run.initial_best(status.number)[name], gait[name], again]
        cells = [rounded(value / size) for value in values]
        counts = [f"{status.evaluations}", f"{status.failures or ''}"]
        end = "not finished" if status.stop is None else status.stop.replace(ALL_DONE, "")
        rows.append([f"{status.number}", *cells, *counts, end])
    table = pandas.DataFrame(rows, columns=columns)
    table = table.loc[:, ~table.isin(["-", ""]).all()]
    texts = [place for place, name in enumerate(table) if name in ("trial", "end")]
    return TextTable([*table], table.to_numpy().tolist(), text_columns=texts)


def _time(seconds: float) -> str:
    """A wall time as text, such as "35 ms" or "2.50 s"."""
    return f"{1e3 * seconds:.0f} ms" if seconds < 1.0 else f"{rounded(seconds)} s"
