"""Figures of a run and of one simulation. For a run, its best gaits are simulated again.

A figure has the name of the function that draws it. The function's docstring is the caption.
"""

from __future__ import annotations

import base64
import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import pandas

from tetra_drake.engines.simulate import simulate
from tetra_drake.evolution.run import Run
from tetra_drake.figures.fitness import (
    fitness_of_trials,
    initial_distances,
    initial_extremes,
    initial_fitness,
)
from tetra_drake.figures.forces import ground_forces, signals_and_tensions
from tetra_drake.figures.gait_diagram import gait_diagram
from tetra_drake.figures.motion import (
    before_and_after,
    one_step,
    path_of_the_centre,
    relative_distances,
    time_lapse,
)
from tetra_drake.figures.style import AS_USUAL, Print, save_figure
from tetra_drake.results.result import SimulationResult
from tetra_drake.study.elites import elites, map_of_gaits


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
    def change(self) -> float:
        """Difference (m) between the distances in the new simulation and in the record."""
        return abs(self.result.metrics.distance - self.recorded["distance"])


@dataclass(frozen=True)
class ShownGaits:
    """A run and the two gaits that its report shows."""

    run: Run
    best: RecordedGait
    """Fittest gait of the run."""
    initial: RecordedGait
    """Fittest initial gait of the same trial; see Run.initial_best()."""


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


class Picture(NamedTuple):
    """A figure of a report."""

    part: str
    """Part of the report that shows it: "gait", "evolution" or "forces"."""
    is_there: bool
    """False if there is nothing to draw."""
    draw: Callable[..., Any]
    """Figure function."""
    data: Sequence[Any]
    """Arguments of the figure function."""

    @property
    def name(self) -> str:
        """Name of the figure and of its files."""
        return self.draw.__name__

    @property
    def caption(self) -> str:
        """Caption of the figure, in one line."""
        return " ".join((inspect.getdoc(self.draw) or "").split())

    def image(self, folder: Path) -> str:
        """URL with the figure's content. Embedded directly, ids of two SVGs would clash."""
        content = base64.b64encode((folder / f"{self.name}.svg").read_bytes()).decode()
        return f"data:image/svg+xml;base64,{content}"


def pictures_of_gait(result: SimulationResult) -> list[Picture]:
    """The figures of one simulation."""
    structure = result.robot.structure
    return [
        Picture("gait", True, gait_diagram, [result]),
        Picture("gait", True, time_lapse, [result]),
        Picture("forces", True, path_of_the_centre, [result]),
        Picture("forces", True, relative_distances, [result]),
        Picture("forces", True, one_step, [result]),
        Picture("forces", structure.signals > 0, signals_and_tensions, [result]),
        Picture("forces", len(structure.contacts) > 0, ground_forces, [result]),
    ]


def pictures_of_run(shown: ShownGaits) -> list[Picture]:
    """The figures of a run and of its best gait."""
    run, trial = shown.run, shown.best.recorded["trial"]
    best, initial, trials = shown.best.result, shown.initial.result, initial_extremes(run).index
    return [
        Picture("evolution", True, fitness_of_trials, [run]),
        Picture("evolution", len(trials) > 0, initial_distances, [run]),
        Picture("evolution", trial in trials, initial_fitness, [run, trial]),
        Picture("evolution", len(elites(run)) > 0, map_of_gaits, [run]),
        Picture("evolution", True, before_and_after, [initial, best]),
        *pictures_of_gait(best),
    ]


def draw(pictures: Sequence[Picture], folder: Path, printed: Print = AS_USUAL) -> None:
    """Draws figures and writes them to a folder. Raises InputError if a file cannot be written."""
    for picture in pictures:
        if picture.is_there:
            figure = picture.draw(*picture.data, **vars(printed.look))
            save_figure(figure, folder, picture.name, kinds=printed.kinds)
