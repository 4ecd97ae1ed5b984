"""Gaits of a run evaluated once more, on the Drake diagram.

trial_00/reevaluations.jsonl    lines as in evaluations.jsonl, with the engine that made them
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tetra_drake.evolution.evaluation import GaitEvaluation
from tetra_drake.evolution.executors import EvaluationPool, process_executor
from tetra_drake.evolution.json_lines import append_lines, read_lines, repair_torn_line
from tetra_drake.evolution.optimizers.base import Evaluate
from tetra_drake.evolution.population import genome_columns
from tetra_drake.evolution.record import REEVALUATIONS, evaluation_entry, trial_folder
from tetra_drake.evolution.tables import RunTables, load_run
from tetra_drake.evolution.trial import Assignment

if TYPE_CHECKING:
    import pandas

BEST_GAITS = 5
"""How many gaits of a trial are worth a second evaluation."""


def best_gaits(run: RunTables, count: int = BEST_GAITS) -> list[Assignment]:
    """The fittest gaits of each trial, no genome twice, best first."""
    columns = genome_columns(run.evaluations)
    ranked = run.evaluations.dropna(subset="fitness").sort_values(
        ["trial", "fitness", "index"], ascending=[True, False, True]
    )
    best = ranked.drop_duplicates(["trial", *columns]).groupby("trial").head(count)
    return _assignments(best)


def initial_gaits(run: RunTables) -> list[Assignment]:
    """The initial population of each trial."""
    return _assignments(run.evaluations[run.evaluations["iteration"] == 0])


def reevaluate(
    directory: Path,
    choose: Callable[[RunTables], Iterable[Assignment]],
    *,
    workers: int,
    evaluate: Evaluate | None = None,
    make_executor: Callable[[int], Executor] = process_executor,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> None:
    """Evaluates the chosen gaits of a run on the Drake diagram and adds them to its record.

    What is in the record already is not done again. `progress` is told how many of how many
    are done.
    """
    run = load_run(directory)
    chosen = list(choose(run))
    done = {
        Assignment(trial, entry["index"])
        for trial in range(run.manifest.scenario.evolution.trials)
        for entry in _recorded(directory, trial)
    }
    missing = [assignment for assignment in chosen if assignment not in done]
    rows = run.evaluations.set_index(["trial", "index"])
    columns = genome_columns(run.evaluations)
    evaluate = evaluate or GaitEvaluation(
        run.manifest.scenario.with_changes({"simulation.engine": "drake"})
    )
    pool = EvaluationPool[Assignment](evaluate, workers=workers, make_executor=make_executor)
    genomes = {
        each: rows.loc[(each.trial, each.index), columns].to_numpy(dtype=np.float64)
        for each in missing
    }
    completed = False
    try:
        for assignment in missing:
            pool.submit(assignment, genomes[assignment])
        finished = 0
        while pool.busy:
            for assignment, evaluation in pool.wait():
                iteration = int(rows.loc[(assignment.trial, assignment.index), "iteration"])
                genome = genomes[assignment]
                entry = evaluation_entry(assignment.index, iteration, genome, evaluation)
                append_lines(trial_folder(directory, assignment.trial) / REEVALUATIONS, [entry])
                finished += 1
                progress(finished, len(missing))
        completed = True
    finally:
        pool.close(at_once=not completed)


def best_distances(run: RunTables) -> list[tuple[int, float, float]]:
    """For each trial, the distances (in) of its fittest gait: recorded, and on the diagram;
    NaN for what there is not."""
    recorded = run.evaluations.set_index(["trial", "index"])["distance_in"]
    again: dict[tuple[int, int], float] = {}
    if not run.reevaluations.empty:
        again = run.reevaluations.set_index(["trial", "index"])["distance_in"].to_dict()
    distances = []
    for best in best_gaits(run, count=1):
        key = (best.trial, best.index)
        distances.append((best.trial, float(recorded[key]), again.get(key, math.nan)))
    return distances


def _recorded(directory: Path, trial: int) -> list[dict[str, Any]]:
    path = trial_folder(directory, trial) / REEVALUATIONS
    repair_torn_line(path)
    return read_lines(path)


def _assignments(rows: pandas.DataFrame) -> list[Assignment]:
    return [
        Assignment(int(trial), int(index))
        for trial, index in zip(rows["trial"], rows["index"], strict=True)
    ]
