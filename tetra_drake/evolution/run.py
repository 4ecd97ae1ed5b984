"""The trial loop: keeps the workers busy until every trial has ended."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor

import numpy as np

from tetra_drake.evolution.executors import EvaluationPool, process_executor
from tetra_drake.evolution.optimizers.base import Evaluate, Optimizer
from tetra_drake.evolution.optimizers.steady_state import SteadyState
from tetra_drake.evolution.progress import Progress, SilentProgress
from tetra_drake.evolution.record import RunRecord
from tetra_drake.evolution.trial import Assignment, Trial, TrialStatus
from tetra_drake.scenario.schema import Scenario

MakeOptimizer = Callable[[Scenario, np.random.Generator], Optimizer]
MakeExecutor = Callable[[int], Executor]

_PROGRESS_PERIOD = 1.0  # s


def evolve(
    record: RunRecord,
    *,
    evaluate: Evaluate,
    workers: int,
    make_executor: MakeExecutor = process_executor,
    make_optimizer: MakeOptimizer = SteadyState,
    progress: Progress | None = None,
) -> list[TrialStatus]:
    """Runs all trials of a record to their ends, from wherever they are.

    The record depends on its scenario and seed only, not on the number of workers, the
    executor, or interruptions. Trials share nothing: one more trial changes no other.
    """
    trials = _open_trials(record, make_optimizer)
    statuses = [trial.status for trial in trials]
    progress = progress or SilentProgress()
    if all(trial.finished for trial in trials):
        return statuses
    with progress:
        progress.show(statuses)
        _run(
            trials, EvaluationPool(evaluate, workers=workers, make_executor=make_executor), progress
        )
    return statuses


def _open_trials(record: RunRecord, make_optimizer: MakeOptimizer) -> list[Trial]:
    count = record.scenario.evolution.trials
    seeds = np.random.SeedSequence(record.seed).spawn(count)
    return [
        Trial(
            number=number,
            name=f"{record.scenario.name}, seed {record.seed}, trial {number}",
            optimizer=make_optimizer(record.scenario, np.random.default_rng(seeds[number])),
            record=record.open_trial(number),
        )
        for number in range(count)
    ]


def _run(trials: list[Trial], pool: EvaluationPool[Assignment], progress: Progress) -> None:
    def submit(trial: Trial) -> None:
        if not trial.finished:
            for assignment, genome in trial.unevaluated():
                pool.submit(assignment, genome)

    completed = False
    try:
        for trial in trials:
            submit(trial)
        while pool.busy:
            for assignment, evaluation in pool.wait(_PROGRESS_PERIOD):
                trial = trials[assignment.trial]
                if trial.take(assignment.index, evaluation):
                    submit(trial)
            progress.show([trial.status for trial in trials])
        completed = True
    finally:
        pool.close(at_once=not completed)
