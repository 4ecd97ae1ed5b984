"""A run's record as tables: `load_run`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tetra_drake.evolution.json_lines import read_lines
from tetra_drake.evolution.record import (
    EVALUATIONS,
    ITERATIONS,
    REEVALUATIONS,
    Manifest,
    check_evaluation,
    check_iteration,
    read_manifest,
    trial_folder,
)

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True)
class RunTables:
    """A run as tables; lengths in inches, times in s."""

    manifest: Manifest
    """Scenario, seed and versions."""
    evaluations: pandas.DataFrame
    """A row an evaluation: trial, index, iteration, fitness (NaN where it failed), failure,
    wall_time_s, engine, placed (index in the population; missing if dropped), a column for each
    metric (distance_in ...), weight_1 ... in the listing's order, tau_a_s, tau_b_s."""
    iterations: pandas.DataFrame
    """A row an iteration, 0 being the initial population: trial, iteration, evaluations so
    far, mean_fitness, best_fitness, best_distance_in, best_evaluation (its index), stop."""
    reevaluations: pandas.DataFrame
    """Gaits evaluated once more on the Drake diagram: columns as in evaluations, without
    `placed`; empty if there are none."""


def load_run(path: str | Path) -> RunTables:
    """Loads a run directory, finished or not, as pandas tables.

        run = load_run("runs/demo")
        run.iterations.pivot(index="iteration", columns="trial", values="mean_fitness").plot()

    Raises InputError if `path` holds no run or the record is damaged.
    """
    directory = Path(path)
    manifest = read_manifest(directory)
    trials = range(manifest.scenario.evolution.trials)
    return RunTables(
        manifest=manifest,
        evaluations=_frame(directory, EVALUATIONS, trials, check_evaluation, _flatten),
        iterations=_frame(directory, ITERATIONS, trials, check_iteration, dict),
        reevaluations=_frame(directory, REEVALUATIONS, trials, check_evaluation, _flatten),
    )


def _frame(
    directory: Path,
    name: str,
    trials: range,
    check: Callable[[dict[str, Any], Path, int], None],
    row: Callable[[dict[str, Any]], dict[str, Any]],
) -> pandas.DataFrame:
    import pandas

    rows = []
    for trial in trials:
        path = trial_folder(directory, trial) / name
        for line, entry in enumerate(read_lines(path), start=1):
            check(entry, path, line)
            rows.append({"trial": trial, **row(entry)})
    table = pandas.DataFrame(rows)
    whole = [column for column in ("placed", "best_evaluation") if column in table]
    numbers = [column for column in table if column.endswith(("fitness", "_in"))]
    return table.astype({column: "Int64" for column in whole} | dict.fromkeys(numbers, float))


def _flatten(entry: dict[str, Any]) -> dict[str, Any]:
    *weights, tau_a, tau_b = entry["genome"]
    plain = {key: value for key, value in entry.items() if key not in ("genome", "metrics")}
    numbered = {f"weight_{i}": weight for i, weight in enumerate(weights, start=1)}
    return plain | entry["metrics"] | numbered | {"tau_a_s": tau_a, "tau_b_s": tau_b}
