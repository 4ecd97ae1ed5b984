"""Makes the recorded runs in the folder of this file from nothing.

    python runs/record.py [--so-far] [NAME ...]

Each experiment is evolved and analysed in a folder of out/runs, then thinned into a folder here. A
picture (made by Chromium from a replay) and a gait diagram show its best gait. Experiments in
README.md are filmed, too. After an interruption the script continues; finished experiments are
skipped. times.json has the time of each evolution.

With --so-far, the folders here get what there is of experiments that are being evolved. Such a run
is whole, not thinned: where out/runs has none, the script goes on from it.
"""

from __future__ import annotations

import contextlib
import filecmp
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from analyse import ANALYSIS, analyse
from script import chosen, evolved, read_settings, script
from thinning import thin

from tetra_drake.engines.simulate import simulate
from tetra_drake.evolution.manifest import MANIFEST, read_manifest
from tetra_drake.evolution.run import load_run
from tetra_drake.figures.gait_diagram import gait_diagram
from tetra_drake.figures.style import save_figure
from tetra_drake.files import read_json, write_whole
from tetra_drake.formatting import duration
from tetra_drake.lab.elites.elites import judge_elites
from tetra_drake.machine import available_cores
from tetra_drake.report.result_folder import REPLAY
from tetra_drake.results.result import SimulationResult
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.scenario import Scenario

HERE = Path(__file__).parent
SCRATCH = Path("out/runs")
PICTURE, FILM = "walking.png", "walking.gif"
DIAGRAM = "gait"
"""Name of the picture of the gait diagram, without its suffix."""
TIMES = "times.json"
SO_FAR = "--so-far"


@dataclass(frozen=True)
class Experiment:
    """Scenario and title of a recorded run."""

    title: str
    base: str
    """Name of a shipped scenario."""
    changes: Mapping[str, Any]
    """Changes of the scenario by key, without the name."""
    initial: bool = False
    """True if its record keeps the genomes of all initial populations, which a page reads."""
    film: bool = False
    """True if its best gait is filmed, for README.md."""
    engine: str = "compiled"

    def scenario(self, name: str) -> Scenario:
        """Scenario of the run of this name."""
        base = load_scenario(self.base).on_engine(self.engine)
        step = _STEP if self.engine == "compiled" else {}
        return base.with_changes({"name": name} | step | dict(self.changes))


_STEP = {"engine.max_step": "3 ms"}
"""The longest step of runs on the compiled engine, also where damping is light."""


def load_experiments(file: Path) -> dict[str, Experiment]:
    """The experiments of a file by name of the folder, in the order of the gallery."""
    content, experiments = read_settings(file), {}
    for name, given in content["experiments"].items():
        own = given.pop("changes", {})
        of_groups = [content["groups"][group] for group in given.pop("with", [])]
        changes = dict(item for each in (*of_groups, own) for item in each.items())
        experiments[name] = Experiment(changes=changes, **given)
    return experiments


EXPERIMENTS = load_experiments(HERE / "experiments.yaml")


def record(name: str, experiment: Experiment, *, scratch: Path, out: Path) -> None:
    """Makes a run in `scratch`, and its thinned copy in `out`. Continues unfinished work.

    Raises InputError if `scratch` holds a run of another scenario.
    """
    made, shown, scenario = scratch / name, out / name, experiment.scenario(name)
    analysis, copy = made / ANALYSIS, shown / ANALYSIS
    if analysis.exists() and copy.exists() and filecmp.cmp(analysis, copy, shallow=False):
        return
    if not (made / MANIFEST).exists() and is_unfinished(shown, scenario):
        thin(shown, made, whole=True)
    if not (made / MANIFEST).exists():
        save_times(load_times(out) | {name: {}}, out)
    with timed(name, out):
        # No reevaluation: analyse() simulates the best gaits on the diagram with tighter settings.
        evolved(scenario, made)
    publish(name, experiment, made, out=out)


def record_so_far(name: str, experiment: Experiment, *, scratch: Path, out: Path) -> None:
    """Puts what there is of a run in `scratch`, which another process may evolve, into `out`."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / name
        thin(scratch / name, copy, whole=True)
        publish(name, experiment, copy, out=out, whole=True)


def is_unfinished(shown: Path, scenario: Scenario) -> bool:
    """True if a folder holds a whole run of this scenario, which can go on."""
    if not (shown / MANIFEST).exists():
        return False
    manifest = read_manifest(shown)
    return not manifest.thinned and not manifest.scenario.differences(scenario)


def publish(
    name: str, experiment: Experiment, made: Path, *, out: Path, whole: bool = False
) -> None:
    """Analyses the run in the folder `made`, unless that is done, and shows it in `out`: thinned,
    unless it is to be `whole`."""
    analysis, shown = made / ANALYSIS, out / name
    if not analysis.exists():
        judge_elites(made)
        analyse(made, workers=available_cores())
    for old in shown.glob("trial_*"):
        shutil.rmtree(old)
    thin(made, shown, initial=experiment.initial, whole=whole)
    show(shown, film=experiment.film)
    shutil.copy(analysis, shown / ANALYSIS)


def load_times(out: Path) -> dict[str, Any]:
    """Times of the evolutions recorded in the folder `out`: wall_s and cores_s (s) by name."""
    file = out / TIMES
    return read_json(file, "times") if file.exists() else {}


def save_times(times: Mapping[str, Any], out: Path) -> None:
    """Writes the times of the evolutions recorded in the folder `out`."""
    write_whole(out / TIMES, json.dumps(times, indent=1) + "\n")


@contextlib.contextmanager
def timed(name: str, out: Path) -> Iterator[None]:
    """Context manager that adds the times of an evolution to the times in `out`: wall time, and the
    time of all cores. Also after an interruption."""
    begin, work = time.monotonic(), sum(os.times()[:4])
    try:
        yield
    finally:
        times = load_times(out)
        spent = {"wall_s": 0.0, "cores_s": 0.0} | times.get(name, {})
        spent["wall_s"] = round(spent["wall_s"] + time.monotonic() - begin, 1)
        spent["cores_s"] = round(spent["cores_s"] + sum(os.times()[:4]) - work, 1)
        save_times(times | {name: spent}, out)
        print(f"{name}: {duration(spent['wall_s'])}", flush=True)


def best_walk(directory: Path) -> SimulationResult:
    """A run's best gait, simulated on the compiled engine, with the trajectory."""
    run = load_run(directory)
    return simulate(run.scenario.on_engine("compiled"), run.best_gait(), record=True)


def show(directory: Path, *, film: bool) -> None:
    """Writes the picture of a run's best gait, the gait diagram and, if the experiment is filmed,
    the film."""
    result = best_walk(directory)
    films = [directory / FILM] if film else []
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / REPLAY
        result.save_replay(page)
        take_pictures(page, *films, directory / PICTURE)
    save_figure(gait_diagram(result), directory, DIAGRAM, kinds=["svg"])


def take_pictures(page: Path, *pictures: Path) -> None:
    """Makes a picture of the end of a page's motion, or a film, in a browser. Raises
    CalledProcessError."""
    script = HERE.parent / "diagrams" / "animation.py"
    subprocess.run([sys.executable, script, page, *pictures], check=True)


@script
def main(arguments: Sequence[str]) -> None:
    """Records the experiments of the given names, or all. Raises InputError."""
    names = [argument for argument in arguments if argument != SO_FAR]
    make = record_so_far if SO_FAR in arguments else record
    for name in chosen(names, EXPERIMENTS):
        make(name, EXPERIMENTS[name], scratch=SCRATCH, out=HERE)
