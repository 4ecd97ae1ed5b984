"""The report of a run: an HTML page with its numbers and figures, and the files it links to."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from urllib.parse import quote

import pandas

from tetra_drake.analysis.elites import chosen, distinct_gaits, elites
from tetra_drake.errors import InputError
from tetra_drake.evolution.entries import BEST_GAIT, trial_folder
from tetra_drake.evolution.manifest import MANIFEST, SCENARIO
from tetra_drake.evolution.run import gait_label, load_run
from tetra_drake.files import check_folder, write_whole
from tetra_drake.formatting import Table, fixed, render
from tetra_drake.machine import versions
from tetra_drake.report.book import Study, draw_run, draw_trajectory, simulate_again, study_run
from tetra_drake.report.result_folder import RESULT, load_result
from tetra_drake.report.summary import ground_text, metrics_table, results, trials_table
from tetra_drake.results.metrics import headline
from tetra_drake.robot.gait import ParameterSpace, save_gait
from tetra_drake.scenario.load import dump_scenario, load_scenario
from tetra_drake.scenario.metric_units import METRICS, inverse
from tetra_drake.scenario.units import shown

REPORT, REPLAY, FIGURES = "report.html", "replay.html", "figures"
ELITES, ELITES_CSV = "elites", "elites.csv"


def write_figures(source: Path, out: Path | None = None) -> list[Path]:
    """Writes the figures of a run or of a result folder into `out`; returns what was written.

    Without `out`, they go to figures/ in the source, and a run's report and replay are written
    anew, too. Raises InputError.
    """
    folder = out or source / FIGURES
    if (source / MANIFEST).exists():
        check_folder(folder)
        if out is None:
            return write_report(source)
        draw_run(study_run(load_run(source)), folder)
    elif (source / RESULT).exists():
        check_folder(folder)
        draw_trajectory(load_result(source), folder)
    else:
        problem = f"holds neither {MANIFEST}, as `evolve` writes, nor {RESULT}, as `simulate`"
        raise InputError(source, "", problem)
    return [folder]


def write_report(directory: Path) -> list[Path]:
    """Writes figures/, elites/, replay.html and report.html into a run's directory; returns the
    paths of all but elites/, which a run with a map alone has.

    Works for an unfinished run, too. Raises InputError if `directory` holds no run, a damaged
    one, or one without any fitness, or cannot be written to.
    """
    figures, replay, report = (directory / name for name in (FIGURES, REPLAY, REPORT))
    study = study_run(load_run(directory))
    captions = draw_run(study, figures)
    _write_map(study, directory)
    study.best.result.save_replay(replay)
    write_whole(report, render_report(study, captions, folder=figures))
    return [figures, replay, report]


def _write_map(study: Study, directory: Path) -> None:
    """Writes all gaits of the run's map as a table, and the chosen ones as gait files and, but for
    the run's best, replay pages."""
    run = study.run
    on_map = distinct_gaits(chosen(run))
    if on_map:
        write_whole(directory / ELITES / ELITES_CSV, elites(run).to_csv(index=False))
    for names, row in on_map:
        trial, index = row["trial"], row["index"]
        gait_file, page = _map_files(names, row, study)
        save_gait(run.gait(trial, index), directory / gait_file, run.manifest.scenario)
        if page != Path(REPLAY):
            simulate_again(run, row).result.save_replay(directory / page)


def _map_files(names: Sequence[str], row: pandas.Series, study: Study) -> tuple[Path, Path]:
    """Gait file and replay page of a chosen gait of the map in a run's directory."""
    path = Path(ELITES) / names[0].replace(", ", "_").replace(" ", "_")
    page = Path(REPLAY) if gait_label(row) == study.best.label else path.with_suffix(".html")
    return path.with_suffix(".json"), page


def render_report(study: Study, captions: Mapping[str, str], *, folder: Path) -> str:
    """The report as HTML, with the pictures in `folder`, whose captions are given by name."""
    run, manifest = study.run, study.run.manifest
    best_gait = trial_folder(Path(), study.trial) / BEST_GAIT
    named = {"fittest initial": study.initial.recorded, "fittest": study.best.recorded}
    gaits, on_map = distinct_gaits(named), distinct_gaits(chosen(run))
    map_files: dict[str, Path] = {}
    map_pages: dict[str, Path] = {}
    for names, gait in on_map:
        gait_file, page = _map_files(names, gait, study)
        map_files |= dict.fromkeys(names, gait_file)
        map_pages[names[0]] = page
    space = ParameterSpace.of(manifest.scenario)
    values = [fixed(value, 4) for value in run.vector(study.trial, study.best.recorded["index"])]
    again, changed = {}, {}
    for gait in (study.best, study.initial):
        again[gait.label] = gait.distance_in
        change = abs(gait.distance_in - gait.recorded["distance_in"])
        if change > 1e-6:
            changed[gait.label] = change
    return render(
        "report/report.html.jinja",
        run=run,
        manifest=manifest,
        ground=ground_text(manifest.scenario),
        best=study.best,
        walked=headline(manifest.scenario, study.best.recorded),
        again=again,
        changed=changed,
        versions=versions(),
        differences=manifest.scenario.differences(load_scenario("thesis")),
        results=results(run),
        trials=trials_table(run),
        objective=_terms(manifest.scenario.objective, inverse),
        require=_terms(manifest.scenario.require, str),
        gaits=gaits,
        label=gait_label,
        links={"fittest": best_gait},
        metrics=_metrics(gaits),
        map=on_map,
        map_links=map_files,
        map_pages=map_pages,
        map_metrics=_metrics(on_map) if on_map else None,
        parameters=Table(["", "value"], list(zip(space.names, values, strict=True))),
        pictures=[(_embedded(folder / f"{name}.svg"), captions[name]) for name in captions],
        gait=best_gait,
        files={
            "scenario": SCENARIO,
            "replay": REPLAY,
            "figures": FIGURES,
            "elites": Path(ELITES) / ELITES_CSV,
        },
        settings=dump_scenario(manifest.scenario),
    )


def _terms(weights: Mapping[str, float], unit_of: Callable[[str], str]) -> str:
    """Weights or limits of metrics as text; `unit_of` makes their unit from the metric's."""
    terms = [f"{name}: {shown(x, unit_of(METRICS[name]))}" for name, x in weights.items()]
    return ", ".join(terms)


def _metrics(gaits: Sequence[tuple[Sequence[str], pandas.Series]]) -> Table:
    return metrics_table({names[0]: gait for names, gait in gaits})


def _embedded(picture: Path) -> str:
    """A picture as the URL of an image, so that no two drawings share names within the page."""
    svg = " ".join(picture.read_text(encoding="utf-8").split())
    return "data:image/svg+xml," + quote(svg, safe=" /:=,;()!?*+@$")  # base64 is a fifth longer
