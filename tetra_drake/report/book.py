"""The figures of one simulation and of a run.

A figure's files are named after the function that draws it, whose docstring is its caption.
"""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

import xarray

from tetra_drake.analysis.elites import elites
from tetra_drake.figures import fitness, forces, motion
from tetra_drake.figures.map import map_of_gaits
from tetra_drake.figures.style import save_figure
from tetra_drake.report.study import Study
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.schema import Scenario


def draw_trajectory(trajectory: xarray.Dataset, scenario: Scenario, folder: Path) -> dict[str, str]:
    """Writes the figures of one simulation; returns their captions by name of file, no suffix.

    Raises InputError if the folder cannot be written to.
    """
    ground = Robot.of(scenario).ground
    return _save(
        folder,
        (motion.time_lapse, trajectory),
        (motion.path_of_the_centre, trajectory),
        (motion.relative_distances, trajectory),
        (motion.one_step, trajectory, ground),
        (forces.signals_and_tensions, trajectory),
        (forces.ground_forces, trajectory, ground),
    )


def draw_run(study: Study, folder: Path) -> dict[str, str]:
    """Writes the figures of a run and of its best gait; returns captions as draw_trajectory()."""
    run, initial, best = study.run, study.initial, study.best
    pictures: list[tuple[Any, ...]] = [(fitness.fitness_of_trials, run)]
    trials = fitness.initial_extremes(run).index
    if len(trials):
        pictures.append((fitness.initial_distances, run))
    if study.trial in trials:
        pictures.append((fitness.initial_fitness, run, study.trial))
    if len(elites(run)):
        pictures.append((map_of_gaits, run))
    walks = [(gait.label, gait.motion.trajectory) for gait in (initial, best)]
    pictures.append((motion.before_and_after, walks))
    trajectory_figures = draw_trajectory(best.motion.trajectory, run.manifest.scenario, folder)
    return _save(folder, *pictures) | trajectory_figures


def _save(folder: Path, *pictures: tuple[Any, ...]) -> dict[str, str]:
    """Saves figures, each given as the function that draws it and its arguments."""
    captions = {}
    for draw, *data in pictures:
        save_figure(draw(*data), folder, draw.__name__)
        captions[draw.__name__] = " ".join((inspect.getdoc(draw) or "").split())
    return captions
