"""The loop over all trials of a run: keeps the workers busy until every trial has ended."""

from __future__ import annotations

import numpy as np

from tetra_drake.evolution.executors import EvaluationPool, MakeExecutor, process_executor
from tetra_drake.evolution.optimizers.base import Evaluate, MakeOptimizer
from tetra_drake.evolution.optimizers.steady_state import SteadyState
from tetra_drake.evolution.progress import Progress
from tetra_drake.evolution.record import RunRecord, trial_folder
from tetra_drake.evolution.trial import Trial, TrialStatus
from tetra_drake.robot.gait import ParameterSpace

_PROGRESS_PERIOD = 1.0  # s


def run_trials(
    record: RunRecord,
    *,
    evaluate: Evaluate,
    workers: int,
    executor: MakeExecutor = process_executor,
    optimizer: MakeOptimizer = SteadyState,
    progress: Progress | None = None,
) -> list[TrialStatus]:
    """Runs all trials of a record to their ends, from wherever they are.

    The record depends on its scenario, method and seed only, not on the number of workers, the
    executor, or interruptions. Trials share nothing: one more trial changes no other.
    """
    scenario, seed = record.manifest.scenario, record.manifest.seed
    space, progress = ParameterSpace.of(scenario), progress or Progress()
    trials = [
        Trial(
            number,
            f"{scenario.name}, seed {seed}, trial {number}",
            space=space,
            optimizer=optimizer(space, scenario.evolution, np.random.default_rng(own_seed)),
            folder=trial_folder(record.directory, number),
        )
        for number, own_seed in enumerate(
            np.random.SeedSequence(seed).spawn(scenario.evolution.trials)
        )
    ]
    statuses = [trial.status for trial in trials]
    progress.show(statuses)
    waiting = [trial for trial in trials if trial.unevaluated]
    if not waiting:
        return statuses
    with EvaluationPool[tuple[Trial, int]](evaluate, workers=workers, executor=executor) as pool:
        while waiting or pool.busy:
            for trial in waiting:
                for index, vector in trial.unevaluated.items():
                    pool.submit((trial, index), vector)
            done = pool.wait(_PROGRESS_PERIOD)
            waiting = [trial for (trial, index), found in done if trial.take(index, found)]
            progress.show(statuses)
    return statuses
