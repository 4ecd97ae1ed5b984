"""Report of a run: an HTML page with numbers and figures, and the files it links to."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import pandas

from tetra_drake.errors import InputError
from tetra_drake.evolution.entries import BEST_GAIT, trial_folder
from tetra_drake.evolution.manifest import MANIFEST
from tetra_drake.evolution.run import gait_label, load_run
from tetra_drake.figures.style import AS_USUAL, Print
from tetra_drake.files import check_folder, write_whole
from tetra_drake.formatting import listed, render, rounded
from tetra_drake.machine import versions
from tetra_drake.report import summary
from tetra_drake.report.result_folder import REPLAY, RESULT, load_result
from tetra_drake.report.run_figures import (
    Picture,
    ShownGaits,
    draw,
    pictures_of_gait,
    pictures_of_run,
    simulate_again,
    simulate_shown_gaits,
)
from tetra_drake.results.result import headline
from tetra_drake.robot.gait import save_gait
from tetra_drake.scenario import metrics
from tetra_drake.scenario.load import SCENARIO, load_scenario
from tetra_drake.study.elites import distinct_gaits, elites, notable_gaits

REPORT, FIGURES = "report.html", "figures"
ELITES, ELITES_CSV = "elites", "elites/elites.csv"

_LONGEST_SETTING = 60  # letters; longer settings are not shown
# Settings that are not shown among those that differ from the thesis's; some are elsewhere.
_NOT_SHOWN = ("robot.nodes.", "objective.", "require.", "simulation.duration")


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
    if is_run and out is None:
        return write_report(source, printed)
    if is_run:
        draw(pictures_of_run(simulate_shown_gaits(load_run(source))), folder, printed)
    else:
        draw(pictures_of_gait(load_result(source)), folder, printed)
    return [folder]


def write_report(directory: Path, printed: Print = AS_USUAL) -> list[Path]:
    """Writes figures/, replay.html and report.html into the folder of a run. Returns their paths.

    A run with a map also gets elites/: a table of all gaits of the map, and a gait file and a
    replay page for each notable gait. The run may be unfinished. Raises InputError if there is no
    run, if it is damaged or has no fitness yet, or if the folder cannot be written to.
    """
    figures, replay, report = (directory / name for name in (FIGURES, REPLAY, REPORT))
    shown = simulate_shown_gaits(load_run(directory))
    pictures = pictures_of_run(shown)
    draw(pictures, figures, printed)
    run, notable = shown.run, _notable(shown)
    if notable:
        write_whole(directory / ELITES_CSV, elites(run).to_csv(index=False))
    for _, row, file, page in notable:
        save_gait(run.gait(row["trial"], row["index"]), directory / str(file), run.scenario)
        if page != REPLAY:
            simulate_again(run, row).result.save_replay(directory / str(page))
    shown.best.result.save_replay(replay)
    write_whole(report, render_report(shown, pictures, folder=figures))
    return [figures, replay, report]


class _Shown(NamedTuple):
    """A gait in a table of the report."""

    names: Sequence[str]
    recorded: pandas.Series
    """Row of the run's evaluations."""
    file: str | None
    """Gait file, relative to the folder of the run; None for a gait without a file."""
    page: str | None = None
    """Replay page; None if the table has no link to it."""


def _notable(shown: ShownGaits) -> list[_Shown]:
    """The notable gaits of the map. The run's best gait has its replay page already."""
    found, best = [], gait_label(shown.best.recorded)
    for names, row in distinct_gaits(notable_gaits(shown.run)):
        name = names[0].replace(", ", "_").replace(" ", "_")
        page = REPLAY if gait_label(row) == best else f"{ELITES}/{name}.html"
        found.append(_Shown(names, row, f"{ELITES}/{name}.json", page))
    return found


def render_report(shown: ShownGaits, pictures: Sequence[Picture], *, folder: Path) -> str:
    """The report as HTML, with figures that are files in `folder`."""
    run, best, scenario = shown.run, shown.best, shown.run.scenario
    trial = best.recorded["trial"]
    gait = run.gait(trial, best.recorded["index"])
    gains = [f"feedback gain of {name} {rounded(gain)}" for name, gain in gait.gains if gain]
    turn = [f"turn {rounded(gait.turn)}"] if gait.turn else []
    named = distinct_gaits({"initially": shown.initial.recorded, "best": best.recorded})
    best_gait = str(trial_folder(Path(), trial) / BEST_GAIT)
    return render(
        "report/report.html.jinja",
        shown=shown,
        title=f"{scenario.name}: {headline(scenario, best.recorded)}",
        pictures=pictures,
        folder=folder,
        gaits=[_Shown(names, row, best_gait if "best" in names else None) for names, row in named],
        map=_notable(shown),
        parameters=listed(
            [f"τ_A {rounded(gait.tau_a)} s", f"τ_B {rounded(gait.tau_b)} s", *turn, *gains]
        ),
        weights=dict(zip(gait.weight_names, gait.weights, strict=True)),
        differences=[
            (key, value)
            for key, value in scenario.differences(load_scenario("thesis"))
            if not key.startswith(_NOT_SHOWN) and len(value) <= _LONGEST_SETTING
        ],
        files={"scenario": SCENARIO, "replay": REPLAY, "figures": FIGURES, "elites": ELITES_CSV},
        summary=summary,
        metrics=metrics,
        versions=versions,
    )
