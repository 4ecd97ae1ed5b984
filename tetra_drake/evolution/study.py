"""A recorded run made ready to be shown: where it stands, and its best gaits walking again."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from tetra_drake.engines.simulate import simulate
from tetra_drake.evolution.tables import Run, load_run
from tetra_drake.evolution.trial import TrialStatus
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.gait import Gait

if TYPE_CHECKING:
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

    run: Run
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
    trial, index = run.fittest()
    rows = run.evaluations[run.evaluations["trial"] == trial].dropna(subset="fitness")
    first = rows[rows["iteration"] == rows["iteration"].min()]
    initial_index = int(first.loc[first["fitness"].idxmax(), "index"])
    best = _walk(run, trial, index)
    initial = best if initial_index == index else _walk(run, trial, initial_index)
    return Study(run=run, statuses=run.statuses, initial=initial, best=best)


def _walk(run: Run, trial: int, index: int) -> Walk:
    rows = run.evaluations.set_index(["trial", "index"])
    gait = run.gait(trial, index)
    return Walk(
        trial=trial,
        evaluation=index,
        gait=gait,
        recorded_distance_in=float(rows.loc[(trial, index), "distance_in"]),
        result=simulate(scenario=run.manifest.scenario, gait=gait, record=True),
    )
