"""Gaits of a run evaluated once more, on the Drake diagram.

trial_00/reevaluations.jsonl    lines as in evaluations.jsonl, with the engine that made them
"""

from __future__ import annotations

import math
from pathlib import Path

from tetra_drake.errors import InputError
from tetra_drake.evolution.entries import REEVALUATIONS, evaluation_entry, trial_folder
from tetra_drake.evolution.evaluation import GaitEvaluation
from tetra_drake.evolution.executors import MakeExecutor, evaluate_all, process_executor
from tetra_drake.evolution.json_lines import append_lines, repair_torn_line
from tetra_drake.evolution.manifest import FITNESS
from tetra_drake.evolution.progress import Progress
from tetra_drake.evolution.run import Run, load_run
from tetra_drake.optimizers.base import Evaluate
from tetra_drake.scenario.schema import Scenario

BEST_GAITS = 5
"""Number of best gaits per trial that are evaluated once more; among disturbances fewer, but one,
so that there are about as many simulations."""

_TITLE = "best gaits on the Drake diagram"


def on_diagram(scenario: Scenario) -> Scenario:
    """The scenario with the Drake diagram as its engine."""
    return scenario.with_changes({"engine": "!Drake"})


def reevaluate(
    directory: str | Path,
    evaluate: Evaluate | None = None,
    *,
    workers: int | None = None,
    executor: MakeExecutor = process_executor,
    progress: Progress | None = None,
) -> Run:
    """Evaluates a run's best gaits once more, adds them to its record and returns it. Gaits that
    have been evaluated so already are skipped.

    evaluate: by default the fitness of the run's scenario, on the Drake diagram.

    Raises InputError if `evaluate` is needed, as the run has an objective of its own.
    """
    run = load_run(directory)
    scenario, objective = run.manifest.scenario, run.manifest.method.objective
    if evaluate is None:
        if objective != FITNESS:
            raise InputError(run.directory, "evaluate", f"is needed: the objective is {objective}")
        evaluate = GaitEvaluation(on_diagram(scenario))
    for trial in range(scenario.evolution.trials):
        repair_torn_line(trial_folder(run.directory, trial) / REEVALUATIONS)
    done = set(zip(run.reevaluations["trial"], run.reevaluations["index"], strict=True))
    best = run.best(max(1, BEST_GAITS // scenario.draws))
    rows = best[["trial", "index", "iteration"]].itertuples(index=False, name=None)
    missing = [row for row in rows if row[:2] not in done]
    if not missing:
        return run
    vectors = [run.vector(trial, index) for trial, index, _ in missing]
    tasks = [
        run.manifest.task(vector, trial=trial, iteration=iteration)
        for vector, (trial, _, iteration) in zip(vectors, missing, strict=True)
    ]
    progress = progress or Progress()
    progress.stage(_TITLE, 0, len(missing))
    results = evaluate_all(evaluate, tasks, workers=workers, executor=executor)
    for finished, (i, evaluation) in enumerate(results, start=1):
        trial, index, iteration = missing[i]
        entry = evaluation_entry(index, iteration, vectors[i], evaluation)
        append_lines(trial_folder(run.directory, trial) / REEVALUATIONS, [entry])
        progress.stage(_TITLE, finished, len(missing))
    return load_run(run.directory)


def best_distances(run: Run) -> list[tuple[int, float, float]]:
    """Distances (in) of the fittest gait of each trial: recorded, and on the diagram; NaN
    where there is none."""
    key = ["trial", "index"]
    again = run.reevaluations.set_index(key)["distance_in"].to_dict()
    best = run.best()[[*key, "distance_in"]].itertuples(index=False, name=None)
    return [(int(t), float(ours), again.get((t, i), math.nan)) for t, i, ours in best]
