"""Report of a run: an HTML page with numbers and figures, and the files it links to."""

from __future__ import annotations

import base64
import os
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import pandas

from tetra_drake.analysis.elites import distinct_gaits, elites, notable_gaits
from tetra_drake.errors import InputError
from tetra_drake.evolution.entries import BEST_GAIT, trial_folder
from tetra_drake.evolution.manifest import MANIFEST
from tetra_drake.evolution.run import gait_label, load_run
from tetra_drake.figures.style import AS_USUAL, Print
from tetra_drake.files import check_folder, write_whole
from tetra_drake.formatting import TextTable, listed, render, rounded
from tetra_drake.machine import versions
from tetra_drake.report.result_folder import REPLAY, RESULT, load_result
from tetra_drake.report.run_figures import (
    DrawnFigure,
    ShownGaits,
    draw_run,
    draw_trajectory,
    simulate_again,
    simulate_shown_gaits,
)
from tetra_drake.report.summary import ground_text, metrics_table, results, trials_table
from tetra_drake.results.result import headline
from tetra_drake.robot.gait import Gait, save_gait
from tetra_drake.robot.weights import NEURONS
from tetra_drake.scenario.load import SCENARIO, load_scenario
from tetra_drake.scenario.metrics import UNITS, inverse
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.settings.units import Units

REPORT, FIGURES = "report.html", "figures"
ELITES_FOLDER, ELITES_CSV = "elites", "elites.csv"

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
    if os.path.exists(source / MANIFEST):
        check_folder(folder)
        if out is None:
            return write_report(source, printed)
        draw_run(simulate_shown_gaits(load_run(source)), folder, printed)
    elif os.path.exists(source / RESULT):
        check_folder(folder)
        draw_trajectory(load_result(source), folder, printed)
    else:
        problem = f"holds neither {MANIFEST}, as `evolve` writes, nor {RESULT}, as `simulate`"
        raise InputError(source, "", problem)
    return [folder]


def write_report(directory: Path, printed: Print = AS_USUAL) -> list[Path]:
    """Writes figures/, replay.html and report.html into the folder of a run. Returns their paths.

    A run with a map also gets elites/. The run may be unfinished. Raises InputError if there is no
    run, if it is damaged or has no fitness yet, or if the folder cannot be written to.
    """
    figures, replay, report = (directory / name for name in (FIGURES, REPLAY, REPORT))
    shown = simulate_shown_gaits(load_run(directory))
    drawn = draw_run(shown, figures, printed)
    _write_map(shown, directory)
    shown.best.result.save_replay(replay)
    write_whole(report, render_report(shown, drawn, folder=figures))
    return [figures, replay, report]


def _write_map(shown: ShownGaits, directory: Path) -> None:
    """Writes elites/: a table of all gaits of the map, and a gait file and a replay page for each
    notable gait. The run's best gait has its replay page already."""
    run = shown.run
    on_map = distinct_gaits(notable_gaits(run))
    if on_map:
        write_whole(directory / ELITES_FOLDER / ELITES_CSV, elites(run).to_csv(index=False))
    for names, row in on_map:
        trial, index = row["trial"], row["index"]
        gait_file, page = _map_files(names, row, shown)
        save_gait(run.gait(trial, index), directory / gait_file, run.scenario)
        if page != Path(REPLAY):
            simulate_again(run, row).result.save_replay(directory / page)


def _map_files(names: Sequence[str], row: pandas.Series, shown: ShownGaits) -> tuple[Path, Path]:
    """Gait file and replay page of a notable gait of the map, relative to the run's folder."""
    path = Path(ELITES_FOLDER) / names[0].replace(", ", "_").replace(" ", "_")
    page = Path(REPLAY) if gait_label(row) == shown.best.label else path.with_suffix(".html")
    return path.with_suffix(".json"), page


def render_report(shown: ShownGaits, figures: Sequence[DrawnFigure], *, folder: Path) -> str:
    """The report as HTML, with figures that are files in `folder`."""
    run, scenario = shown.run, shown.run.scenario
    best_gait = trial_folder(Path(), shown.trial) / BEST_GAIT
    named = {"initially": shown.initial.recorded, "best": shown.best.recorded}
    gaits, on_map = distinct_gaits(named), distinct_gaits(notable_gaits(run))
    map_files: dict[str, Path] = {}
    map_pages: dict[str, Path] = {}
    for names, gait in on_map:
        gait_file, page = _map_files(names, gait, shown)
        map_files |= dict.fromkeys(names, gait_file)
        map_pages[names[0]] = page
    changed = {}
    for shown_gait in (shown.best, shown.initial):
        change = abs(shown_gait.distance - shown_gait.recorded["distance"])
        if change > 1e-8:
            changed[shown_gait.label] = change / scenario.units.length
    gait = run.gait(shown.trial, shown.best.recorded["index"])
    return render(
        "report/report.html.jinja",
        shown=shown,
        title=f"{scenario.name}: {headline(scenario, shown.best.recorded)}",
        ground=ground_text(scenario),
        changed=changed,
        versions=versions(),
        differences=[
            (key, value)
            for key, value in scenario.differences(load_scenario("thesis"))
            if not key.startswith(_NOT_SHOWN) and len(value) <= _LONGEST_SETTING
        ],
        results=results(run),
        trials=trials_table(run),
        objective=_terms(scenario.objective, inverse, scenario.units),
        require=_terms(scenario.require, str, scenario.units),
        gaits=gaits,
        label=gait_label,
        links={"best": best_gait},
        metrics=_metrics(gaits, scenario),
        map=on_map,
        map_links=map_files,
        map_pages=map_pages,
        map_metrics=_metrics(on_map, scenario) if on_map else None,
        parameters=_parameters(gait),
        weights=_weight_matrices(gait),
        pictures=_pictures(figures, folder),
        files={
            "scenario": SCENARIO,
            "replay": REPLAY,
            "figures": FIGURES,
            "elites": Path(ELITES_FOLDER) / ELITES_CSV,
        },
    )


def _terms(weights: Mapping[str, float], unit_of: Callable[[str], str], units: Units) -> str:
    """Weights or limits of metrics as text. `unit_of` gives their unit from the metric's unit."""
    terms = [f"{name}: {units.shown(x, unit_of(UNITS[name]))}" for name, x in weights.items()]
    return ", ".join(terms)


def _metrics(gaits: Sequence[tuple[Sequence[str], pandas.Series]], scenario: Scenario) -> TextTable:
    return metrics_table({names[0]: gait for names, gait in gaits}, scenario)


def _parameters(gait: Gait) -> str:
    """The parameters of a gait except its weights, as text."""
    texts = [f"Time constants τ_A {rounded(gait.tau_a)} s", f"τ_B {rounded(gait.tau_b)} s"]
    if gait.turn:
        texts.append(f"turn {rounded(gait.turn)}")
    texts += [f"feedback gain of {name} {rounded(gain)}" for name, gain in gait.gains if gain]
    return listed(texts)


def _weight_matrices(gait: Gait) -> dict[str, list[list[float | None]]]:
    """The weights between all extensors, and between all flexors, as heat maps: a row per
    oscillator with the weights from all oscillators, None where no weight is. Empty for a single
    oscillator."""
    weights = dict(zip(gait.weight_names, gait.weights, strict=True))
    count = max((int(name.partition("->")[0]) for name in weights), default=0)
    numbers = range(1, count + 1)
    return {
        kind: [[weights.get(f"{j}->{i} {kind}") for j in numbers] for i in numbers]
        for kind in NEURONS
        if count
    }


def _pictures(figures: Sequence[DrawnFigure], folder: Path) -> dict[str, list[tuple[str, ...]]]:
    """The figures of each part of the report: image URL, file and caption."""
    parts: dict[str, list[tuple[str, ...]]] = defaultdict(list)
    for part, name, caption in figures:
        # Embedded directly, not as the URL of an image, the ids of two SVGs would clash.
        content = base64.b64encode((folder / f"{name}.svg").read_bytes()).decode()
        picture = f"data:image/svg+xml;base64,{content}", f"{FIGURES}/{name}.svg", caption
        parts[part].append(picture)
    return parts
