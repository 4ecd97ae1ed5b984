"""The report of a run: one HTML page with its numbers and figures, and what goes with it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from tetra_drake.evolution.record import BEST_GAIT, SCENARIO, trial_folder
from tetra_drake.evolution.reevaluation import best_distances
from tetra_drake.evolution.study import Study, Walk, study_run
from tetra_drake.evolution.summary import comparisons
from tetra_drake.figures.book import TABLE_8, Picture, draw_run
from tetra_drake.figures.evolution import table_8_two_best
from tetra_drake.files import write_whole
from tetra_drake.formatting import duration
from tetra_drake.formatting import fixed as number
from tetra_drake.results.result import versions
from tetra_drake.scenario.load import dump_scenario
from tetra_drake.visualization.replay import replay_title, save_replay

if TYPE_CHECKING:
    import pandas

REPORT, REPLAY, FIGURES = "report.html", "replay.html", "figures"


def write_report(directory: Path) -> list[str]:
    """Writes figures/, replay.html and report.html into a run's directory; their names.

    Works for a run that is not finished, too. Raises InputError if `directory` holds no
    run, a damaged one, or one without any fitness, or cannot be written to.
    """
    study = study_run(directory)
    pictures = draw_run(study, directory / FIGURES)
    save_replay(
        directory / REPLAY,
        scenario=study.run.manifest.scenario,
        trajectory=study.best.trajectory,
        title=replay_title(study.best.gait.name, study.best.trajectory),
    )
    write_whole(directory / REPORT, render_report(study, pictures, folder=directory / FIGURES))
    return [f"{FIGURES}/", REPLAY, REPORT]


def render_report(study: Study, pictures: Sequence[Picture], *, folder: Path) -> str:
    """The page, with the pictures as saved in `folder` in it; its links are relative."""
    from jinja2 import Environment, StrictUndefined

    template = (resources.files("tetra_drake") / "report" / "report.html.jinja").read_text(
        encoding="utf-8"
    )
    environment = Environment(autoescape=True, undefined=StrictUndefined)
    scenario, best = study.run.manifest.scenario, study.best
    seconds = f"{scenario.simulation.duration:g} s"
    return environment.from_string(template).render(
        title=f"{scenario.name}, seed {study.run.manifest.seed}: "
        f"{number(best.result.metrics.distance_in)} inches in {seconds}",
        notes=_notes(study),
        facts=_run_facts(study),
        comparisons=comparisons(study.run),
        duration=seconds,
        trials=_trial_table(study),
        best=_best_gait(best, seconds),
        figures=FIGURES,
        pictures=[_embedded(picture, folder) for picture in pictures],
        table_8=_table_8(study),
        commands=_commands(study),
        scenario=dump_scenario(scenario),
    )


def _notes(study: Study) -> list[str]:
    """What a reader has to know before believing the rest."""
    notes = []
    going_on = sum(status.stop is None for status in study.statuses)
    if going_on:
        notes.append(
            f"This run is not finished: {going_on} of {len(study.statuses)} trials go on with "
            "tetra-drake evolve --out . --resume in its directory."
        )
    walks = [study.best] if study.initial is study.best else [study.best, study.initial]
    changed = [
        f"that of {walk.label} ends {walk.deviation_in:.1g} in from where it did in the run"
        for walk in walks
        if walk.deviation_in
    ]
    if changed:
        notes.append(
            f"The gaits were simulated again for these pictures, with {_listed(versions())}; "
            f"{', '.join(changed)}."
        )
    return notes


def _run_facts(study: Study) -> list[tuple[str, str]]:
    manifest, statuses = study.run.manifest, study.statuses
    settings = manifest.scenario.evolution
    evaluations = sum(status.evaluations for status in statuses)
    failures = sum(status.failures for status in statuses)
    wall_time = sum(status.wall_time for status in statuses)
    return [
        ("scenario", manifest.scenario.name),
        ("seed", f"{manifest.seed}"),
        ("trials", f"{settings.trials} of at most {settings.max_iterations} iterations"),
        ("population", f"{settings.population}"),
        ("evaluations", f"{evaluations}, of which {failures} failed"),
        ("simulated time", f"{manifest.scenario.simulation.duration:g} s an evaluation"),
        ("engine", manifest.scenario.simulation.engine),
        ("simulation took", f"{duration(wall_time)} (h:mm:ss), all processes together"),
        ("versions", _listed(manifest.versions)),
    ]


def _trial_table(study: Study) -> dict[str, list[str]]:
    """The cells of each column, by its heading."""
    statuses = study.statuses
    rises = [status.improvement_percent for status in statuses]
    columns = {
        "trial": [f"{status.number}" for status in statuses],
        "best distance": [
            _rise(status.initial_best_distance_in, status.best_distance_in) for status in statuses
        ],
        "improvement": [number(rise) + (" %" if math.isfinite(rise) else "") for rise in rises],
        "mean fitness": [
            _rise(status.initial_mean_fitness, status.mean_fitness) for status in statuses
        ],
        "iterations": [f"{max(status.iteration, 0)}" for status in statuses],
        "evaluations": [f"{status.evaluations}" for status in statuses],
        "failed": [f"{status.failures}" for status in statuses],
        "state": [status.stop or "not ended" for status in statuses],
    }
    if not study.run.reevaluations.empty:
        on_diagram = {trial: distance for trial, _, distance in best_distances(study.run)}
        columns["best on the Drake diagram"] = [
            number(on_diagram.get(status.number, math.nan)) for status in statuses
        ]
    return columns


def _rise(before: float, after: float) -> str:
    return f"{number(before)} \N{RIGHTWARDS ARROW} {number(after)}"


def _best_gait(best: Walk, seconds: str) -> dict[str, Any]:
    metrics = best.result.metrics
    gait = best.gait
    weights = [{"ours": f"{weight:.4f}"} for weight in gait.weights]
    taus = [{"ours": f"{tau:.4f}"} for tau in (gait.tau_a, gait.tau_b)]
    return {
        "label": best.label.capitalize(),
        "walked": f"{number(metrics.distance_in)} inches in {seconds}",
        "replay": REPLAY,
        "file": f"{trial_folder(Path(), best.trial) / BEST_GAIT}",
        "facts": [
            ("fitness", number(best.result.fitness)),
            ("steady distance", f"{number(metrics.in_inches()['steady_distance_in'])} in"),
            ("twist", f"{metrics.in_inches()['twist_in']:.2g} in"),
            ("lateral drift", f"{metrics.in_inches()['lateral_drift_in']:.2g} in"),
        ],
        "parameters": [*_weight_columns(weights), _column("τ_A, τ_B", taus)],
    }


def _table_8(study: Study) -> dict[str, Any] | None:
    """The thesis's layout: weights in columns of four, between fitness and time constants."""
    table = table_8_two_best(study.run, study.best.trial)
    if table is None:
        return None
    fitness, *weights, tau_a, tau_b = _difference_cells(table)
    return {
        "trial": f"trial {study.best.trial}, the best one",
        "has_thesis": bool(table["thesis"].notna().all()),
        "file": f"{FIGURES}/{TABLE_8}",
        "columns": [
            _column("fitness", [fitness]),
            *_weight_columns(weights),
            _column("τ_A, τ_B", [tau_a, tau_b]),
        ],
    }


def _difference_cells(table: pandas.DataFrame) -> list[dict[str, str]]:
    return [
        {"ours": f"{ours:.4f}", "thesis": f"{theirs:.4f}" if math.isfinite(theirs) else ""}
        for ours, theirs in zip(table["difference"], table["thesis"], strict=True)
    ]


def _weight_columns(cells: Sequence[dict[str, str]]) -> list[dict[str, Any]]:
    """Columns of four; 2 n (n - 1) weights always fill them."""
    return [
        _column(f"w{first + 1}\N{EN DASH}{first + 4}", cells[first : first + 4])
        for first in range(0, len(cells), 4)
    ]


def _column(heading: str, cells: Sequence[dict[str, str]]) -> dict[str, Any]:
    return {"heading": heading, "cells": [{"thesis": ""} | cell for cell in cells]}


def _embedded(picture: Picture, folder: Path) -> dict[str, Any]:
    """As an image of its own, so that no two drawings share names within the page."""
    svg = (folder / f"{picture.name}.svg").read_text(encoding="utf-8")
    return {
        "number": picture.number,
        "caption": picture.caption,
        "thesis": picture.thesis,
        # Not base64, which would be a fifth longer.
        "svg": quote(" ".join(svg.split()), safe=" /:=,;()!?*+@$"),
    }


def _commands(study: Study) -> list[str]:
    gait = trial_folder(Path(), study.best.trial) / BEST_GAIT
    return [
        f"tetra-drake evolve --scenario {SCENARIO} --seed {study.run.manifest.seed} --out ../again",
        f"tetra-drake simulate --scenario {SCENARIO} --gait {gait} --out ../best",
        "tetra-drake figures .",
    ]


def _listed(names: Mapping[str, str]) -> str:
    return ", ".join(f"{name} {version}" for name, version in names.items())
