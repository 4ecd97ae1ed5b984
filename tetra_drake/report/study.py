"""A recorded run with its best gaits simulated again."""

from __future__ import annotations

from dataclasses import dataclass

import pandas

from tetra_drake.evolution.run import Run, gait_label
from tetra_drake.report.result_folder import GaitMotion, simulate_gait
from tetra_drake.scenario.units import INCH


@dataclass(frozen=True)
class RecordedGait:
    """A gait of a run, as recorded and simulated again.

    The two differ where other versions recorded it, or among disturbances, which are not simulated
    again.
    """

    recorded: pandas.Series
    """Row of the run's evaluations."""
    motion: GaitMotion

    @property
    def label(self) -> str:
        """Trial and number of the evaluation."""
        return gait_label(self.recorded)

    @property
    def distance_in(self) -> float:
        """Distance (in) as simulated again."""
        return self.motion.metrics["distance"] / INCH


@dataclass(frozen=True)
class Study:
    """A run with the gaits that its report shows."""

    run: Run
    trial: int
    """Trial with the fittest gait."""
    initial: RecordedGait
    """Fittest gait of this trial's first iteration in which not all failed."""
    best: RecordedGait
    """Fittest gait of the run."""


def study_run(run: Run) -> Study:
    """Simulates the fittest gait of the best trial, initially and of all.

    Raises InputError if no gait of the run has a fitness, and SimulationFailure if other versions
    than the run's make such a gait fail.
    """
    trial, best = run.fittest()
    first = run.initial_best(trial)
    gaits = {index: simulate_again(run, trial, index) for index in {first, best}}
    return Study(run=run, trial=trial, initial=gaits[first], best=gaits[best])


def simulate_again(run: Run, trial: int, index: int) -> RecordedGait:
    """A gait of a run, simulated again. Raises SimulationFailure."""
    motion = simulate_gait(run.manifest.scenario, run.gait(trial, index))
    return RecordedGait(run.evaluation(trial, index), motion)
