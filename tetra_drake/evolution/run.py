"""A recorded run as tables, and the gaits of a run or of a file for commands."""

from __future__ import annotations

import itertools
import logging
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.evolution.entries import (
    EVALUATIONS,
    IN_PROGRESS,
    ITERATIONS,
    LINES,
    REEVALUATIONS,
    REMEDY,
    SPREADS,
    EvaluationLine,
    RecordFile,
    WholeNumber,
)
from tetra_drake.evolution.manifest import MANIFEST, Manifest, read_manifest
from tetra_drake.evolution.trials import TrialStatus
from tetra_drake.files import given_path
from tetra_drake.formatting import Say, heading_html, silent
from tetra_drake.on_demand import loaded
from tetra_drake.results.result import headline
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.gait_file import load_gait
from tetra_drake.robot.parameter_space import ParameterSpace, Vector, with_body
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.metrics import METRICS, MetricRanges
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.settings.units import INCH

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True)
class Run:
    """A recorded run, finished or not, as tables. Metrics are in SI, times in s.

    The row of a gait is a row of `evaluations`.
    """

    directory: Path
    manifest: Manifest
    """Scenario, seed, versions, and the method: objective, optimiser."""
    evaluations: pandas.DataFrame
    """One row per evaluation. Columns:

    - trial, index, iteration, failure (reason or missing), wall_time_s, engine
    - fitness: NaN if the evaluation failed
    - placed: index in the population, missing if the vector was dropped; only for optimisers with a
      population
    - the metrics in SI (distance ...), distance_in (inches)
    - lifted_T1 ...: Metrics.lifted_shares, by the names of the bodies
    - the parameters by the names of ParameterSpace.names, such as "tau_A", in SI; NaN in a thinned
      run
    - with disturbances: draws_fitness and draws_distance (m), lists with one number per draw, and
      worst_distance (m). Lists are missing if the evaluation failed.
    """
    iterations: pandas.DataFrame
    """One row per iteration; iteration 0 is the initial one. Columns: trial, iteration, evaluations
    (so far), best_fitness (so far), best_evaluation (index of the fittest gait), best_distance
    (of that gait, in m), stop, and the optimiser's report, such as mean_fitness."""
    reevaluations: pandas.DataFrame
    """Gaits evaluated again on the Drake diagram. Columns as in `evaluations`, without `placed`."""

    def __str__(self) -> str:
        manifest, trials = self.manifest, self.statuses
        ended = sum(bool(trial.stop) for trial in trials)
        failures = sum(trial.failures for trial in trials)
        lines = [
            f"{self.directory}: {manifest.method}, seed {manifest.seed}",
            f"scenario {self.scenario.name}: {len(self.evaluations)} evaluations "
            f"({failures} failed), {ended} of {len(trials)} trials ended",
        ]
        if not self.best().empty:
            best = self.fittest()
            words = headline(self.scenario, best, self.spread_of(best))
            draws = (
                f", mean of {self.scenario.draw_count} draws" if self.scenario.disturbances else ""
            )
            lines.append(f"best gait: {gait_label(best)}, {words}{draws}")
        return "\n".join(lines)

    def __repr__(self) -> str:
        return f"<Run {self.directory}>"

    def _repr_html_(self) -> str:
        if self.best().empty:
            return heading_html(str(self))
        trials_table = loaded("tetra_drake.report.summary:trials_table")
        return heading_html(str(self)) + trials_table(self).html()

    @property
    def scenario(self) -> Scenario:
        """The scenario on which the run's gaits were evolved."""
        return self.manifest.scenario

    @cached_property
    def with_parameters(self) -> pandas.DataFrame:
        """The evaluations whose parameters are recorded: all, unless the run is thinned."""
        parameters = self.evaluations.filter(_parameters(self.scenario))
        return self.evaluations[parameters.notna().all(axis=1)]

    @cached_property
    def statuses(self) -> list[TrialStatus]:
        """The state of each trial."""
        statuses = []
        for trial in range(self.scenario.evolution.trials):
            rows = self.evaluations[self.evaluations["trial"] == trial]
            status = TrialStatus(
                trial,
                self.scenario.evolution.evaluations,
                units=self.scenario.units,
                evaluations=len(rows),
                failures=int(rows["failure"].notna().sum()),
                wall_time=float(rows["wall_time_s"].sum()),
            )
            lines = self.iterations[self.iterations["trial"] == trial]
            for last in lines.tail(1).to_dict("records"):
                status.iteration, status.best_distance = last["iteration"], last["best_distance"]
                status.stop = last["stop"] if isinstance(last["stop"], str) else None
                if not math.isnan(last["best_fitness"]):
                    status.best_fitness = last["best_fitness"]
            statuses.append(status)
        return statuses

    def best(self, count: int = 1) -> pandas.DataFrame:
        """Rows of `evaluations`: the `count` fittest gaits of each trial, without repeated gaits.

        Rows are sorted by trial, then from best to worst. The first row is the best gait of trial
        0. For the best gait of the run, see fittest().
        """
        walked = self.with_parameters.dropna(subset="fitness")
        ranked = walked.sort_values(["trial", "fitness", "index"], ascending=[True, False, True])
        different = ranked.drop_duplicates(["trial", *_parameters(self.scenario)])
        return different.groupby("trial").head(count)

    def fittest(self) -> pandas.Series:
        """The row of the run's fittest gait. Raises InputError if no gait has a fitness yet."""
        best = self.best()
        if best.empty:
            raise InputError(self.directory, "", "no gait of this run has a fitness yet")
        return best.loc[best["fitness"].idxmax()]

    def spread_of(self, gait: pandas.Series) -> MetricRanges:
        """Recorded ranges of the metrics of a gait, a row of `evaluations`, for moved starts; see
        lab.spread. Empty if there are none."""
        for line in self.file(SPREADS).read():
            if (line.trial, line.index) == (gait["trial"], gait["index"]):
                return dict(line.spread)
        return {}

    def initial_best(self, trial: int) -> pandas.Series:
        """Row of the fittest gait in the first iteration of a trial. If all gaits of an iteration
        failed, the next one counts in its place."""
        rows = self.evaluations.query("trial == @trial").dropna(subset="fitness")
        first = rows[rows["iteration"] == rows["iteration"].min()]
        return first.loc[first["fitness"].idxmax()]

    def best_gait(self) -> Gait:
        """The fittest gait of all trials. Raises InputError if no gait has a fitness yet."""
        best = self.fittest()
        return self.gait(best["trial"], best["index"])

    def best_scenario(self) -> Scenario:
        """The run's scenario with the body of its best gait, if bodies evolved. Raises InputError
        if no gait has a fitness yet."""
        return with_body(self.scenario, self.best_gait())[0]

    def gaits(self, count: int = 1) -> list[Gait]:
        """The `count` fittest different gaits of each trial, in the order of best(). The name of
        each gait contains its trial and evaluation."""
        best = self.best(count)
        return [self.gait(*key) for key in zip(best["trial"], best["index"], strict=True)]

    def file(self, name: str, trial: int | None = None) -> RecordFile:
        """The file `name` of the run's record, such as "elites.jsonl". With `trial`, the file is in
        the folder of this trial."""
        return RecordFile.of(self.directory, self.manifest.run, name, trial=trial)

    def initial(self) -> pandas.DataFrame:
        """The evaluations of iteration 0."""
        return self.evaluations[self.evaluations["iteration"] == 0]

    def vector(self, trial: int, index: int) -> Vector:
        """The parameter vector of evaluation `index` of a trial. Raises InputError if thinning
        removed it."""
        rows = self.with_parameters.set_index(["trial", "index"])
        if (trial, index) not in rows.index:
            problem = f"has no genome of trial {trial}, evaluation {index}"
            raise InputError(self.directory, "", problem)
        return rows.loc[(trial, index), _parameters(self.scenario)].to_numpy(dtype=np.float64)

    def gait(self, trial: int, index: int) -> Gait:
        """The gait of evaluation `index` of a trial."""
        return self.manifest.gait(self.vector(trial, index), trial=trial, index=index)


def gait_label(row: pandas.Series) -> str:
    """Name of an evaluation (a row of `Run.evaluations`), such as "trial 0, evaluation 12"."""
    return f"trial {row['trial']}, evaluation {row['index']}"


def load_run(path: str | Path) -> Run:
    """Loads a run directory, finished or not, as pandas tables. `evaluations` includes an
    iteration under way.

        >>> run = td.load_run("runs/demo")
        >>> result = td.simulate(run.scenario, run.best_gait())
        >>> lines = run.iterations.pivot(index="iteration", columns="trial", values="best_fitness")

    Args:
        path: the run directory.

    Raises:
        InputError: if the directory holds no run, or the record is damaged.
    """
    directory = given_path(path, "load_run", "path")
    manifest = read_manifest(directory)
    # A running process writes iterations last. They are read first, so no evaluation is missing.
    iterations = _table(directory, manifest, ITERATIONS)
    evaluations = _table(directory, manifest, EVALUATIONS, IN_PROGRESS)
    reevaluations = _table(directory, manifest, REEVALUATIONS)
    if not iterations.empty:
        for trial, lines in iterations.groupby("trial"):
            file = RecordFile.of(directory, manifest.run, ITERATIONS, trial=int(trial))
            _check_iterations(file, lines, evaluations[evaluations["trial"] == trial])
        distances = evaluations.set_index(["trial", "index"])["distance"].to_dict()
        best = zip(iterations["trial"], iterations["best_evaluation"], strict=True)
        iterations["best_distance"] = [distances.get(key, math.nan) for key in best]
    return Run(directory, manifest, evaluations, iterations, reevaluations)


def _table(directory: Path, manifest: Manifest, *names: str) -> pandas.DataFrame:
    """Table of the lines in the files `names` of all trials, one row per line; what one of them has
    is not read from the next. For its columns, see Run."""
    import pandas

    kind, parameters = LINES[names[0]], _parameters(manifest.scenario)
    blueprint = manifest.scenario.robot.blueprint()
    rows: list[dict[str, Any]] = []
    for trial, name in itertools.product(range(manifest.scenario.evolution.trials), names):
        file = RecordFile.of(directory, manifest.run, name, trial=trial)
        known = {row["index"] for row in rows if row["trial"] == trial} if name != names[0] else ()
        for number, line in enumerate(file.read()):
            row = {"trial": trial, **line.content()}
            if row.get("index") in known:
                continue
            rows.append(row)
            if kind is not EvaluationLine:
                continue
            genome = row.pop("genome") or [math.nan] * len(parameters)
            if len(genome) != len(parameters):
                found = f"a genome of {len(genome)} numbers"
                file.refuse(number, f"is damaged: found {found}, expected {len(parameters)}")
            row |= dict.fromkeys(METRICS, math.nan) | row.pop("metrics")
            for body, share in zip(blueprint.bodies, row.pop("lifted_shares", []), strict=False):
                row[f"lifted_{body}"] = share
            row["distance_in"] = row["distance"] / INCH
            if draws := row.pop("draws", None):
                row |= {f"draws_{key}": numbers for key, numbers in draws.items()}
                row["worst_distance"] = min(draws["distance"])
            row |= dict(zip(parameters, genome, strict=True))

    columns = None if rows else ["trial", *kind.model_fields, *METRICS, "distance_in"]
    table = pandas.DataFrame(rows, columns=columns)
    # What may be missing would otherwise decide the type of its column.
    types = dict.fromkeys((*METRICS, "distance_in"), "float")
    for key, field in kind.model_fields.items():
        if field.annotation in (float | None, WholeNumber | None):
            types[key] = "float" if field.annotation == float | None else "Int64"
    types = {column: type_ for column, type_ in types.items() if column in table}
    table = table.astype(types).copy()  # copy() joins the blocks that astype() makes per column
    if kind is EvaluationLine:  # earlier versions did not record it
        relative_speed = table["speed"] / blueprint.length
        table["relative_speed"] = table["relative_speed"].fillna(relative_speed)
    return table


def _parameters(scenario: Scenario) -> list[str]:
    """Names of the columns of Run.evaluations that hold the parameters of a gait, such as "tau_A",
    in the order of the parameter vector."""
    taken = {*EvaluationLine.model_fields, *METRICS}
    names = ParameterSpace.of(scenario).names
    return [f"parameter {name}" if name in taken else name for name in names]


def _check_iterations(
    file: RecordFile, iterations: pandas.DataFrame, evaluations: pandas.DataFrame
) -> None:
    """Raises InputError, naming file and line, if a line of a trial's `iterations` disagrees with
    its `evaluations` about the number of evaluations so far, or the best fitness or gait."""
    made = np.searchsorted(evaluations["iteration"], iterations["iteration"], side="right")
    fitnesses = evaluations["fitness"].fillna(-math.inf).to_numpy()
    recorded = iterations.fillna({"best_fitness": -math.inf, "best_evaluation": -1})
    for row, line in enumerate(recorded.to_dict("records")):
        so_far = fitnesses[: made[row]]
        best = so_far.max(initial=-math.inf)
        fittest = int(so_far.argmax()) if best > -math.inf else -1
        found = {"evaluations": len(so_far), "best_fitness": best, "best_evaluation": fittest}
        for key, value in found.items():
            if line[key] != value:
                problem = f"is damaged: {key} is {line[key]}, {EVALUATIONS} has {value}"
                file.refuse(row, f"{problem}; {REMEDY}")


_LOG = logging.getLogger("tetra_drake")


@dataclass(frozen=True)
class GaitSource:
    """Gaits of a file or a run, and the scenario to simulate them on."""

    scenario: Scenario
    best: Gait
    """The gait of the file, or the best gait of the run."""
    gaits: dict[str, Gait]
    """The gait of the file by its name, or the best gait of each trial by "trial 0" ..."""
    spread: MetricRanges
    """Recorded ranges of the metrics of a run's best gait; see Run.spread_of()."""


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
    folders = (source, *source.absolute().parents[:2])  # run/trial_00/best_gait.json
    folder = next((each for each in folders if os.path.isfile(each / MANIFEST)), None)
    if scenario is not None or folder is None:
        chosen = load_scenario(scenario or "thesis")
    else:
        chosen = read_manifest(folder).scenario
        tell_code(chosen, folder)
    if os.path.isdir(source):
        run = load_run(source)
        best, trials, spread = run.best_gait(), run.best()["trial"], run.spread_of(run.fittest())
        gaits = {f"trial {trial}": gait for trial, gait in zip(trials, run.gaits(), strict=True)}
    else:
        best, spread = load_gait(source, chosen), {}
        gaits = {source.stem: best}
    if best.scenario not in ("", chosen.name):
        made = f"made for scenario {best.scenario}"
        warn(f"{source}: {made}, simulated on scenario {chosen.name}")
    return GaitSource(chosen, best, gaits, spread)


def tell_code(scenario: Scenario, folder: Path) -> None:
    """Tells in the log which code a simulation of a recorded scenario runs."""
    if scenario.policy is not None and scenario.policy.code:
        _LOG.warning("%s: its policy runs the Python function %s", folder, scenario.policy.code)


def distinct_gaits(named: Mapping[str, pandas.Series]) -> list[tuple[list[str], pandas.Series]]:
    """Gaits without repetitions: a list of pairs, the names of a gait and its row of
    Run.evaluations. `named` has such a row by name; a gait may have several names."""
    names: dict[Any, list[str]] = {}
    for name, gait in named.items():
        names.setdefault((gait["trial"], gait["index"]), []).append(name)
    return [(alike, named[alike[0]]) for alike in names.values()]
