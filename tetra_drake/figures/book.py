"""The figures of one simulation and of a run.

A figure's files are named after the function that draws it, whose docstring is its caption.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure

from tetra_drake.figures import engines, evolution, forces, motion
from tetra_drake.figures.style import save_figure
from tetra_drake.files import write_whole

if TYPE_CHECKING:
    import xarray

    from tetra_drake.evolution.tables import Run
    from tetra_drake.figures.study import Study

TWO_BEST = "two_best.csv"


@dataclass(frozen=True)
class Picture:
    """The name of a written figure's files, without suffix, and its caption."""

    name: str
    caption: str


def draw_trajectory(trajectory: xarray.Dataset, folder: Path) -> list[Picture]:
    """Writes the figures of one simulation; InputError if the folder cannot be written to."""
    draws = (
        motion.time_lapse,
        motion.relative_distances,
        motion.one_step,
        forces.signals_and_tensions,
        forces.ground_forces,
    )
    return [_save(folder, draw, trajectory) for draw in draws]


def draw_run(study: Study, folder: Path) -> list[Picture]:
    """Writes the figures of a run, and the table of its two best gaits as CSV.

    Raises InputError if the folder cannot be written to.
    """
    run, initial, best = study.run, study.initial, study.best
    reference = run.manifest.scenario.reference
    table = evolution.two_best(run, study.trial, reference)
    if table is not None:
        write_whole(folder / TWO_BEST, table.to_csv())
    pictures = [_save(folder, *picture) for picture in _of_evolution(run, study.trial)]
    labels = initial.label, best.label
    walks = (motion.before_and_after, initial.trajectory, best.trajectory, labels, reference)
    return [*pictures, _save(folder, *walks), *draw_trajectory(best.trajectory, folder)]


def _of_evolution(run: Run, trial: int) -> Iterator[tuple[Any, ...]]:
    """Functions that draw figures of the record, and their arguments."""
    reference = run.manifest.scenario.reference
    yield evolution.fitness_of_trials, run
    extremes = evolution.initial_extremes(run)
    if len(extremes):
        yield evolution.initial_distances, run, reference
    if trial in extremes.index:
        yield evolution.initial_fitness, run, trial, reference
    both = engines.distances_on_both(run).query("iteration == 0").dropna()
    if len(both):
        yield engines.both_engines, both


def _save(folder: Path, draw: Callable[..., Figure], *data: Any) -> Picture:
    save_figure(draw(*data), folder, draw.__name__)
    return Picture(draw.__name__, " ".join((inspect.getdoc(draw) or "").split()))
