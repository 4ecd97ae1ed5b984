"""Report of a run: an HTML page with numbers and figures, and the files it links to.

A figure has the name of the function that draws it. The first paragraph of the function's docstring
is the caption: what is true of each such figure. Legend and title tell the rest.
"""

from __future__ import annotations

import base64
import dataclasses
import inspect
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import pandas

from tetra_drake.engines.simulate import simulate
from tetra_drake.errors import InputError
from tetra_drake.evolution.entries import BEST_GAIT, BEST_SCENARIO, trial_folder
from tetra_drake.evolution.manifest import MANIFEST, read_manifest
from tetra_drake.evolution.run import Run, distinct_gaits, gait_label, load_run, tell_code
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
from tetra_drake.files import check_folder, write_whole
from tetra_drake.formatting import listed, render, rounded
from tetra_drake.machine import versions
from tetra_drake.on_demand import loaded
from tetra_drake.report import summary
from tetra_drake.report.result_folder import REPLAY, RESULT, load_result
from tetra_drake.results.result import SimulationResult, headline
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.gait_file import load_gait, save_gait
from tetra_drake.robot.remarks import stillness_remark
from tetra_drake.scenario import metrics
from tetra_drake.scenario.load import SCENARIO, load_scenario
from tetra_drake.scenario.scenario import Scenario

REPORT, FIGURES = "report.html", "figures"
ELITES, ELITES_CSV = "elites", "elites/elites.csv"

_LONGEST_SETTING = 60  # letters; longer settings are not shown
_MOST_PARAMETERS = 40  # further ones are not shown
_WEIGHT = "weight "
"""Beginning of the names of weights between oscillators."""
RECORDED_GAIT, RECORDED = Path(__file__).with_name("thesis_gait.json"), "recorded.html"
"""The best recorded gait of the thesis's robot, and the name of its replay page."""
BLOCK_DIAGRAM = Path(__file__).parents[1] / "systems/robot.svg"
"""Block diagram of the thesis's robot, as Graphviz draws it."""
_NOT_OF_THE_ROBOT = ("engine", "evolution.", "optimizer", "simulation.")
# Settings that are not shown among those that differ from the thesis's; some are elsewhere.
_NOT_SHOWN = ("robot.nodes.", "objective.", "require.", "evolve.", "simulation.duration")


@dataclass(frozen=True)
class RecordedGait:
    """Gait of a run: its recorded evaluation, and a new simulation for the report.

    The numbers may differ if other versions recorded the gait. They differ for a run with
    disturbances, because the new simulation has none.
    """

    recorded: pandas.Series
    """Row of the run's evaluations."""
    result: SimulationResult
    """Result of the new simulation, with trajectory."""

    @property
    def change(self) -> float:
        """Absolute difference (m) between the distances walked in the new simulation and in the
        record."""
        return abs(self.result.metrics.distance - self.recorded["distance"])


@dataclass(frozen=True)
class ShownGaits:
    """A run and the two gaits that its report shows."""

    run: Run
    best: RecordedGait
    """Fittest gait of the run."""
    initial: RecordedGait
    """Fittest initial gait of the same trial; see Run.initial_best()."""
    recorded: SimulationResult | None = None
    """The best recorded gait of the thesis's robot, walking as long as the run's gaits. None if the
    run is about another robot or other physics."""


Pictures = Mapping[str, Sequence[partial[Any]]]
"""Figures of a report by section: gait, evolution, forces. Each is a function with the data to
draw."""


class GaitColumn(NamedTuple):
    """Column of a table of the report, for one gait. The heading has all `names` of the gait, such
    as "initially" and "best"."""

    names: Sequence[str]
    recorded: pandas.Series
    """Row of the run's evaluations."""
    file: str | None
    """Gait file, relative to the folder of the run; None for a gait without a file."""
    page: str | None = None
    """Replay page; None if the table has no link to it."""


def write_figures(source: Path, out: Path | None = None, printed: Print = AS_USUAL) -> list[Path]:
    """Writes the figures of a run or of a result folder. Returns the paths that were written.

    Args:
        source: folder of a run, or result folder.
        out: folder for the figures. By default figures/ in the source; then the report and the
            replay of a run are written again, too.
        printed: width, letters and titles of the figures, and kinds of files.

    Raises:
        InputError: if `source` is neither, or `out` cannot be written to.
    """
    folder = out or source / FIGURES
    is_run = os.path.exists(source / MANIFEST)
    if not is_run and not os.path.exists(source / RESULT):
        problem = f"holds neither {MANIFEST}, as `evolve` writes, nor {RESULT}, as `simulate`"
        raise InputError(source, "", problem)
    check_folder(folder)
    if not is_run:
        draw_pictures(pictures_of_gait(load_result(source)), folder, printed)
        return [folder]
    manifest = read_manifest(source)
    tell_code(manifest.scenario, source)
    with manifest.in_its_units():
        if out is None:
            return write_report(source, printed)
        pictures = pictures_of_run(simulate_shown_gaits(load_run(source)))
        draw_pictures(pictures, folder, printed)
    return [folder]


def write_report(directory: Path, printed: Print = AS_USUAL) -> list[Path]:
    """Writes figures/, replay.html and report.html into the folder of a run. Returns their paths.

    A run with a quality-diversity map also gets elites/: a table of all gaits of the map, and a
    gait file and a replay page for each notable gait. The run may be unfinished. Raises InputError
    if there is no run, if it is damaged or has no fitness yet, or if the folder cannot be written
    to.
    """
    figures, replay, report = (directory / name for name in (FIGURES, REPLAY, REPORT))
    shown = simulate_shown_gaits(load_run(directory))
    pictures = pictures_of_run(shown)
    draw_pictures(pictures, figures, printed)
    run, notable = shown.run, _notable(shown)
    if notable:
        elites = _of_map(run, "elites")(run)
        write_whole(directory / ELITES_CSV, elites.to_csv(index=False))
    for _, row, file, page in notable:
        save_gait(run.gait(row["trial"], row["index"]), directory / str(file), run.scenario)
        if page != REPLAY:
            _simulate_again(run, row).result.save_replay(directory / str(page))
    best = shown.best
    dataclasses.replace(best.result, spread=run.spread_of(best.recorded)).save_replay(replay)
    if shown.recorded is not None:
        shown.recorded.save_replay(directory / RECORDED)
    write_whole(report, render_report(shown, pictures, folder=figures))
    return [figures, replay, report]


def simulate_shown_gaits(run: Run) -> ShownGaits:
    """Simulates the fittest gait of a run and the fittest initial gait of the same trial. For a run
    about the thesis's robot, also simulates the best recorded gait.

    Raises InputError if no gait of the run has a fitness. Raises SimulationFailure if a simulation
    fails; this can happen with versions other than the run's.
    """
    fittest = run.fittest()
    first = run.initial_best(fittest["trial"])
    best = _simulate_again(run, fittest)
    initial = best if first["index"] == fittest["index"] else _simulate_again(run, first)
    changed = [key for key, _ in run.scenario.differences(load_scenario("thesis"))]
    if not all(key.startswith(_NOT_OF_THE_ROBOT) for key in changed):
        return ShownGaits(run, best=best, initial=initial)
    gait = load_gait(RECORDED_GAIT, run.scenario)
    recorded = simulate(run.scenario, gait, record=True)
    return ShownGaits(run, best=best, initial=initial, recorded=recorded)


def _simulate_again(run: Run, recorded: pandas.Series) -> RecordedGait:
    gait = run.gait(recorded["trial"], recorded["index"])
    return RecordedGait(recorded, simulate(run.scenario, gait, record=True))


def pictures_of_gait(result: SimulationResult) -> Pictures:
    """The figures of one simulation by section, not drawn yet: each is a function that draws
    one."""
    structure = result.robot.structure
    forces = [path_of_the_centre, relative_distances, one_step]
    if structure.signals:
        forces.append(signals_and_tensions)
    if len(structure.contacts):
        forces.append(ground_forces)
    parts = {"gait": [gait_diagram, time_lapse], "forces": forces}
    return {part: [partial(draw, result) for draw in draws] for part, draws in parts.items()}


def pictures_of_run(shown: ShownGaits) -> Pictures:
    """The figures of a run and of its best gait by section, not drawn yet: each is a function that
    draws one."""
    run, trial = shown.run, shown.best.recorded["trial"]
    best, initial, trials = shown.best.result, shown.initial.result, initial_extremes(run).index
    evolution = [partial(fitness_of_trials, run)] if len(run.iterations) else []
    if len(trials) > 1:
        evolution.append(partial(initial_distances, run))
    if trial in trials:
        evolution.append(partial(initial_fitness, run, trial))
    if run.scenario.optimizer.map and len(_of_map(run, "elites")(run)):
        evolution.append(partial(_of_map(run, "map_of_gaits"), run))
    evolution.append(partial(before_and_after, initial, best))
    return {"evolution": evolution, **pictures_of_gait(best)}


def draw_pictures(pictures: Pictures, folder: Path, printed: Print = AS_USUAL) -> None:
    """Draws figures and writes them to a folder. A file has the name of the function that draws it.
    Raises InputError if a file cannot be written."""
    for part in pictures.values():
        for draw in part:
            figure = draw(**vars(printed.look))
            save_figure(figure, folder, draw.func.__name__, kinds=printed.kinds)


def _notable(shown: ShownGaits) -> list[GaitColumn]:
    """Columns of the notable gaits of a run's quality-diversity map (see notable_gaits()); empty
    without a map. The page of the run's best gait is the run's replay.html, others are in
    elites/."""
    if not shown.run.scenario.optimizer.map:
        return []
    found, best = [], gait_label(shown.best.recorded)
    for names, row in distinct_gaits(_of_map(shown.run, "notable_gaits")(shown.run)):
        name = names[0].replace(", ", "_").replace(" ", "_")
        page = REPLAY if gait_label(row) == best else f"{ELITES}/{name}.html"
        found.append(GaitColumn(names, row, f"{ELITES}/{name}.json", page))
    return found


def _of_map(run: Run, name: str) -> Any:
    """Function of the module for the map that the run's optimiser fills."""
    return loaded(f"{run.scenario.optimizer.map}:{name}")


def _embedded(picture: partial[Any], folder: Path) -> dict[str, str]:
    """Name, caption and image of a figure, by these keys. The image is the figure's SVG file in
    `folder` as a data URI."""
    name = picture.func.__name__
    caption = (inspect.getdoc(picture.func) or "").partition("\n\n")[0]
    image = _data_uri(folder / f"{name}.svg")
    return {"name": name, "caption": " ".join(caption.split()), "image": image}


def _data_uri(drawing: Path) -> str:
    """An SVG file as the address of an image. Inline, the ids of two SVGs would clash."""
    return f"data:image/svg+xml;base64,{base64.b64encode(drawing.read_bytes()).decode()}"


def _parameters_text(gait: Gait, scenario: Scenario) -> str:
    """Sentence with the parameters of a gait except its weights, and with its turn."""
    others = {name: x for name, x in gait.parameters.items() if not name.startswith(_WEIGHT)}
    units = {name: one.unit for name, one in scenario.parameters.items()}
    others |= {"turn": gait.turn} if gait.turn else {}
    shown = [f"{name} {rounded(x)} {units.get(name, '')}".strip() for name, x in others.items()]
    more = [f"{len(shown) - _MOST_PARAMETERS} more"] if len(shown) > _MOST_PARAMETERS else []
    return listed([*shown[:_MOST_PARAMETERS], *more])


def render_report(shown: ShownGaits, pictures: Pictures, *, folder: Path) -> str:
    """The report as HTML. It embeds the figures, whose SVG files are in `folder` already."""
    run, best, scenario = shown.run, shown.best, shown.run.scenario
    trial = best.recorded["trial"]
    gait = run.gait(trial, best.recorded["index"])
    folder_of_best = trial_folder(Path(), trial)
    best_gait = str(folder_of_best / BEST_GAIT)
    named = {"initially": shown.initial.recorded, "best": best.recorded}
    gaits = [
        GaitColumn(names, row, best_gait if "best" in names else None)
        for names, row in distinct_gaits(named)
    ]
    differences = [
        (key, value)
        for key, value in scenario.differences(load_scenario("thesis"))
        if not key.startswith(_NOT_SHOWN) and len(value) <= _LONGEST_SETTING
    ]
    spread = run.spread_of(best.recorded)
    words = headline(scenario, best.recorded, spread)
    if scenario.disturbances:
        alone = headline(scenario, vars(best.result.metrics))
        words = f"{alone}; mean of {scenario.draw_count} draws: {words}"
    assert best.result.tally  # the result is from a simulation
    return render(
        "report/report.html.jinja",
        shown=shown,
        title=f"{scenario.name}: {words}",
        spread=spread,
        steady=best.result.tally.begins[0],
        still=stillness_remark(best.result.robot, best.recorded),
        pictures={
            part: [_embedded(picture, folder) for picture in drawn]
            for part, drawn in pictures.items()
        },
        block_diagram=_data_uri(BLOCK_DIAGRAM),
        gaits=gaits,
        map=_notable(shown),
        parameters=_parameters_text(gait, scenario),
        weights={name: x for name, x in gait.parameters.items() if name.startswith(_WEIGHT)},
        differences=differences,
        files={
            "scenario": SCENARIO,
            "replay": REPLAY,
            "recorded": RECORDED,
            "figures": FIGURES,
            "elites": ELITES_CSV,
            "body": folder_of_best / BEST_SCENARIO,
        },
        summary=summary,
        metrics=metrics,
        versions=versions,
    )
