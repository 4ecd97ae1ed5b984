"""Sources of gaits for commands: a gait file, or the folder of a run."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from tetra_drake.evolution.manifest import MANIFEST, read_manifest
from tetra_drake.evolution.run import load_run
from tetra_drake.robot.gait import Gait, load_gait
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.scenario import Scenario


@dataclass(frozen=True)
class GaitSource:
    """Gaits, and the scenario to simulate them on."""

    scenario: Scenario
    best: Gait
    """Gait of the file, or the run's best."""
    gaits: dict[str, Gait]
    """Gaits by the name of the file, or the best gait of each trial."""


def load_source(
    source: Path,
    *,
    scenario: str | None = None,
    warn: Callable[[str], None] = lambda text: None,
) -> GaitSource:
    """The gait of a file, or the best gaits of a run.

    The scenario is the given one, a name or file; else that of the run in whose folder the gait
    is; else the thesis's. `warn` is told if the gaits were made for another one. Raises InputError.
    """
    folder = _run_folder(source)
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


def _run_folder(source: Path) -> Path | None:
    """The folder of the run that a path is, or is in: run/trial_00/best_gait.json."""
    folders = (source, *source.absolute().parents[:2])
    return next((folder for folder in folders if os.path.isfile(folder / MANIFEST)), None)
