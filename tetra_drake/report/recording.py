"""One gait's motion to show, wherever it is to be had from."""

from __future__ import annotations

from pathlib import Path

from tetra_drake.engines.simulate import simulate
from tetra_drake.errors import InputError
from tetra_drake.evolution.json_lines import read_lines
from tetra_drake.evolution.record import (
    BEST_GAIT,
    ITERATIONS,
    MANIFEST,
    read_manifest,
    trial_folder,
)
from tetra_drake.results.folder import RESULT, Recording, load_result_folder
from tetra_drake.robot.gait import load_gait
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.schema import Scenario


def load_recording(source: Path, *, scenario: str | None = None) -> Recording:
    """What there is to see at `source`: a result folder, a gait file or a run directory.

    A gait, and the best one of a run, is simulated; on `scenario`, or else the thesis's.
    Folders have a scenario of their own.

    Raises InputError if there is nothing to see or a scenario is given for a folder, and
    SimulationFailure.
    """
    if not source.is_dir():
        if not source.exists():
            expected = "a folder of `simulate` or `evolve`, or a gait file"
            raise InputError(source, "", f"no such file or folder, expected {expected}")
        return _simulate(source, load_scenario(scenario or "thesis"))
    if scenario is not None:
        raise InputError("--scenario", "", f"is for gait files; {source} has one of its own")
    if (source / MANIFEST).exists():
        run = read_manifest(source)
        return _simulate(best_gait_file(source, trials=run.scenario.evolution.trials), run.scenario)
    if (source / RESULT).exists():
        return load_result_folder(source)
    raise InputError(
        source, "", f"holds neither {RESULT}, as `simulate` writes, nor {MANIFEST}, as `evolve`"
    )


def best_gait_file(run: Path, *, trials: int) -> Path:
    """The file of a run's fittest gait; InputError if no gait has a fitness yet."""
    best: tuple[float, Path] | None = None
    for number in range(trials):
        folder = trial_folder(run, number)
        iterations = read_lines(folder / ITERATIONS)
        fitness = iterations[-1].get("best_fitness") if iterations else None
        if isinstance(fitness, (int, float)) and (best is None or fitness > best[0]):
            best = fitness, folder / BEST_GAIT
    if best is None:
        raise InputError(run, "", "holds no gait with a fitness yet")
    return best[1]


def _simulate(gait_file: Path, scenario: Scenario) -> Recording:
    gait = load_gait(gait_file, scenario)
    trajectory = simulate(scenario=scenario, gait=gait, record=True).trajectory
    assert trajectory is not None
    return Recording(scenario=scenario, gait=gait, trajectory=trajectory)
