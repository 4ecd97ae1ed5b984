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
    trials = _open_trials(record, optimizer)
    statuses = [trial.status for trial in trials]
    progress = progress or Progress()
    progress.show(statuses)
    if all(trial.finished for trial in trials):
        return statuses
    with EvaluationPool[tuple[int, int]](evaluate, workers=workers, executor=executor) as pool:

        def submit(trial: Trial) -> None:
            if not trial.finished:
                for index, vector in trial.unevaluated().items():
                    pool.submit((trial.status.number, index), vector)

        for trial in trials:
            submit(trial)
        while pool.busy:
            for (number, index), evaluation in pool.wait(_PROGRESS_PERIOD):
                if trials[number].take(index, evaluation):
                    submit(trials[number])
            progress.show(statuses)
    return statuses


def _open_trials(record: RunRecord, optimizer: MakeOptimizer) -> list[Trial]:
    scenario, seed = record.manifest.scenario, record.manifest.seed
    space = ParameterSpace.of(scenario)
    seeds = np.random.SeedSequence(seed).spawn(scenario.evolution.trials)
    return [
        Trial(
            number,
            f"{scenario.name}, seed {seed}, trial {number}",
            space=space,
            optimizer=optimizer(space, scenario.evolution, np.random.default_rng(own_seed)),
            folder=trial_folder(record.directory, number),
        )
        for number, own_seed in enumerate(seeds)
    ]
