"""A recorded run in a tenth of its size, for publishing.

    manifest.json, scenario.yaml    unchanged, but the first has `thinned`
    trial_00/best_gait.json, trial_00/best.yaml    unchanged
    trial_00/evaluations.jsonl.xz      unchanged for kept gaits; of others few digits of the
                                       metrics that select gaits, without genomes
    trial_00/iterations.jsonl.xz, trial_00/reevaluations.jsonl.xz (without genomes), elites.jsonl.xz

Kept gaits are: the best of each trial, gaits evaluated again on the diagram, gaits of a map, and of
trial 0 the initial population and each gait that was the best so far; with `initial` the initial
populations of all trials. The fitness of each gait that was the best so far keeps its digits.
"""

from __future__ import annotations

import decimal
import json
import lzma
from collections.abc import Container, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas

from tetra_drake.evolution.entries import (
    BEST_GAIT,
    BEST_SCENARIO,
    ELITES,
    EVALUATIONS,
    ITERATIONS,
    REEVALUATIONS,
    RecordFile,
    compressed,
    trial_folder,
)
from tetra_drake.evolution.manifest import MANIFEST
from tetra_drake.evolution.reevaluation import BEST_GAITS
from tetra_drake.evolution.run import Run, load_run
from tetra_drake.files import write_whole
from tetra_drake.lab.elites.elites import elites
from tetra_drake.scenario.load import SCENARIO
from tetra_drake.scenario.scenario import Scenario

_DIGITS, _WALL_TIME_DIGITS = 3, 2
"""Significant digits of the numbers of an evaluation without genome, and of all wall times."""

_DECIMALS = 9
"""Decimals of metrics in SI. Further digits are rounding errors, such as the drift of a symmetric
robot."""

_DOWN = decimal.Context(prec=6, rounding=decimal.ROUND_FLOOR)
"""Digits of the fitness of an evaluation without genome. With fewer, it could become a new best."""


def thin(source: Path, out: Path, *, initial: bool = False, whole: bool = False) -> None:
    """Writes a thinned copy of a run to the folder `out`; or with `whole` a compressed copy that
    lacks nothing of finished iterations, from which the run can go on. Raises InputError if a file
    cannot be read or written."""
    run = load_run(source)
    manifest = json.loads((source / MANIFEST).read_text(encoding="utf-8")) | {"thinned": not whole}
    matter = _that_matter(run, initial)
    rises, metrics = _keys(_rises(run.evaluations)), _that_choose(run.scenario)
    for trial in range(run.scenario.evolution.trials):
        iterations = _entries(run, ITERATIONS, trial)  # read first: a run may grow meanwhile
        thinned = []
        for entry in _entries(run, EVALUATIONS, trial):
            key = trial, entry["index"]
            kept = entry if whole or key in matter else _thinned(entry, metrics)
            exact = {"fitness": entry["fitness"]} if key in rises else {}
            wall_time = _rounded(entry["wall_time_s"], _WALL_TIME_DIGITS)
            thinned.append(kept | exact | {"wall_time_s": wall_time})
        again = [e | {"genome": None} for e in _entries(run, REEVALUATIONS, trial)]
        _write(run, out, EVALUATIONS, thinned, trial=trial)
        _write(run, out, ITERATIONS, iterations, trial=trial)
        _write(run, out, REEVALUATIONS, again, trial=trial)
        for name in (BEST_GAIT, BEST_SCENARIO):
            best = trial_folder(source, trial) / name
            if best.exists():
                text = best.read_text(encoding="utf-8")
                write_whole(trial_folder(out, trial) / name, text)
    _write(run, out, ELITES, _entries(run, ELITES))
    run.scenario.terrain.save(out)
    write_whole(out / SCENARIO, (source / SCENARIO).read_text(encoding="utf-8"))
    write_whole(out / MANIFEST, json.dumps(manifest, indent=1) + "\n")


def _entries(run: Run, name: str, trial: int | None = None) -> list[dict[str, Any]]:
    """The lines of a file of a run, as dictionaries."""
    return [line.content() for line in run.file(name, trial).read()]


def _rises(evaluations: pandas.DataFrame) -> pandas.DataFrame:
    """The evaluations of gaits that were the best of their trial so far."""
    best_so_far = evaluations.groupby("trial")["fitness"].cummax()
    return evaluations[evaluations["fitness"] == best_so_far]


def _keys(table: pandas.DataFrame) -> set[tuple[int, int]]:
    """Trial and index of evaluations."""
    return {(int(trial), int(index)) for trial, index in table[["trial", "index"]].to_numpy()}


def _that_matter(run: Run, initial: bool) -> set[tuple[int, int]]:
    """Trial and index of the kept gaits; their evaluations keep their genomes."""
    first = run.evaluations[run.evaluations["trial"] == 0]
    early = [_rises(first), run.initial() if initial else first[first["iteration"] == 0]]
    chosen = [*early, run.best(BEST_GAITS), run.reevaluations, elites(run)]
    return _keys(pandas.concat(chosen))


def _that_choose(scenario: Scenario) -> set[str]:
    """Metrics that select gaits of a run: objective, requirements, and measures of a map."""
    measures = getattr(scenario.optimizer, "measures", ())
    return {"distance", *scenario.objective, *scenario.require, *measures}


def _thinned(entry: Mapping[str, Any], metrics: Container[str]) -> dict[str, Any]:
    """Entry of a gait that is not kept, with few digits and only these metrics."""
    few = dict(entry) | {"genome": None}
    few["metrics"] = {name: value for name, value in few["metrics"].items() if name in metrics}
    few |= {key: _rounded(few[key], _DIGITS) for key in ("metrics", "draws") if key in few}
    if entry["fitness"] is not None:
        few["fitness"] = float(_DOWN.create_decimal_from_float(float(entry["fitness"])))
    return few


def _rounded(value: Any, digits: int) -> Any:
    """Rounds a number, or all numbers in lists and mappings."""

    def short(text: str) -> float:
        return float(f"{round(float(text), _DECIMALS) + 0.0:.{digits}g}")

    return json.loads(json.dumps(value), parse_float=short)


def _write(
    run: Run, out: Path, name: str, entries: Sequence[Mapping[str, Any]], trial: int | None = None
) -> None:
    """Writes lines of a run to the folder `out`, compressed. Writes no file without lines."""
    file = RecordFile.of(out, run.manifest.run, name, trial=trial)
    lines = [json.dumps({**file.owner, **entry}, allow_nan=False) for entry in entries]
    if lines:
        packed = lzma.compress("\n".join([*lines, ""]).encode(), preset=9 | lzma.PRESET_EXTREME)
        write_whole(compressed(file.path), packed)
