"""Source of gaits for a command: a gait file or the folder of a run."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from tetra_drake.evolution.manifest import MANIFEST, read_manifest
from tetra_drake.evolution.run import load_run
from tetra_drake.formatting import Say, silent
from tetra_drake.robot.gait import Gait, load_gait
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.scenario import Scenario


@dataclass(frozen=True)
class GaitSource:
    """Gaits and the scenario to simulate them on."""

    scenario: Scenario
    best: Gait
    """The gait of the file, or the best gait of the run."""
    gaits: dict[str, Gait]
    """The gait of the file by its name, or the best gait of each trial by "trial 0" ..."""


def load_source(source: Path, *, scenario: str | None = None, warn: Say = silent) -> GaitSource:
    """Loads the gait of a file, or the best gaits of a run.

    Args:
        source: a gait file, or the folder of a run.
        scenario: name or file of a scenario. By default the scenario of the run that contains the
            gait; "thesis" if the gait is in no run.
        warn: function that gets a warning if the gaits were made for another scenario.

    Raises:
        InputError: if a file cannot be used.
    """
    folders = (source, *source.absolute().parents[:2])  # such as of run/trial_00/best_gait.json
    folder = next((folder for folder in folders if os.path.isfile(folder / MANIFEST)), None)
    if scenario is not None or folder is None:
        chosen = load_scenario(scenario or "thesis")
    else:
        chosen = read_manifest(folder).scenario
    if os.path.isdir(source):
        run = load_run(source)
        best, trials = run.best_gait(), run.best()["trial"]
        gaits = {f"trial {trial}": gait for trial, gait in zip(trials, run.gaits(), strict=True)}
    else:
        best = load_gait(source, chosen)
        gaits = {source.stem: best}
    if best.scenario not in ("", chosen.name):
        made = f"made for scenario {best.scenario}"
        warn(f"{source}: {made}, simulated on scenario {chosen.name}")
    return GaitSource(chosen, best, gaits)
