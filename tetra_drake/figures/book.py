"""All figures of a run or of one simulation, with what there is to say below each."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure

from tetra_drake import thesis
from tetra_drake.figures.evolution import (
    figure_16_initial_distances,
    figure_17_initial_fitness,
    figure_22_mean_fitness,
    figure_23_best_worst_average,
    initial_extremes,
    table_8_two_best,
)
from tetra_drake.figures.forces import figure_19_signal_and_tension, figure_20_ground_forces
from tetra_drake.figures.motion import (
    figure_14_relative_distances,
    figure_15_time_lapse,
    figure_18_before_and_after,
    figure_21_one_step,
)
from tetra_drake.figures.style import save_figure
from tetra_drake.files import write_whole

if TYPE_CHECKING:
    import xarray

    from tetra_drake.evolution.study import Study
    from tetra_drake.results.folder import Recording

TABLE_8 = "table_08_two_best.csv"


@dataclass(frozen=True)
class Picture:
    """A figure and what to say of it."""

    number: int
    """That of its counterpart in the thesis."""
    name: str
    """Of its files, without suffix."""
    caption: str
    thesis: str
    """What the thesis says or shows there."""
    figure: Figure


def draw_run(study: Study, folder: Path) -> list[Picture]:
    """Writes all figures of a run into the folder, and Table 8; in order of their numbers.

    Raises InputError if the folder cannot be written to.
    """
    pictures = [
        *_of_walk(study.best.trajectory),
        *_of_evolution(study),
    ]
    table_8 = table_8_two_best(study.run, study.best.trial)
    if table_8 is not None:
        write_whole(folder / TABLE_8, table_8.to_csv())
    return _save(pictures, folder)


def draw_recording(recording: Recording, folder: Path) -> list[Picture]:
    """Writes the figures for which one simulated gait is enough; in order of their numbers.

    Raises InputError if the folder cannot be written to.
    """
    return _save(list(_of_walk(recording.trajectory)), folder)


def _save(pictures: list[Picture], folder: Path) -> list[Picture]:
    for picture in pictures:
        save_figure(picture.figure, folder, picture.name)
    return sorted(pictures, key=lambda picture: picture.number)


def _draw(
    draw: Callable[..., Figure], *data: Any, caption: str, thesis: str, **options: Any
) -> Picture:
    name = draw.__name__
    return Picture(
        number=int(name.split("_")[1]),
        name=name,
        caption=caption,
        thesis=thesis,
        figure=draw(*data, **options),
    )


def _of_walk(trajectory: xarray.Dataset) -> Iterator[Picture]:
    """A gait and the forces at work in it."""
    yield _draw(
        figure_14_relative_distances,
        trajectory,
        caption="How far the tetrahedra are from the rear one, T1, while the robot walks.",
        thesis="the same course, without numbers",
    )
    yield _draw(
        figure_15_time_lapse,
        trajectory,
        caption="The walking robot from above.",
        thesis="a time lapse, without numbers",
    )
    yield _draw(
        figure_19_signal_and_tension,
        trajectory,
        caption="What the oscillators ask for, and the tension in the cables they drive.",
        thesis="the structure delays and reshapes the signals",
    )
    yield _draw(
        figure_20_ground_forces,
        trajectory,
        caption="Normal and friction forces on each tetrahedron.",
        thesis="normal forces are zero while a tetrahedron is lifted",
    )
    yield _draw(
        figure_21_one_step,
        trajectory,
        caption="One step: weight shifts between the tetrahedra, which lift before they move "
        "forward.",
        thesis="the same mechanism",
    )


def _of_evolution(study: Study) -> Iterator[Picture]:
    """How the populations began and what became of them."""
    run, trial = study.run, study.best.trial
    if len(initial_extremes(run)):
        yield _draw(
            figure_16_initial_distances,
            run,
            caption="How far the fittest and the least fit gait of each trial's initial population "
            "walk. Gaits that failed do not count.",
            thesis="the best of ten trials goes about "
            f"{thesis.BEST_INITIAL_DISTANCE_IN:g} inches in 15 s",
        )
    if trial in initial_extremes(run).index:
        yield _draw(
            figure_17_initial_fitness,
            run,
            trial,
            caption=f"Fitness of the initial population of trial {trial}, the best one.",
            thesis=f"{thesis.SHARE_BACKWARD} of the gaits go backward",
        )
    yield _draw(
        figure_18_before_and_after,
        study.initial.trajectory,
        study.best.trajectory,
        initial_label=study.initial.label,
        evolved_label=study.best.label,
        caption=f"How far the fittest gait of trial {trial}, the best one, walks: of the initial "
        "population (left) and of all (right).",
        thesis=f"{thesis.BEST_EVOLVED_DISTANCE_IN:g} inches in 15 s after evolution, "
        f"{thesis.BEST_IMPROVEMENT_PERCENT:g} % more than before",
    )
    yield _draw(
        figure_22_mean_fitness,
        run,
        caption="Mean fitness of each trial's population over the iterations; a dot marks the last "
        "one. The legend names the trials in the order in which they end, fittest first.",
        thesis="it rises in all ten trials",
    )
    yield _draw(
        figure_23_best_worst_average,
        run,
        caption="The trials whose population has the highest and the lowest mean fitness in the "
        "end, and the average over trials, with its standard deviation as bars. A trial that has "
        "ended counts with its last mean fitness; where a trial still goes on, the average ends.",
        thesis="the same comparison, without numbers",
    )
