"""The report of a run: an HTML page with its numbers and figures, and the files it links to."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from urllib.parse import quote

import pandas

from tetra_drake.errors import InputError
from tetra_drake.evolution.method import Part
from tetra_drake.evolution.record import BEST_GAIT, SCENARIO, trial_folder
from tetra_drake.evolution.reevaluation import best_distances
from tetra_drake.evolution.summary import comparisons
from tetra_drake.evolution.tables import Run, load_run
from tetra_drake.figures.book import TWO_BEST, Picture, draw_run, draw_trajectory
from tetra_drake.figures.evolution import two_best
from tetra_drake.figures.study import Study, study_run
from tetra_drake.files import check_folder, write_whole
from tetra_drake.formatting import duration, fixed, render
from tetra_drake.results.folder import RESULT, RUN_MANIFEST, load_result_folder
from tetra_drake.results.result import versions
from tetra_drake.robot.gait import ParameterSpace
from tetra_drake.scenario.load import differences, dump_scenario, load_scenario
from tetra_drake.scenario.units import INCH
from tetra_drake.visualization.replay import replay_title, save_replay

REPORT, REPLAY, FIGURES = "report.html", "replay.html", "figures"


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
        draw_trajectory(load_result_folder(source).trajectory, folder)
    else:
        problem = f"holds neither {RUN_MANIFEST}, as `evolve` writes, nor {RESULT}, as `simulate`"
        raise InputError(source, "", problem)
    return [folder]


def write_report(directory: Path) -> list[Path]:
    """Writes figures/, replay.html and report.html into a run's directory; returns their paths.

    Works for an unfinished run, too. Raises InputError if `directory` holds no run, a damaged
    one, or one without any fitness, or cannot be written to.
    """
    study = study_run(load_run(directory))
    best = study.best
    pictures = draw_run(study, directory / FIGURES)
    save_replay(
        directory / REPLAY,
        scenario=study.run.manifest.scenario,
        trajectory=best.trajectory,
        title=replay_title(best.gait.name, best.trajectory),
    )
    write_whole(directory / REPORT, render_report(study, pictures, folder=directory / FIGURES))
    return [directory / FIGURES, directory / REPLAY, directory / REPORT]


def render_report(study: Study, pictures: Sequence[Picture], *, folder: Path) -> str:
    """The page, with the pictures as saved in `folder` in it; its links are relative."""
    run, best, gait = study.run, study.best, trial_folder(Path(), study.trial) / BEST_GAIT
    scenario, reference = run.manifest.scenario, run.manifest.scenario.reference
    walked = f"{fixed(best.recorded['distance_in'])} inches in {scenario.simulation.duration:g} s"
    return render(
        "report/report.html.jinja",
        title=f"{scenario.name}, seed {run.manifest.seed}: {walked}",
        notes=_notes(study),
        facts=_facts(run),
        differences=differences(scenario, load_scenario("thesis")),
        source=reference.source if reference else "",
        comparisons=comparisons(run),
        trials=_trials(run),
        best=f"{best.label}: {walked}".capitalize(),
        replay=REPLAY,
        gait=gait,
        metrics=_metrics(best.recorded),
        parameters=_parameters(study),
        two_best=f"{FIGURES}/{TWO_BEST}",
        figures=FIGURES,
        pictures=[_embedded(picture, folder) for picture in pictures],
        commands=_commands(run, gait),
        own=run.manifest.method.given_from_python,
        scenario=dump_scenario(scenario),
    )


def _notes(study: Study) -> list[str]:
    """What limits the report: an unfinished run, and gaits that do not move as recorded."""
    run, notes = study.run, []
    going_on = sum(status.stop is None for status in run.statuses)
    if going_on:
        how = "tetra-drake evolve --out . --resume in its directory"
        if run.manifest.method.given_from_python:
            how = "tetra_drake.evolve(..., resume=True) from Python"
        notes.append(f"This run is not finished: {going_on} trials go on. Continue it with {how}.")
    walks = {walk.label: walk.deviation_in for walk in (study.best, study.initial)}
    changed = [f"{label}: {inches:.1g} in" for label, inches in walks.items() if inches > 1e-6]
    if changed:
        notes.append(
            f"Figures and replay show gaits simulated again with {_listed(versions())}. Their "
            f"distances differ from the recorded ones: {'; '.join(changed)}."
        )
    return notes


def _facts(run: Run) -> list[tuple[str, str]]:
    manifest, statuses = run.manifest, run.statuses
    settings, method = manifest.scenario.evolution, manifest.method
    evaluations = sum(status.evaluations for status in statuses)
    failures = sum(status.failures for status in statuses)
    return [
        ("scenario", manifest.scenario.name),
        ("seed", f"{manifest.seed}"),
        ("trials", f"{settings.trials} of at most {settings.max_iterations} iterations"),
        ("evaluated by", _described(method.evaluator)),
        ("objective", _described(method.objective)),
        ("optimiser", _described(method.optimizer)),
        ("evaluations", f"{evaluations}, of which {failures} failed"),
        ("simulated time", f"{manifest.scenario.simulation.duration:g} s per evaluation"),
        ("wall time", f"{duration(sum(s.wall_time for s in statuses))} (h:mm:ss), all processes"),
        ("versions", _listed(manifest.versions)),
    ]


_NAMES = {
    "drake": "the Drake diagram",
    "compiled": "the compiled engine",
    "fitness": "the scenario's fitness",
    "SteadyState": "the steady-state evolutionary algorithm of the scenario",
}


def _described(part: Part) -> str:
    text = _NAMES.get(part.name, part.name)
    text += f" {json.dumps(part.settings)}" if part.settings else ""
    return text + (f", given from Python (SHA-256 {part.digest[:16]})" if part.digest else "")


def _trials(run: Run) -> dict[str, list[str]]:
    """The cells of each column, by its heading."""
    statuses = run.statuses
    columns = {
        "trial": [f"{status.number}" for status in statuses],
        "best distance (in)": [
            _rise(status.initial_best_distance_in, status.best_distance_in) for status in statuses
        ],
        "improvement (%)": [fixed(status.improvement_percent) for status in statuses],
        "mean fitness": [
            _rise(status.initial_mean_fitness, status.mean_fitness) for status in statuses
        ],
        "iterations": [f"{max(status.iteration, 0)}" for status in statuses],
        "evaluations": [f"{status.evaluations}" for status in statuses],
        "failed": [f"{status.failures}" for status in statuses],
        "state": [status.stop or "not ended" for status in statuses],
    }
    if not run.reevaluations.empty:
        again = {trial: distance for trial, _, distance in best_distances(run)}
        columns["best on the Drake diagram (in)"] = [
            fixed(again.get(status.number, math.nan)) for status in statuses
        ]
    return columns


def _rise(before: float, after: float) -> str:
    return f"{fixed(before)} \N{RIGHTWARDS ARROW} {fixed(after)}"


def _metrics(recorded: pandas.Series) -> list[tuple[str, str]]:
    names = {"steady_distance": "steady distance", "twist": "twist", "lateral_drift": "drift"}
    lengths = [(text, f"{fixed(recorded[name] / INCH)} in") for name, text in names.items()]
    return [("fitness", fixed(recorded["fitness"])), *lengths]


def _parameters(study: Study) -> pandas.DataFrame:
    """The best gait, beside the second best of its trial if there is one; rows: parameters."""
    scenario = study.run.manifest.scenario
    table = two_best(study.run, study.trial, scenario.reference)
    if table is None:
        space = ParameterSpace.of(scenario)
        table = pandas.DataFrame({"best": space.vector(study.best.gait)}, index=space.names)
    return table.map(lambda value: fixed(value, 4))


def _embedded(picture: Picture, folder: Path) -> dict[str, str]:
    """As an image of its own, so that no two drawings share names within the page."""
    svg = (folder / f"{picture.name}.svg").read_text(encoding="utf-8")
    packed = quote(" ".join(svg.split()), safe=" /:=,;()!?*+@$")  # base64 is a fifth longer
    return {"caption": picture.caption, "svg": packed}


def _commands(run: Run, gait: Path) -> list[str]:
    """Commands that reproduce the run; `evolve` only where no part was given from Python."""
    seed = run.manifest.seed
    evolve = f"tetra-drake evolve --scenario {SCENARIO} --seed {seed} --out ../again"
    return [
        *([] if run.manifest.method.given_from_python else [evolve]),
        f"tetra-drake simulate --scenario {SCENARIO} --gait {gait} --out ../best",
        "tetra-drake figures .",
    ]


def _listed(names: Mapping[str, str]) -> str:
    return ", ".join(f"{name} {version}" for name, version in names.items())
