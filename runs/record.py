"""Makes the recorded runs in the folder of this file from nothing.

    python runs/record.py [--so-far] [NAME ...]

Each experiment is evolved and analysed in a folder of out/runs, then thinned into a folder here. A
page and a picture (made by Chromium) show its best gait. Experiments in README.md are filmed, too.
After an interruption the script continues; finished experiments are skipped. All pages share the
viewer meshcat.js of one version of Drake. times.json has the time of each experiment.

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
from thinning import thin

from tetra_drake.engines.simulate import simulate
from tetra_drake.errors import InputError
from tetra_drake.evolution.manifest import MANIFEST, read_manifest
from tetra_drake.evolution.progress import Progress
from tetra_drake.evolution.run import load_run
from tetra_drake.experiment import evolve
from tetra_drake.figures.gait_diagram import gait_diagram
from tetra_drake.figures.style import save_figure
from tetra_drake.files import write_whole
from tetra_drake.formatting import duration, listed
from tetra_drake.lab.elites.elites import judge_elites
from tetra_drake.lab.prototype.export import export
from tetra_drake.machine import available_cores
from tetra_drake.report.result_folder import REPLAY
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.optimizer_kinds import CmaEs, OptimizerKind, QualityDiversity
from tetra_drake.scenario.scenario import Scenario

HERE = Path(__file__).parent
SCRATCH = Path("out/runs")
VIEWER, PICTURE, FILM = "meshcat.js", "walking.png", "walking.gif"
DIAGRAM = "gait"
"""Name of the picture of the gait diagram, without its suffix."""
TIMES, EXPORTED = "times.json", "lab"
SO_FAR = "--so-far"
RATE = 50.0
"""Sampling rate (Hz) of exported commands."""


@dataclass(frozen=True)
class Experiment:
    """Scenario and title of a recorded run."""

    title: str
    base: str
    """Name of a shipped scenario."""
    changes: Mapping[str, Any]
    """Changes of the scenario by key, without the name."""
    film: bool = False
    """True if its best gait is filmed, for README.md."""
    exported: bool = False
    """True if its best gait is exported for a prototype, into the folder EXPORTED."""
    engine: str = "compiled"

    def scenario(self, name: str) -> Scenario:
        """Scenario of the run of this name."""
        base = load_scenario(self.base).on_engine(self.engine)
        step = {} if "engine" in self.changes else _STEP
        return base.with_changes({"name": name} | step | dict(self.changes))


_STEP = {"engine.max_step": "3 ms"}
"""The longest step of recorded runs, also where damping is light."""


_SOUND = {"require": {"clearance": "0.125 in", "tension": 0.0}}
"""Requirements: struts do not touch, and cables need not push."""

_WELL_APART = {"require": {"clearance": "0.25 in", "tension": 0.0}}
"""Requirements: the distance of struts is at least two diameters, and cables need not push."""

_EFFORT = {"require": {"clearance": "0.125 in", "tension": 0.0, "mean_actuator_power": "80 mW"}}
"""Requirements of _SOUND, and a limit for the effort of a gait."""


def _by(optimizer: OptimizerKind, trials: int, evaluations: int) -> dict[str, Any]:
    """Changes of a scenario for an experiment with this optimiser."""
    sizes = {"evolution.trials": trials, "evolution.evaluations": evaluations}
    return {"optimizer": optimizer, **sizes}


_SLIPPING = {
    "friction.reset": "reversal",
    "cpg.signals": "listing",
    "engine.tolerance": "0.1 mm/s",
}
"""The reading of the thesis's friction by which nodes slip."""

_SHORT, _SETTLED = _by(CmaEs(), 3, 2000), _by(CmaEs(), 10, 2000)
_APART = {"require": {"clearance": "8 mm", "tension": 0.0}}
"""Requirements: struts do not touch, 8 mm being the thickest's diameter, and cables never push."""

_FORMER = {"robot.anchor_stiffness": "100 kN/m"}
"""A former default in the records of structures, which have no anchors."""

_STRUCTURE = _by(CmaEs(), 3, 1500) | {"simulation.duration": "15 s"} | _APART | _FORMER

_BODY = {
    "evolve": {
        "robot.cables.bottom.stiffness": ["50 N/m", "200 N/m"],
        "robot.cables.top.stiffness": ["50 N/m", "200 N/m"],
        "robot.cables.side.stiffness": ["50 N/m", "200 N/m"],
        "robot.cables.side.free_length": ["7 cm", "13 cm"],
        "robot.nodes.n3[2], robot.nodes.n4[2], robot.nodes.n5[2]": ["12 cm", "20 cm"],
    }
}
"""Numbers of a prism that evolve: cables, and the height of the upper nodes, which gives the
lengths of the struts."""

_MOTORS_MAP = QualityDiversity(
    measures={"travelling_index": [0.0, 1.0], "lifted": [0.2, 0.7]}, cells=[15, 15]
)

EXPERIMENTS = {
    "rolling": Experiment(
        "a rover of six struts rolls by a feedback policy, in 10 s",
        "rolling",
        {"simulation.steady_from": "2 s"} | _FORMER,
        film=True,
    ),
    "thesis": Experiment("the thesis's experiment, ten trials", "thesis", {}),
    "thesis-listing": Experiment(
        "the same as the thesis's code ran: the listing's signals, mutation and distance",
        "thesis-listing",
        {},
    ),
    "thesis-reversal": Experiment(
        "the same where nodes that break free slip until their velocity changes sign",
        "thesis-reversal",
        {},
    ),
    "thesis-drake": Experiment(
        "the same evolved on the Drake diagram itself, where nodes slip",
        "thesis-reversal",
        {"evolution.trials": 1, "evolution.evaluations": 250}
        | {"engine": "!Drake {scheme: radau3, max_step: 8 ms, look_ahead: 0.00002 s}"},
    ),
    "cma-es": Experiment(
        "the same by CMA-ES, where nodes slip", "thesis", _by(CmaEs(), 10, 4000) | _SLIPPING
    ),
    "coulomb": Experiment("the same under friction that grows with the load", "coulomb", {}),
    "incline": Experiment("up an incline of 5°", "incline", _SHORT),
    "steps": Experiment("up four steps of 0.25 in", "steps", _SHORT),
    "rough": Experiment(
        "over rough ground, ten trials", "rough", _SETTLED | _WELL_APART | {"cpg.signals": "live"}
    ),
    "rough-feedback": Experiment(
        "the same with feedback to the oscillators", "feedback", _SETTLED | _WELL_APART
    ),
    "undulation": Experiment(
        "an oscillator for each bottom cable, so that the robot can undulate, ten trials",
        "undulation",
        _SETTLED | _EFFORT,
    ),
    "undulation-four": Experiment(
        "the same with an oscillator for each pair of cables",
        "undulation",
        _SETTLED | _EFFORT | {"robot.actuation": [["outer bottom_left", "outer bottom_right"]]},
    ),
    "turning": Experiment("turning on the spot, in 30 s", "turning", _SHORT | _SOUND, film=True),
    "robust": Experiment(
        "far on eight disturbed robots, where nodes slip",
        "robust",
        _by(CmaEs(), 3, 1000) | _SLIPPING,
    ),
    "efficient": Experiment("with little work, where nodes slip", "efficient", _SHORT | _SLIPPING),
    "twelve": Experiment(
        "twelve tetrahedra",
        "coulomb",
        _by(CmaEs(), 2, 1000) | {"robot.tetrahedra": 12},
        film=True,
    ),
    "champion": Experiment(
        "a long search for the thesis's robot, where friction grows with the load",
        "coulomb",
        _by(CmaEs(population=16, sample=100, starts=12), 3, 16000),
        film=True,
    ),
    "map": Experiment(
        "gaits that differ, the fittest of each kind, where nodes slip",
        "thesis",
        _by(QualityDiversity(), 1, 30000) | _SLIPPING,
    ),
    "prism": Experiment("a prism of three struts", "prism", _STRUCTURE, film=True),
    "co-evolution": Experiment(
        "a prism whose body evolves with its gait, in 8 s, ten trials",
        "prism",
        _by(CmaEs(), 10, 600) | _APART | _BODY | _FORMER,
    ),
    "co-evolution-gait": Experiment(
        "the same prism as it is, its gait alone, in 8 s, ten trials",
        "prism",
        _by(CmaEs(), 10, 600) | _APART | _FORMER,
    ),
    "six-bar": Experiment("a six-bar tensegrity", "six_bar", _STRUCTURE, film=True),
    "mast": Experiment("a mast of four vertebrae, lying", "mast", _STRUCTURE, film=True),
    "pair": Experiment(
        "two nested tetrahedra, ten trials", "pair", _STRUCTURE | {"evolution.trials": 10}
    ),
    "winch": Experiment("stiff cables on winches", "winch", _by(CmaEs(), 3, 1500), exported=True),
    "motors": Experiment(
        "the thesis's robot carries motors",
        "motors",
        _by(CmaEs(), 3, 1500),
        film=True,
        exported=True,
    ),
    "motors-map": Experiment(
        "gaits of the robot with motors that differ, the fittest of each kind",
        "motors",
        _by(_MOTORS_MAP, 1, 12000),
    ),
}
"""Experiments by name of the folder, in the order of the gallery."""


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
    resume, progress = (made / MANIFEST).exists(), Progress(sys.stdout)
    if not resume:
        save_times(load_times(out) | {name: {}}, out)
    with timed(name, "evolution", out):
        # No reevaluation: analyse() simulates the best gaits on the diagram with tighter settings.
        evolve(scenario, made, resume=resume, reevaluate=False, report=False, progress=progress)
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
        with timed(name, "analysis", out):
            judge_elites(made)
            analyse(made, workers=available_cores())
    with timed(name, "pages", out):
        make_folder(made, shown, whole=whole)
        show(shown, viewer=out / VIEWER, film=experiment.film)
        if experiment.exported:
            run = load_run(made)
            export(run.scenario, run.best_gait(), rate=RATE, out=shown / EXPORTED)
    shutil.copy(analysis, shown / ANALYSIS)


def make_folder(made: Path, shown: Path, *, whole: bool = False) -> None:
    """Thins a run into the folder `shown`, in place of its old trials and exported files; or copies
    its record, if it is to be `whole`."""
    for old in (*shown.glob("trial_*"), *shown.glob(EXPORTED)):
        shutil.rmtree(old)
    thin(made, shown, whole=whole)


def load_times(out: Path) -> dict[str, Any]:
    """Times of the experiments recorded in the folder `out`: wall_s and cores_s (s) by name and
    stage."""
    file = out / TIMES
    times: dict[str, Any] = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
    return times


def save_times(times: Mapping[str, Any], out: Path) -> None:
    """Writes the times of the experiments recorded in the folder `out`."""
    write_whole(out / TIMES, json.dumps(times, indent=1) + "\n")


@contextlib.contextmanager
def timed(name: str, stage: str, out: Path) -> Iterator[None]:
    """Context manager that adds the times of the block to the times in `out`: wall time, and the
    time of all cores. Also after an interruption."""
    begin, work = time.monotonic(), sum(os.times()[:4])
    try:
        yield
    finally:
        times = load_times(out)
        spent = times.setdefault(name, {}).setdefault(stage, {"wall_s": 0.0, "cores_s": 0.0})
        spent["wall_s"] = round(spent["wall_s"] + time.monotonic() - begin, 1)
        spent["cores_s"] = round(spent["cores_s"] + sum(os.times()[:4]) - work, 1)
        save_times(times, out)
        print(f"{name}, {stage}: {duration(spent['wall_s'])}", flush=True)


def show(directory: Path, *, viewer: Path, film: bool) -> None:
    """Simulates a run's best gait on the compiled engine. Writes the page, the picture, the gait
    diagram and, if the experiment is filmed, the film."""
    run = load_run(directory)
    result = simulate(run.scenario.on_engine("compiled"), run.best_gait(), record=True)
    result.save_replay(directory / REPLAY, viewer=viewer)
    films = [directory / FILM] if film else []
    take_pictures(directory / REPLAY, *films, directory / PICTURE)
    save_figure(gait_diagram(result), directory, DIAGRAM, kinds=["svg"])


def take_pictures(page: Path, *pictures: Path) -> None:
    """Makes a picture of the end of a page's motion, or a film, in a browser. Raises
    CalledProcessError."""
    script = HERE.parent / "diagrams" / "animation.py"
    subprocess.run([sys.executable, script, page, *pictures], check=True)


def chosen(names: Sequence[str]) -> Sequence[str]:
    """The given names of experiments, or all. Raises InputError for an unknown name."""
    if unknown := {*names} - {*EXPERIMENTS}:
        problem = f"found {listed([*unknown])}, expected {listed([*EXPERIMENTS])}"
        raise InputError("NAME", "", problem)
    return names or [*EXPERIMENTS]


def main(arguments: Sequence[str]) -> None:
    """Records the experiments of the given names, or all. Raises InputError."""
    make = record_so_far if SO_FAR in arguments else record
    for name in chosen([argument for argument in arguments if argument != SO_FAR]):
        make(name, EXPERIMENTS[name], scratch=SCRATCH, out=HERE)


if __name__ == "__main__":
    try:
        main(sys.argv[1:])
    except InputError as error:
        sys.exit(f"record.py: {error}")
