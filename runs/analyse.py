"""Simulates the best gaits of recorded runs under other conditions.

    python runs/analyse.py runs/thesis [RUN ...]

Writes analysis.json to each run's folder, for tables.py.
"""

from __future__ import annotations

import contextlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
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

SPEED = "relative_speed"
"""Metric of the best gaits that is shown in the gallery: body lengths per second."""

DRAWN = ("5 %", "95 %")
"""Quantiles of a gait's distances in draws of disturbances that pages show."""


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

    def again(self, trial: int, setting: str, what: str = "distance_in") -> float:
        """Distance (in) or TURNED of a trial's fittest gait with a setting; NaN if it was not
        simulated."""
        table = self.resimulations
        found = table[what].to_numpy()[(table["trial"] == trial) & (table["setting"] == setting)]
        return float(found[0]) if len(found) else math.nan

    def undisturbed(self, trial: int) -> float:
        """Distance (in) of a trial's fittest gait on the compiled engine."""
        return float(self.disturbed.loc[trial, "undisturbed"]) / INCH


def load_analysis(directory: Path) -> Analysis:
    """Reads analysis.json of a run. Raises InputError if it is missing or damaged."""
    return read_record(directory / ANALYSIS, analysis_of, f"analyse.py {directory}")


def analysis_of(content: Mapping[str, Any]) -> Analysis:
    """Analysis of the content of analysis.json."""
    if content["schema"] != SCHEMA:
        raise ValueError(f"schema {content['schema']}, expected {SCHEMA}")
    names = [field.name for field in fields(Analysis)]
    tables = (pandas.DataFrame(content[name]).fillna(math.nan) for name in names)  # for null
    best, again, unseen, disturbed = tables
    return Analysis(best.set_index("trial"), again, unseen, disturbed.set_index("gait"))


def analyse(directory: Path, *, workers: int) -> None:
    """Analyses a run's best gaits (see Analysis) and writes analysis.json."""
    run = load_run(directory)
    scenario = run.scenario
    run.fittest()  # InputError if there is none
    best = best_gaits(run)
    gaits = {row["trial"]: run.gait(row["trial"], row["evaluation"]) for row in best}
    for row, change in zip(best, sensitivity(scenario, [*gaits.values()], workers), strict=True):
        row["sensitivity_in"] = json_number(change)
    judgement = robustness(scenario, gaits, percent=PERCENT, alone=False, workers=workers)
    content = {
        "schema": SCHEMA,
        "versions": versions(),
        "best_gaits": best,
        "resimulations": resimulate(scenario, gaits, workers),
        "unseen": on_unseen_ground(scenario, gaits, workers),
        "disturbed": json_rows(by_gait(judgement)),
    }
    text = json.dumps(content, indent=1, allow_nan=False, ensure_ascii=False)
    write_whole(directory / ANALYSIS, text + "\n")


def best_gaits(run: Run) -> list[dict[str, Any]]:
    """Table of the fittest gait of each trial; see Analysis."""
    best = run.best().rename(columns={"index": "evaluation"})
    made = {status.number: status.evaluations for status in run.statuses}
    best = best.assign(evaluations=best["trial"].map(made)).set_index("trial")
    names = ["evaluation", "evaluations", "fitness", *SHOWN, SPEED, *_turned(run.scenario)]
    return json_rows(best[names])


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
    walks = outcomes([disturbed(compiled, start) for start in starts], gaits, workers)
    undisplaced, *displaced = np.array(
        [[measured(each, "distance_in") for each in of_gait] for of_gait in walks]
    ).T
    largest: list[float] = np.abs(displaced - undisplaced).max(axis=0).tolist()
    return largest


def outcomes(
    scenarios: Sequence[Scenario], gaits: Sequence[Gait], workers: int
) -> list[list[Outcome]]:
    """Results, or failures, of each gait on all scenarios."""
    every = [gait for gait in gaits for _ in scenarios]
    found = simulate_many([*scenarios] * len(gaits), every, workers=workers)
    return [found[i : i + len(scenarios)] for i in range(0, len(found), len(scenarios))]


def resimulate(scenario: Scenario, gaits: Mapping[int, Gait], workers: int) -> list[dict[str, Any]]:
    """Table of the gaits with every setting; see Analysis."""
    rows = []
    for name, changed in settings_of(scenario).items():
        walks = outcomes([changed], [*gaits.values()], workers)
        for trial, (walk,) in zip(gaits, walks, strict=True):
            row: dict[str, Any] = {"trial": trial, "setting": name}
            for metric in ("distance_in", *_turned(scenario)):
                row[metric] = json_number(measured(walk, metric))
            failure = None if isinstance(walk, SimulationResult) else str(walk)
            rows.append(row | {"failure": failure})
    return rows


def on_unseen_ground(
    scenario: Scenario, gaits: Mapping[int, Gait], workers: int
) -> list[dict[str, Any]]:
    """Table of the gaits on random ground with UNSEEN seeds; see Analysis. Empty if the scenario's
    ground is not random."""
    if not isinstance(scenario.terrain, Rough):
        return []
    rows: list[dict[str, Any]] = []
    scenarios = [scenario.with_changes({"terrain.seed": seed}) for seed in UNSEEN]
    for trial, walks in zip(gaits, outcomes(scenarios, [*gaits.values()], workers), strict=True):
        for seed, walk in zip(UNSEEN, walks, strict=True):
            is_met = isinstance(walk, SimulationResult) and not unmet_requirements(
                walk.metrics, scenario.require
            )
            inches = json_number(measured(walk, "distance_in"))
            rows.append({"trial": trial, "seed": seed, "distance_in": inches, "met": is_met})
    return rows


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
