"""A recorded run made ready to be shown: where it stands, and its best gaits walking again."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tetra_drake.engines.simulate import simulate
from tetra_drake.errors import InputError
from tetra_drake.evolution.genome import gait_of
from tetra_drake.evolution.population import genome_columns
from tetra_drake.evolution.summary import recorded_statuses
from tetra_drake.evolution.tables import RunTables, load_run
from tetra_drake.evolution.trial import TrialStatus
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.gait import Gait

if TYPE_CHECKING:
    import pandas
    import xarray


@dataclass(frozen=True)
class Walk:
    """A gait of a run, simulated again and recorded."""

    trial: int
    evaluation: int
    """Its index in the trial."""
    gait: Gait
    recorded_distance_in: float
    """What the run's record says."""
    result: SimulationResult

    @property
    def label(self) -> str:
        """Which gait of the run it is."""
        return f"trial {self.trial}, evaluation {self.evaluation}"

    @property
    def trajectory(self) -> xarray.Dataset:
        """See trajectory.make_dataset."""
        assert self.result.trajectory is not None
        return self.result.trajectory

    @property
    def deviation_in(self) -> float:
        """How far from the run's its end is: 0, but for other versions than the run's."""
        return abs(self.result.metrics.distance_in - self.recorded_distance_in)


@dataclass(frozen=True)
class Study:
    """What there is to show of a run. The best trial is the one with the fittest gait."""

    run: RunTables
    statuses: list[TrialStatus]
    initial: Walk
    """The fittest gait of the best trial's initial population (should that have failed as a
    whole, of the first iteration that has not)."""
    best: Walk
    """The fittest gait of the best trial, and so of the run."""


def study_run(directory: Path) -> Study:
    """Reads a run, finished or not, and simulates the best trial's first and last best gait.

    Raises InputError if `directory` holds no run, if the record is damaged, or if no gait of
    it has a fitness yet; SimulationFailure if other versions make such a gait fail.
    """
    run = load_run(directory)
    statuses = recorded_statuses(run)
    best_trial = max(statuses, key=lambda status: status.best_fitness)
    if not math.isfinite(best_trial.best_fitness):
        raise InputError(directory, "", "no gait of this run has a fitness yet, nothing to show")
    evaluations = run.evaluations[run.evaluations["trial"] == best_trial.number]
    evaluations = evaluations.dropna(subset="fitness")
    best = _walk(run, _fittest(evaluations))
    initial_row = _fittest(evaluations[evaluations["iteration"] == evaluations["iteration"].min()])
    initial = best if initial_row["index"] == best.evaluation else _walk(run, initial_row)
    return Study(run=run, statuses=statuses, initial=initial, best=best)


def _fittest(evaluations: pandas.DataFrame) -> pandas.Series:
    """The row of the highest fitness, the first of equals."""
    return evaluations.loc[evaluations["fitness"].idxmax()]


def _walk(run: RunTables, row: pandas.Series) -> Walk:
    scenario, trial, evaluation = run.manifest.scenario, int(row["trial"]), int(row["index"])
    name = f"{scenario.name}, seed {run.manifest.seed}, trial {trial}, evaluation {evaluation}"
    genome = row[genome_columns(run.evaluations)].to_numpy(dtype=np.float64)
    gait = gait_of(genome, name=name)
    return Walk(
        trial=trial,
        evaluation=evaluation,
        gait=gait,
        recorded_distance_in=float(row["distance_in"]),
        result=simulate(scenario=scenario, gait=gait, record=True),
    )
