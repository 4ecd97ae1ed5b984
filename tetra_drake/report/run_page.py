"""The report of a run: an HTML page with its numbers and figures, and the files it links to."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from urllib.parse import quote

import pandas

from tetra_drake.analysis.elites import chosen, distinct_gaits, elites
from tetra_drake.errors import InputError
from tetra_drake.evolution.entries import BEST_GAIT, trial_folder
from tetra_drake.evolution.manifest import SCENARIO
from tetra_drake.evolution.reevaluation import best_distances
from tetra_drake.evolution.run import gait_label, load_run
from tetra_drake.figures.book import TWO_BEST, draw_run, draw_trajectory
from tetra_drake.figures.fitness import two_best
from tetra_drake.figures.study import Study, study_run, walk_again
from tetra_drake.files import check_folder, write_whole
from tetra_drake.formatting import render
from tetra_drake.machine import versions
from tetra_drake.report.result_folder import RESULT, RUN_MANIFEST, load_result_folder
from tetra_drake.report.summary import comparisons, metric_rows
from tetra_drake.results.metrics import headline
from tetra_drake.results.result import ground_text
from tetra_drake.robot.gait import ParameterSpace, save_gait
from tetra_drake.scenario.load import differences, dump_scenario, load_scenario
from tetra_drake.scenario.metric_units import METRICS, inverse
from tetra_drake.scenario.units import shown
from tetra_drake.visualization.replay import save_replay

REPORT, REPLAY, FIGURES = "report.html", "replay.html", "figures"
ELITES, ELITES_CSV = "elites", "elites.csv"


def write_figures(source: Path, out: Path | None = None) -> list[Path]:
    """Writes the figures of a run or of a result folder into `out`; returns what was written.

    Without `out`, they go to figures/ in the source, and a run's report and replay are written
    anew, too. Raises InputError.
    """
    folder = out or source / FIGURES
    if (source / RUN_MANIFEST).exists():
        check_folder(folder)
        if out is None:
            return write_report(source)
        draw_run(study_run(load_run(source)), folder)
    elif (source / RESULT).exists():
        check_folder(folder)
        recording = load_result_folder(source)
        draw_trajectory(recording.trajectory, recording.scenario, folder)
    else:
        problem = f"holds neither {RUN_MANIFEST}, as `evolve` writes, nor {RESULT}, as `simulate`"
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
    scenario, trajectory = study.run.manifest.scenario, study.best.trajectory
    captions = draw_run(study, figures)
    _write_map(study, directory)
    title = f"{study.best.gait.name}: {study.best.headline}"
    save_replay(replay, scenario=scenario, trajectory=trajectory, title=title)
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
        walk = walk_again(run, row["trial"], row["index"])
        file, page = (directory / each for each in _map_files(names, row, study))
        save_gait(walk.gait, file, run.manifest.scenario)
        if page != directory / REPLAY:
            title, trajectory = f"{walk.gait.name}: {walk.headline}", walk.trajectory
            save_replay(page, scenario=run.manifest.scenario, trajectory=trajectory, title=title)


def _map_files(names: Sequence[str], row: pandas.Series, study: Study) -> tuple[Path, Path]:
    """Gait file and replay page of a chosen gait of the map in a run's directory."""
    path = Path(ELITES) / names[0].replace(", ", "_").replace(" ", "_")
    page = Path(REPLAY) if gait_label(row) == study.best.label else path.with_suffix(".html")
    return path.with_suffix(".json"), page


def render_report(study: Study, captions: Mapping[str, str], *, folder: Path) -> str:
    """The page, with the pictures in `folder` by name and caption in it; its links are relative."""
    run, manifest = study.run, study.run.manifest
    best_gait = trial_folder(Path(), study.trial) / BEST_GAIT
    named = {"fittest initial": study.initial.recorded, "fittest": study.best.recorded}
    gaits, on_map = distinct_gaits(named), distinct_gaits(chosen(run))
    on_map_files = {n: _map_files(each, gait, study) for each, gait in on_map for n in each}
    walks = {walk.label: walk for walk in (study.best, study.initial)}
    changes = {n: abs(walk.distance_in - walk.recorded["distance_in"]) for n, walk in walks.items()}
    return render(
        "report/report.html.jinja",
        run=run,
        manifest=manifest,
        ground=ground_text(manifest.scenario),
        best=study.best,
        walked=headline(manifest.scenario, study.best.recorded),
        again={label: walk.distance_in for label, walk in walks.items()},
        changed={label: inches for label, inches in changes.items() if inches > 1e-6},
        versions=versions(),
        json=json.dumps,
        differences=differences(manifest.scenario, load_scenario("thesis")),
        comparisons=comparisons(run),
        on_diagram={trial: distance for trial, _, distance in best_distances(run)},
        objective=_terms(manifest.scenario.objective, inverse),
        require=_terms(manifest.scenario.require, str),
        gaits=[(names, gait_label(gait)) for names, gait in gaits],
        links={"fittest": best_gait},
        metrics=metric_rows([gait for _, gait in gaits]),
        map=[(names, gait_label(gait)) for names, gait in on_map],
        map_links={name: files[0] for name, files in on_map_files.items()},
        map_pages={name: files[1] for name, files in on_map_files.items()},
        map_metrics=metric_rows([gait for _, gait in on_map]) if on_map else [],
        parameters=_parameters(study),
        pictures=[(_embedded(folder / f"{name}.svg"), captions[name]) for name in captions],
        gait=best_gait,
        files={"scenario": SCENARIO, "replay": REPLAY, "figures": FIGURES, "two_best": TWO_BEST}
        | {"elites": Path(ELITES) / ELITES_CSV},
        settings=dump_scenario(manifest.scenario),
    )


def _terms(weights: Mapping[str, float], unit_of: Callable[[str], str]) -> str:
    """Numbers by names of metrics as a scenario has them, each in what `unit_of` makes of that
    metric's unit."""
    return ", ".join(f"{n}: {shown(x, unit_of(METRICS[n]))}" for n, x in weights.items())


def _parameters(study: Study) -> pandas.DataFrame:
    """The best gait, beside the second best of its trial if there is one; rows: parameters."""
    table = two_best(study.run, study.trial)
    if table is not None:
        return table
    space = ParameterSpace.of(study.run.manifest.scenario)
    return pandas.DataFrame({"best": space.vector(study.best.gait)}, index=space.names)


def _embedded(picture: Path) -> str:
    """As the URL of an image of its own, so that no two drawings share names within the page."""
    svg = " ".join(picture.read_text(encoding="utf-8").split())
    return "data:image/svg+xml," + quote(svg, safe=" /:=,;()!?*+@$")  # base64 is a fifth longer
