"""Simulates the best gaits of recorded runs under other conditions.

    python runs/analyse.py runs/thesis [RUN ...]

Writes analysis.json to each run's folder, for tables.py.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas
from script import measured, read_record, script

from tetra_drake.engines.simulate import Outcome, check_scenario, simulate_many
from tetra_drake.errors import InputError
from tetra_drake.evolution.run import Run, load_run
from tetra_drake.files import json_number, write_whole
from tetra_drake.lab.study.robustness import PERCENT, by_gait, robustness
from tetra_drake.lab.study.statistics import json_rows
from tetra_drake.laws.friction import Coulomb
from tetra_drake.laws.terrain import Rough
from tetra_drake.machine import available_cores, versions
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.gait import Gait
from tetra_drake.scenario.disturbances import Draw, disturbed
from tetra_drake.scenario.engine_kinds import Drake
from tetra_drake.scenario.metrics import looks_for_turns, unmet_requirements
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.settings.units import INCH

SCHEMA = 6
ANALYSIS = "analysis.json"

TIGHT, MUJOCO = "runge_kutta3, witness", "MuJoCo"
"""Settings with other engines: the Drake diagram in steps of about 0.15 ms, with mode changes
localised by witness functions; and MuJoCo, with a coefficient of friction of 0.5 in place of the
reset integrator."""

UNSEEN = range(1001, 1021)
"""Seeds of random ground that were not used in evolution."""

WAYS, DISPLACEMENT = 30, 1e-9
"""Number of displaced starts of a gait, and displacement (m) of each body."""

ROUNDINGS = 3.0
"""Tolerance of a distance, in multiples of the gait's own sensitivity: the largest change of the
distance in thirty starts that are displaced by 1 nm.

Processors, versions of packages and changes of the code round differently, in the sixteenth digit;
1 nm is in the eighth digit of a position. Some gaits enlarge both by the same factor: the change
by rounding is then a ten-millionth of the sensitivity. In the others, the lengths of steps soon
have nothing in common, and the distance differs by the integration error, the same for 1 nm and
for rounding. Rounding is then a draw like those thirty. Of sixty draws for each of the 120 gaits,
one in two thousand exceeds three times the largest of thirty others.
"""

TURNED = "heading_change"
"""Metric that is also recorded if the objective is about turning."""

SHOWN = ("cost_of_transport", "tension", "clearance")
"""Metrics of the best gaits that are shown on pages."""

ENGINES = ("compiled", "diagram", "MuJoCo")
"""Engines that pages compare."""

SPEED = "relative_speed"
"""Metric of the best gaits that is shown in the gallery: body lengths per second."""

DRAWN = ("5 %", "95 %")
"""Quantiles of a gait's distances in draws of disturbances that pages show."""

_FOUND = ("trial", "evaluation", "evaluations", "fitness")
_MEAN, _KEPT = ("mean", "mean_low", "mean_high"), ("kept", "kept_low", "kept_high")
_COLUMNS = {
    "best_gaits": [*_FOUND, *SHOWN, SPEED, "sensitivity_in", TURNED],
    "resimulations": ["trial", "setting", "distance_in", TURNED],
    "unseen": ["trial", "seed", "distance_in", "met"],
    "disturbed": ["gait", "undisturbed", *DRAWN, *_MEAN, *_KEPT, "failed", "missed"],
}
"""Columns of the tables of an Analysis in the record, which must have them, but for TURNED."""


@dataclass(frozen=True)
class Analysis:
    """Analysis of a run's best gaits: the content of analysis.json."""

    best_gaits: pandas.DataFrame
    """The fittest gait of each trial. Index: trial. Columns: evaluation, evaluations (of the whole
    trial), fitness, the metrics SHOWN and SPEED in SI units, sensitivity_in (see sensitivity()),
    and TURNED (rad; NaN if the objective is not about turning)."""
    resimulations: pandas.DataFrame
    """Fittest gaits with other engines and laws of friction. Columns: trial, setting, distance_in
    (NaN if the simulation failed), and TURNED as in best_gaits."""
    unseen: pandas.DataFrame
    """Fittest gaits on random ground with UNSEEN seeds, if the scenario has random ground. Columns:
    trial, seed, distance_in (NaN if the simulation failed), met (True if the scenario's
    requirements are met)."""
    disturbed: pandas.DataFrame
    """Fittest gaits in draws of the default disturbances, on the compiled engine; see
    robustness.by_gait(). Lengths are in m. Index: trial."""

    @property
    def best_trial(self) -> int:
        """The trial with the fittest gait."""
        return int(self.best_gaits["fitness"].idxmax())

    @property
    def distances(self) -> pandas.DataFrame:
        """Distances (in) of the fittest gaits; NaN if not simulated. Index: trial. Columns:
        ENGINES."""
        return self._on_engines("distance_in", self.disturbed["undisturbed"] / INCH)

    @property
    def turns(self) -> pandas.DataFrame:
        """TURNED (rad) of the fittest gaits; as `distances`."""
        return self._on_engines(TURNED, self.best_gaits[TURNED])

    def _on_engines(self, what: str, compiled: pandas.Series) -> pandas.DataFrame:
        others = self.resimulations.pivot(index="trial", columns="setting", values=what)
        table = others.reindex(columns=[TIGHT, MUJOCO])
        table.insert(0, "compiled", compiled)
        return table.set_axis(ENGINES, axis="columns")


def load_analysis(directory: Path) -> Analysis:
    """Reads analysis.json of a run. Raises InputError if it is missing or damaged."""
    return read_record(directory / ANALYSIS, analysis_of, f"analyse.py {directory}")


def analysis_of(content: Mapping[str, Any]) -> Analysis:
    """Analysis of the content of analysis.json."""
    if content["schema"] != SCHEMA:
        raise ValueError(f"schema {content['schema']}, expected {SCHEMA}")
    tables = []
    for name, columns in _COLUMNS.items():
        given = ({TURNED: None} | row for row in content[name])
        rows = [[row[column] for column in columns] for row in given]
        table = pandas.DataFrame(rows, columns=columns)
        tables.append(table.fillna(math.nan).infer_objects())  # for null
    best, again, unseen, disturbed = tables
    return Analysis(best.set_index("trial"), again, unseen, disturbed.set_index("gait"))


def analyse(directory: Path, *, workers: int) -> None:
    """Analyses a run's best gaits (see Analysis) and writes analysis.json."""
    run = load_run(directory)
    scenario = run.scenario
    run.fittest()  # InputError if there is none
    best = best_gaits(run)
    gaits = {trial: run.gait(trial, number) for trial, number in best["evaluation"].items()}
    best["sensitivity_in"] = sensitivity(scenario, [*gaits.values()], workers)
    judgement = robustness(scenario, gaits, percent=PERCENT, alone=False, workers=workers)
    content = {
        "schema": SCHEMA,
        "versions": versions(),
        "best_gaits": json_rows(best),
        "resimulations": resimulate(scenario, gaits, workers),
        "unseen": on_unseen_ground(scenario, gaits, workers),
        "disturbed": json_rows(by_gait(judgement)),
    }
    text = json.dumps(content, indent=1, allow_nan=False, ensure_ascii=False)
    write_whole(directory / ANALYSIS, text + "\n")


def best_gaits(run: Run) -> pandas.DataFrame:
    """Table of the fittest gait of each trial, without sensitivity; see Analysis."""
    names = ["index", "fitness", *SHOWN, SPEED, *_turned(run.scenario)]
    best = run.best().set_index("trial")[names].rename(columns={"index": "evaluation"})
    best.insert(1, "evaluations", run.evaluations.groupby("trial").size())
    return best


def _turned(scenario: Scenario) -> list[str]:
    """TURNED if the objective is about turning."""
    return [TURNED] if looks_for_turns(scenario.objective) else []


def sensitivity(scenario: Scenario, gaits: Sequence[Gait], workers: int) -> list[float]:
    """Sensitivity of each gait to its start: the largest change (in) of its distance on the
    compiled engine. Every body starts displaced by DISPLACEMENT, in WAYS random directions. NaN if
    a simulation fails."""
    generator = np.random.default_rng(0)
    directions = generator.normal(size=(WAYS, scenario.robot.body_count, 3))
    directions /= np.linalg.norm(directions, axis=2, keepdims=True)
    directions[:, :, 2] = np.abs(directions[:, :, 2])  # not into the ground
    starts = [Draw({}), *(Draw({}, moves=DISPLACEMENT * each) for each in directions)]
    compiled = scenario.on_engine("compiled")
    moved = {number: disturbed(compiled, start) for number, start in enumerate(starts)}
    found = walks(moved, dict(enumerate(gaits)), workers)
    inches = np.reshape([measured(walk, "distance_in") for *_, walk in found], (-1, len(gaits)))
    largest: list[float] = np.abs(inches[1:] - inches[0]).max(axis=0).tolist()
    return largest


def walks(
    scenarios: Mapping[Any, Scenario], gaits: Mapping[int, Gait], workers: int
) -> list[tuple[Any, int, Outcome]]:
    """Results, or failures, of all gaits on each scenario, with the keys of scenario and gait."""
    pairs = [*itertools.product(scenarios, gaits)]
    on, by = [scenarios[key] for key, _ in pairs], [gaits[trial] for _, trial in pairs]
    found = simulate_many(on, by, workers=workers)
    return [(*pair, walk) for pair, walk in zip(pairs, found, strict=True)]


def resimulate(scenario: Scenario, gaits: Mapping[int, Gait], workers: int) -> list[dict[str, Any]]:
    """Table of the gaits with every setting; see Analysis."""
    rows = []
    names = ["distance_in", *_turned(scenario)]
    for setting, trial, walk in walks(settings_of(scenario), gaits, workers):
        metrics = {name: json_number(measured(walk, name)) for name in names}
        failure = None if isinstance(walk, SimulationResult) else str(walk)
        rows.append({"trial": trial, "setting": setting} | metrics | {"failure": failure})
    return rows


def on_unseen_ground(
    scenario: Scenario, gaits: Mapping[int, Gait], workers: int
) -> list[dict[str, Any]]:
    """Table of the gaits on random ground with UNSEEN seeds; see Analysis. Empty if the scenario's
    ground is not random."""
    if not isinstance(scenario.terrain, Rough):
        return []
    rows: list[dict[str, Any]] = []
    scenarios = {seed: scenario.with_changes({"terrain.seed": seed}) for seed in UNSEEN}
    for seed, trial, walk in walks(scenarios, gaits, workers):
        is_met = isinstance(walk, SimulationResult) and not unmet_requirements(
            walk.metrics, scenario.require
        )
        inches = json_number(measured(walk, "distance_in"))
        rows.append({"trial": trial, "seed": seed, "distance_in": inches, "met": is_met})
    return sorted(rows, key=lambda row: row["trial"])


def settings_of(scenario: Scenario) -> dict[str, Scenario]:
    """The scenario with each setting, by name. Settings that cannot simulate it are left out."""
    tight = Drake(scheme="runge_kutta3", accuracy=1e-3, max_step=0.002, mode_changes="witness")
    changes: dict[str, dict[str, Any]] = {TIGHT: {"engine": tight}, MUJOCO: {"engine": "!Mujoco"}}
    if isinstance(scenario.friction, Coulomb):
        changes[MUJOCO]["friction.stiffness"] = "0 N/m"  # MuJoCo has no bristles
    settings = {}
    for name, change in changes.items():
        with contextlib.suppress(InputError):
            changed = scenario.with_changes(change)
            check_scenario(changed)
            settings[name] = changed
    return settings


@script
def main(arguments: Sequence[str]) -> None:
    """Analyses the runs of the given folders."""
    for directory in map(Path, arguments):
        analyse(directory, workers=available_cores())
