"""Analyses made up for tests of the tables, of which everything is known."""

from __future__ import annotations

import json
from pathlib import Path

from tetra_drake.evolution.tables import load_run
from tetra_drake.experiment.analysis import ANALYSIS, best_of_trials

BEST = {
    "off_ground": {"T1": 0.25, "T2": 0.5, "T3": 0.0},
    "frequencies_hz": {"T1-T2": 0.8, "T2-T3": None},
}

OFF = {"default": 0.0, "finer": 0.01, "coarser": -0.5}
"""Settings, and how far from the default's distance they end."""

CHANGES = (("initial spacing", -2.0, -1.0), ("initial spacing", 2.0, 0.2), ("friction", 5.0, None))
"""What is off by how many percent, and the distance that this changes; None for a failure."""


def write_analysis(run: Path) -> None:
    """An analysis of the run's best gaits as they are recorded."""
    best, resimulations, variations = [], [], []
    tables = load_run(run)
    rows = tables.evaluations.set_index(["trial", "index"])
    for gait in best_of_trials(tables):
        distance = float(rows.loc[(gait.trial, gait.evaluation), "distance_in"])
        trial = {"trial": gait.trial}
        best.append(trial | {"evaluation": gait.evaluation, "distance_in": distance} | BEST)
        resimulations += [
            trial | {"setting": name, "distance_in": distance + off, "failure": None}
            for name, off in OFF.items()
        ]
        outcomes = [("nothing", 0.0, 0.0), *CHANGES]
        variations += [
            trial
            | {"what": what, "percent": percent, "failure": "fell" if change is None else None}
            | {"distance_in": None if change is None else distance + change}
            for what, percent, change in outcomes
        ]
    content = {
        "schema": 1,
        "versions": {"drake": "1.2.3"},
        "oscillator": {"tau_a_s": 0.3, "frequency_hz": 0.53},
        "best_gaits": best,
        "resimulations": resimulations,
        "variations": variations,
    }
    (run / ANALYSIS).write_text(json.dumps(content))
