"""A recorded run with its best gaits simulated again."""

from __future__ import annotations

from dataclasses import dataclass

import pandas
import xarray

from tetra_drake.engines.simulate import simulate
from tetra_drake.evolution.run import Run, gait_label
from tetra_drake.results.metrics import headline
from tetra_drake.robot.gait import Gait


@dataclass(frozen=True)
class GaitMotion:
    """A gait of a run and its motion, simulated again."""

    gait: Gait
    recorded: pandas.Series
    """Its row of the run's evaluations."""
    trajectory: xarray.Dataset
    title: str
    """The gait's name and what it does, simulated again."""
    distance_in: float
    """The distance simulated again: as recorded, unless that was by other versions or among
    disturbances, which are not simulated again."""

    @property
    def label(self) -> str:
        """Trial and number of the evaluation."""
        return gait_label(self.recorded)


@dataclass(frozen=True)
class Study:
    """A run with the gaits that its report shows."""

    run: Run
    trial: int
    """The best trial: the one with the fittest gait."""
    initial: GaitMotion
    """The fittest gait of the best trial's first iteration in which not all failed."""
    best: GaitMotion
    """The fittest gait of the run."""


def study_run(run: Run) -> Study:
    """Simulates the fittest gait of the best trial, initially and of all.

    Raises InputError if no gait of the run has a fitness, and SimulationFailure if other versions
    than the run's make such a gait fail.
    """
    trial, index = run.fittest()
    first = run.initial_best(trial)
    motions = {i: simulate_again(run, trial, i) for i in {first, index}}
    return Study(run=run, trial=trial, initial=motions[first], best=motions[index])


def simulate_again(run: Run, trial: int, index: int) -> GaitMotion:
    """A gait of a run, simulated again. Raises SimulationFailure."""
    gait, scenario = run.gait(trial, index), run.manifest.scenario
    result = simulate(scenario=scenario, gait=gait, record=True)
    assert result.trajectory is not None
    return GaitMotion(
        gait=gait,
        recorded=run.evaluation(trial, index),
        trajectory=result.trajectory,
        title=f"{gait.name}: {headline(scenario, vars(result.metrics))}",
        distance_in=result.metrics.distance_in,
    )
