"""The files of a record, what each of their lines holds, and the checks when they are read.

trial_00/
  evaluations.jsonl       one line per evaluation, in the order asked; metrics in SI
  iterations.jsonl        one line per iteration: best fitness, the optimiser's report
  in_progress.jsonl       during an iteration: those of its evaluations that are done
  best_gait.json          the fittest gait so far, a gait file
  reevaluations.jsonl     gaits evaluated once more on the Drake diagram
elites.jsonl              of a map: its gaits on disturbed robots
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from tetra_drake.errors import InputError
from tetra_drake.evolution.json_lines import REMEDY, read_lines
from tetra_drake.files import json_number
from tetra_drake.optimizers.base import Evaluation
from tetra_drake.robot.gait import Vector

EVALUATIONS, ITERATIONS = "evaluations.jsonl", "iterations.jsonl"
IN_PROGRESS, BEST_GAIT = "in_progress.jsonl", "best_gait.json"
REEVALUATIONS, ELITES = "reevaluations.jsonl", "elites.jsonl"


def trial_folder(directory: Path, number: int) -> Path:
    """The folder of a trial."""
    return directory / f"trial_{number:02d}"


def evaluation_entry(
    index: int, iteration: int, vector: Vector, evaluation: Evaluation
) -> dict[str, Any]:
    """An evaluation as a line of the record; the fitness of a failure is null."""
    entry = {
        "index": index,
        "iteration": iteration,
        "genome": vector.tolist(),
        "metrics": dict(evaluation.metrics),
        "fitness": json_number(evaluation.fitness),
        "failure": evaluation.failure,
        "wall_time_s": round(evaluation.wall_time, 4),
        "engine": evaluation.engine,
    }
    if evaluation.draws is not None:
        entry["draws"] = dict(evaluation.draws)
    return entry


def read_entries(path: Path, *, checksums: bool = False) -> list[dict[str, Any]]:
    """The lines of a file of a record; InputError, naming file and line, where one is damaged; with
    `checksums`, also where it lacks that."""
    checks = _CHECKS.get(path.name, _EVALUATION)
    counter = _COUNTERS.get(path.name)
    entries = read_lines(path, checksums=checksums)
    for row, entry in enumerate(entries):
        problem = _problem(entry, checks)
        if counter and not problem and entry[counter] != row:
            problem = f"{counter} is {entry[counter]}, expected {row}"
        if problem:
            raise InputError(path, f"line {row + 1}", f"is damaged: {problem}; {REMEDY}")
    return entries


Checks = dict[str, Callable[[Any], bool]]


def _problem(entry: dict[str, Any], checks: Checks) -> str:
    """What is wrong with the values of an entry; "" if nothing is."""
    for key, is_valid in checks.items():
        if key not in entry or not is_valid(entry[key]):
            return f"{key} is missing or invalid"
    for key, is_valid in _OPTIONAL.items():
        if key in entry and not is_valid(entry[key]):
            return f"{key} is invalid"
    return ""


def _is_count(value: Any) -> bool:
    return type(value) is int and 0 <= value < 2**63


def _is_number(value: Any) -> bool:
    return type(value) in (int, float) and abs(value) < 1e300


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


def _is_count_or_none(value: Any) -> bool:
    return value is None or _is_count(value)


def _is_number_or_none(value: Any) -> bool:
    return value is None or _is_number(value)


def _is_text_or_none(value: Any) -> bool:
    return value is None or _is_text(value)


def _are_numbers(value: Any) -> bool:
    return isinstance(value, list) and all(_is_number(item) for item in value)


def _is_genome(value: Any) -> bool:
    return value is None or _are_numbers(value)


def _are_metrics(value: Any) -> bool:
    return isinstance(value, dict) and all(_is_metric(*item) for item in value.items())


def _is_metric(name: str, value: Any) -> bool:
    if name == "lifted_shares":
        return _are_numbers(value)
    if name == "distance":
        return _is_number(value)
    return _is_number_or_none(value)


def _are_draws(value: Any) -> bool:
    if not isinstance(value, dict):
        return False
    fitnesses, distances = value.get("fitness"), value.get("distance")
    return bool(fitnesses and distances) and _are_numbers(fitnesses) and _are_numbers(distances)


_EVALUATION: Checks = {
    "index": _is_count,
    "iteration": _is_count,
    "genome": _is_genome,
    "metrics": _are_metrics,
    "fitness": _is_number_or_none,
    "failure": _is_text_or_none,
    "wall_time_s": _is_number,
    "engine": _is_text,
}
_ITERATION: Checks = {
    "iteration": _is_count,
    "evaluations": _is_count,
    "best_fitness": _is_number_or_none,
    "best_evaluation": _is_count_or_none,
    "stop": _is_text_or_none,
}
_ELITE: Checks = {
    "trial": _is_count,
    "index": _is_count,
    "kept": _is_number,
    "mean_distance": _is_number_or_none,
}
_OPTIONAL: Checks = {
    "draws": _are_draws,
    "placed": _is_count_or_none,
    "mean_fitness": _is_number_or_none,
}
"""What a line may have besides: draws where there are disturbances, the others by optimiser."""

_CHECKS = {ITERATIONS: _ITERATION, ELITES: _ELITE}
"""By file; the lines of the other files are evaluations."""
_COUNTERS = {EVALUATIONS: "index", ITERATIONS: "iteration"}
"""The key that counts the lines of a file."""
