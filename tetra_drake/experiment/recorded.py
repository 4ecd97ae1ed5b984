"""The runs of the experiment as they are recorded, with their analyses."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from tetra_drake.errors import InputError
from tetra_drake.evolution.record import MANIFEST
from tetra_drake.evolution.summary import recorded_statuses
from tetra_drake.evolution.tables import RunTables, load_run
from tetra_drake.evolution.trial import TrialStatus
from tetra_drake.experiment.analysis import ANALYSIS, Analysis, best_of_trials, load_analysis
from tetra_drake.scenario.schema import Scenario

if TYPE_CHECKING:
    import pandas

INTENDED, LISTING, DIAGRAM = "thesis", "thesis-listing", "thesis-drake"
RUNS = (INTENDED, LISTING, DIAGRAM)
"""The directories of the experiment's runs: tau_A mutated as intended, as by the listing, and
evolved on the Drake diagram."""


@dataclass(frozen=True)
class RecordedRun:
    """A run, finished or not, with what was simulated of it afterwards."""

    name: str
    """That of its directory."""
    tables: RunTables
    statuses: list[TrialStatus]
    """Of the trials that have a gait with a fitness."""
    best: pandas.DataFrame
    """Rows of `tables.evaluations`: the fittest gait of each trial. Index: trial."""
    analysis: Analysis

    @property
    def scenario(self) -> Scenario:
        """What the run was made on."""
        return self.tables.manifest.scenario

    @property
    def best_trial(self) -> TrialStatus:
        """The trial with the fittest gait."""
        return max(self.statuses, key=lambda status: status.best_fitness)

    @property
    def initial(self) -> pandas.DataFrame:
        """The evaluations of the initial populations that have not failed."""
        evaluations = self.tables.evaluations
        return evaluations[evaluations["iteration"] == 0].dropna(subset="fitness")


Experiment = dict[str, RecordedRun]
"""Runs by their names, in the order of RUNS."""


def load_experiment(directory: Path) -> Experiment:
    """Reads those of RUNS that are in `directory`.

    Raises InputError if there is none, or if a run or its analysis is missing, damaged or
    older than the run's best gaits.
    """
    present = [name for name in RUNS if (directory / name / MANIFEST).exists()]
    if not present:
        expected = ", ".join(RUNS)
        raise InputError(directory, "", f"holds no run of the experiment, expected {expected}")
    return {name: load_recorded(directory / name) for name in present}


def load_recorded(directory: Path) -> RecordedRun:
    """Reads a run with its analysis; see load_experiment for errors."""
    tables, analysis = load_run(directory), load_analysis(directory)
    best = best_of_trials(tables)
    analysed = dict(
        zip(analysis.best_gaits["trial"], analysis.best_gaits["evaluation"], strict=True)
    )
    if analysed != {gait.trial: gait.evaluation for gait in best}:
        problem = (
            f"is not of this run's best gaits; `tetra-drake analyse {directory}` makes it anew"
        )
        raise InputError(directory / ANALYSIS, "best_gaits", problem)
    rows = tables.evaluations.set_index(["trial", "index"], drop=False)
    return RecordedRun(
        name=directory.name,
        tables=tables,
        statuses=[s for s in recorded_statuses(tables) if math.isfinite(s.best_fitness)],
        best=rows.loc[[(gait.trial, gait.evaluation) for gait in best]].set_index("trial"),
        analysis=analysis,
    )
