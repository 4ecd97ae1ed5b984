"""Figures of a run and of one simulation. For a run, its best gaits are simulated again.

A figure has the name of the function that draws it. The function's docstring is the caption.
"""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import pandas

from tetra_drake.analysis.elites import elites
from tetra_drake.engines.simulate import simulate
from tetra_drake.evolution.run import Run, gait_label
from tetra_drake.figures import fitness, forces, motion
from tetra_drake.figures.gait_diagram import gait_diagram
from tetra_drake.figures.gait_map import map_of_gaits
from tetra_drake.figures.style import AS_USUAL, Print, save_figure
from tetra_drake.results.result import SimulationResult


@dataclass(frozen=True)
class RecordedGait:
    """A gait of a run: its record, and a new simulation.

    The numbers may differ if other versions recorded the gait. They differ for a run with
    disturbances, because the new simulation has none.
    """

    recorded: pandas.Series
    """Row of the run's evaluations."""
    result: SimulationResult
    """Result of the new simulation, with trajectory."""

    @property
    def label(self) -> str:
        """Trial and evaluation of the gait, as text."""
        return gait_label(self.recorded)

    @property
    def distance(self) -> float:
        """Distance (m) in the new simulation."""
        return self.result.metrics.distance


@dataclass(frozen=True)
class ShownGaits:
    """A run and the two gaits that its report shows."""

    run: Run
    best: RecordedGait
    """Fittest gait of the run."""
    initial: RecordedGait
    """Fittest initial gait of the same trial; see Run.initial_best()."""

    @property
    def trial(self) -> int:
        """Trial with the fittest gait."""
        return int(self.best.recorded["trial"])


def simulate_shown_gaits(run: Run) -> ShownGaits:
    """Simulates the fittest gait of a run and the fittest initial gait of the same trial.

    Raises InputError if no gait of the run has a fitness. Raises SimulationFailure if a simulation
    fails; this can happen with versions other than the run's.
    """
    fittest = run.fittest()
    first = run.initial_best(fittest["trial"])
    best = simulate_again(run, fittest)
    initial = best if first["index"] == fittest["index"] else simulate_again(run, first)
    return ShownGaits(run, best=best, initial=initial)


def simulate_again(run: Run, recorded: pandas.Series) -> RecordedGait:
    """Simulates a gait of a run (a row of `Run.evaluations`) again. May raise SimulationFailure."""
    gait = run.gait(recorded["trial"], recorded["index"])
    return RecordedGait(recorded, simulate(run.scenario, gait, record=True))


class DrawnFigure(NamedTuple):
    """A figure that was written to a folder."""

    part: str
    """Part of the report that shows it: "gait", "evolution" or "forces"."""
    name: str
    caption: str


def draw_trajectory(
    result: SimulationResult, folder: Path, printed: Print = AS_USUAL
) -> list[DrawnFigure]:
    """Writes the figures of one simulation. Raises InputError if a file cannot be written."""
    of_gait = [(gait_diagram, result), (motion.time_lapse, result)]
    of_forces = [
        (motion.path_of_the_centre, result),
        (motion.relative_distances, result),
        (motion.one_step, result),
    ]
    if result.robot.structure.signals:
        of_forces.append((forces.signals_and_tensions, result))
    if len(result.robot.structure.contacts):
        of_forces.append((forces.ground_forces, result))
    drawn = _save(folder, "gait", of_gait, printed)
    return drawn + _save(folder, "forces", of_forces, printed)


def draw_run(shown: ShownGaits, folder: Path, printed: Print = AS_USUAL) -> list[DrawnFigure]:
    """Writes the figures of a run and of its best gait."""
    run = shown.run
    pictures: list[tuple[Any, ...]] = [(fitness.fitness_of_trials, run)]
    trials = fitness.initial_extremes(run).index
    if len(trials):
        pictures.append((fitness.initial_distances, run))
    if shown.trial in trials:
        pictures.append((fitness.initial_fitness, run, shown.trial))
    if len(elites(run)):
        pictures.append((map_of_gaits, run))
    pictures.append((motion.before_and_after, shown.initial.result, shown.best.result))
    of_run = _save(folder, "evolution", pictures, printed)
    return of_run + draw_trajectory(shown.best.result, folder, printed)


def _save(
    folder: Path, part: str, pictures: Sequence[tuple[Any, ...]], printed: Print
) -> list[DrawnFigure]:
    """Draws and saves the figures of a part. A picture is a figure function and its arguments."""
    drawn = []
    for draw, *data in pictures:
        figure = draw(*data, **vars(printed.look))
        save_figure(figure, folder, draw.__name__, kinds=printed.kinds)
        caption = " ".join((inspect.getdoc(draw) or "").split())
        drawn.append(DrawnFigure(part, draw.__name__, caption))
    return drawn
