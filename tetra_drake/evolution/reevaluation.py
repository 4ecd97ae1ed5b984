"""Reevaluation: the best gaits of a run, evaluated again on the Drake diagram.

trial_00/reevaluations.jsonl    lines as in evaluations.jsonl; `engine` is the Drake diagram
"""

from __future__ import annotations

from pathlib import Path

from tetra_drake.evolution.entries import REEVALUATIONS, EvaluationLine
from tetra_drake.evolution.evaluation import GaitEvaluation, Objective
from tetra_drake.evolution.evaluators import MakeExecutor, evaluate_all, evaluator_of
from tetra_drake.evolution.manifest import Method
from tetra_drake.evolution.progress import Progress
from tetra_drake.evolution.run import Run, load_run

BEST_GAITS = 5
"""Number of gaits per trial to evaluate again. With disturbances it is divided by the number of
draws, so that the number of simulations is about the same; at least one."""

_TITLE = "checking the best gaits in Drake"


def reevaluate(
    directory: str | Path,
    objective: Objective | None = None,
    *,
    workers: int | None = None,
    executor: MakeExecutor | None = None,
    progress: Progress | None = None,
) -> Run:
    """Simulates the best gaits of a run again, on the Drake diagram instead of the run's engine,
    and adds these evaluations to its record.

    Gaits that were reevaluated before are skipped. Returns the run with the new evaluations.

    Args:
        directory: the directory of the run.
        objective: the objective of the run; None if it is the fitness of the scenario.
        workers: number of worker processes; one per core by default.
        executor: function that makes an executor to use in place of worker processes.
        progress: display that gets progress and warnings.

    Raises:
        InputError: if the run has another objective.
    """
    run = load_run(directory)
    manifest, scenario = run.manifest, run.scenario
    given = Method.of(scenario, objective=objective).objective
    manifest.check_made_with(run.directory, objective=given)
    files = [run.file(REEVALUATIONS, trial) for trial in range(scenario.evolution.trials)]
    for file in files:
        file.repair()
    known = set(zip(run.reevaluations["trial"], run.reevaluations["index"], strict=True))
    best = run.best(max(1, BEST_GAITS // scenario.draw_count))
    rows = best[["trial", "index", "iteration"]].itertuples(index=False, name=None)
    missing = [row for row in rows if row[:2] not in known]
    if not missing:
        return run
    tasks = []
    for trial, index, iteration in missing:
        vector = run.vector(trial, index)
        tasks.append(manifest.task(vector, trial=trial, index=index, iteration=iteration))
    evaluate = GaitEvaluation(scenario.on_engine("drake"), objective)
    progress = progress or Progress()
    progress.stage(_TITLE, 0, len(missing))
    chosen = evaluator_of(evaluate, workers=workers, executor=executor, warn=progress.warn)
    with chosen as submit:
        for done, (task, evaluation) in enumerate(evaluate_all(submit, tasks), start=1):
            files[task.trial].append([EvaluationLine.of(task, evaluation)])
            progress.stage(_TITLE, done, len(missing))
    return load_run(run.directory)
