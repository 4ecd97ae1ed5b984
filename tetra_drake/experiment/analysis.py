"""What the tables need beyond a run's record: simulated once, kept in the run's analysis.json."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tetra_drake.engines.compiled.engine import compile_engine
from tetra_drake.engines.simulate import simulate
from tetra_drake.errors import InputError
from tetra_drake.evolution.evaluation import GaitEvaluation
from tetra_drake.evolution.executors import EvaluationPool, process_executor, thread_executor
from tetra_drake.evolution.optimizers.base import Evaluate, Evaluation, Genome
from tetra_drake.evolution.population import genome_columns
from tetra_drake.evolution.reevaluation import best_gaits
from tetra_drake.evolution.tables import RunTables, load_run
from tetra_drake.experiment.variations import resimulations, variations
from tetra_drake.files import write_whole
from tetra_drake.parts.single_oscillator import TAU_A, frequency, oscillate
from tetra_drake.results.measures import shares_off_ground, signal_frequencies
from tetra_drake.results.result import versions
from tetra_drake.robot.gait import ParameterSpace
from tetra_drake.scenario.schema import Scenario

if TYPE_CHECKING:
    import pandas

SCHEMA = 1
ANALYSIS = "analysis.json"


@dataclass(frozen=True)
class BestGait:
    """The fittest gait of a trial."""

    trial: int
    evaluation: int
    """Its index in the trial."""
    genome: Genome


@dataclass(frozen=True)
class Analysis:
    """What analysis.json holds; lengths in inches, times in s."""

    versions: Mapping[str, str]
    """Of what simulated it."""
    oscillator_tau_a_s: float
    oscillator_frequency_hz: float
    """Of a single oscillator with that time constant."""
    best_gaits: pandas.DataFrame
    """A row a trial, as recorded by a simulation on the run's own engine: trial, evaluation,
    distance_in, off_ground (shares of the steady stretch by tetrahedron), frequencies_hz (by
    junction; None where a signal does not oscillate)."""
    resimulations: pandas.DataFrame
    """Those gaits on the Drake diagram: trial, setting, distance_in (NaN where it failed),
    failure."""
    variations: pandas.DataFrame
    """Those gaits with something changed, on the compiled engine: trial, what, percent,
    distance_in (NaN where it failed), failure."""


def best_of_trials(run: RunTables) -> list[BestGait]:
    """The fittest gait of each trial that has one, in the order of the trials."""
    rows = run.evaluations.set_index(["trial", "index"])
    columns = genome_columns(run.evaluations)
    return [
        BestGait(
            trial=best.trial,
            evaluation=best.index,
            genome=rows.loc[(best.trial, best.index), columns].to_numpy(dtype=np.float64),
        )
        for best in best_gaits(run, count=1)
    ]


def analyse(
    directory: Path,
    *,
    workers: int,
    make_executor: Callable[[int], Executor] = process_executor,
    announce: Callable[[str], None] = lambda message: None,
) -> None:
    """Simulates what Analysis holds for the run's best gaits and writes analysis.json.

    `make_executor` is for the Drake diagrams. `announce` is told what is being done. Raises
    InputError if `directory` holds no run or none of its gaits has a fitness yet,
    SimulationFailure if a best gait fails on the run's own scenario.
    """
    run = load_run(directory)
    scenario = run.manifest.scenario
    gaits = best_of_trials(run)
    if not gaits:
        raise InputError(directory, "", "no gait of this run has a fitness yet")
    compile_engine(scenario, announce)
    announce(f"recording the best gait of each of {len(gaits)} trials")
    walks = [_record_walk(scenario, gait) for gait in gaits]
    resimulated = []
    for name, changed in resimulations(scenario).items():
        announce(f"simulating them on the Drake diagram: {name}")
        resimulated += [
            {"trial": gait.trial, "setting": name, **_outcome(evaluation)}
            for gait, evaluation in _evaluate_all(
                GaitEvaluation(changed), gaits, workers=workers, make_executor=make_executor
            )
        ]
    announce("simulating them on the compiled engine with robot and surroundings changed")
    varied = [
        {
            "trial": gait.trial,
            "what": variation.what,
            "percent": variation.percent,
            **_outcome(evaluation),
        }
        for variation in variations(scenario)
        for gait, evaluation in _evaluate_all(
            variation.evaluate, gaits, workers=workers, make_executor=thread_executor
        )
    ]
    content = {
        "schema": SCHEMA,
        "versions": versions(),
        "oscillator": {"tau_a_s": TAU_A, "frequency_hz": _finite(frequency(oscillate(scenario)))},
        "best_gaits": walks,
        "resimulations": resimulated,
        "variations": varied,
    }
    text = json.dumps(content, indent=1, allow_nan=False, ensure_ascii=False)
    write_whole(directory / ANALYSIS, text + "\n")


def load_analysis(directory: Path) -> Analysis:
    """Reads analysis.json of a run; InputError if it is missing or damaged."""
    import pandas

    path = directory / ANALYSIS
    try:
        raw: Any = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        problem = f"no such file; `tetra-drake analyse {directory}` makes it"
        raise InputError(path, "", problem) from error
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(path, "", f"cannot be read: {error}") from error
    if not isinstance(raw, dict) or raw.get("schema") != SCHEMA:
        raise InputError(path, "schema", f"expected a JSON object of schema {SCHEMA}")
    frames = {}
    for key, columns in _COLUMNS.items():
        if not isinstance(raw.get(key), list):
            raise InputError(path, key, "is damaged: expected a list")
        frames[key] = pandas.DataFrame(raw[key])
        missing = [column for column in columns if column not in frames[key]]
        if missing:
            raise InputError(path, key, f"is damaged: {missing[0]} is missing")
        frames[key]["distance_in"] = frames[key]["distance_in"].astype(float)
    try:
        tau_a, hertz = (raw["oscillator"][key] for key in ("tau_a_s", "frequency_hz"))
        return Analysis(
            versions=dict(raw["versions"]),
            oscillator_tau_a_s=float(tau_a),
            oscillator_frequency_hz=math.nan if hertz is None else float(hertz),
            **frames,
        )
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(path, "", f"is damaged: {error}") from error


_COLUMNS = {
    "best_gaits": ("trial", "evaluation", "distance_in", "off_ground", "frequencies_hz"),
    "resimulations": ("trial", "setting", "distance_in", "failure"),
    "variations": ("trial", "what", "percent", "distance_in", "failure"),
}


def _record_walk(scenario: Scenario, gait: BestGait) -> dict[str, Any]:
    result = simulate(
        scenario=scenario,
        gait=ParameterSpace.of(scenario).gait(gait.genome, name="best gait"),
        record=True,
    )
    assert result.trajectory is not None
    since = scenario.simulation.steady_from
    frequencies = signal_frequencies(result.trajectory, since=since)
    return {
        "trial": gait.trial,
        "evaluation": gait.evaluation,
        "distance_in": result.metrics.distance_in,
        "off_ground": shares_off_ground(result.trajectory, since=since),
        "frequencies_hz": {name: _finite(value) for name, value in frequencies.items()},
    }


def _evaluate_all(
    evaluate: Evaluate,
    gaits: Sequence[BestGait],
    *,
    workers: int,
    make_executor: Callable[[int], Executor],
) -> list[tuple[BestGait, Evaluation]]:
    """The gaits with their evaluations, in their order."""
    pool = EvaluationPool[int](evaluate, workers=workers, make_executor=make_executor)
    evaluations: dict[int, Evaluation] = {}
    try:
        for number, gait in enumerate(gaits):
            pool.submit(number, gait.genome)
        while pool.busy:
            evaluations |= dict(pool.wait())
    finally:
        pool.close(at_once=len(evaluations) < len(gaits))
    return [(gait, evaluations[number]) for number, gait in enumerate(gaits)]


def _outcome(evaluation: Evaluation) -> dict[str, Any]:
    return {"distance_in": _finite(evaluation.distance_in), "failure": evaluation.failure}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
