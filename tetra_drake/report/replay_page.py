"""Replay page of a result folder, a gait file or a run."""

from __future__ import annotations

import os
from pathlib import Path

from tetra_drake.engines.simulate import simulate
from tetra_drake.errors import InputError
from tetra_drake.evolution.manifest import MANIFEST
from tetra_drake.evolution.run import load_source
from tetra_drake.files import check_file
from tetra_drake.formatting import Say, silent
from tetra_drake.report.result_folder import RESULT, load_result
from tetra_drake.results.result import SimulationResult


def write_replay(
    source: Path, out: Path, *, scenario: str | None = None, warn: Say = silent
) -> str:
    """Writes the replay page of a result folder, a gait file or a run. Returns the page's title.

    Args:
        source: the result folder, gait file or folder of a run.
        out: the page to write.
        scenario: the scenario for a gait file.
        warn: see load_source().

    Raises:
        InputError: if the page cannot be written; nothing is simulated then.
    """
    check_file(out)
    result = load_or_simulate(source, scenario=scenario, warn=warn)
    result.save_replay(out)
    return result.title


def load_or_simulate(
    source: Path, *, scenario: str | None = None, warn: Say = silent
) -> SimulationResult:
    """The result of a result folder; or simulates a gait file, or the fittest gait of a run.

    `scenario` is for gait files only: folders have their own. For `warn`, see load_source().

    Raises InputError if the source cannot be used, or if a folder is given a scenario. Raises
    SimulationFailure if the simulation fails.
    """
    if os.path.isdir(source) and scenario is not None:
        raise InputError("replay", "scenario", f"is for gait files; {source} has its own scenario")
    is_run = os.path.exists(source / MANIFEST)
    if os.path.exists(source / RESULT) and not is_run:
        return load_result(source)
    if not os.path.isfile(source) and not is_run:
        raise InputError(source, "", "expected a folder of `simulate` or `evolve`, or a gait file")
    loaded = load_source(source, scenario=scenario, warn=warn)
    return simulate(loaded.scenario, loaded.best, record=True)
