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

from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

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
    kind = _KINDS.get(path.name, _Evaluation)
    counter = _COUNTERS.get(path.name)
    entries = read_lines(path, checksums=checksums)
    for row, entry in enumerate(entries):
        problem = _problem(entry, kind)
        if counter and not problem and entry[counter] != row:
            problem = f"{counter} is {entry[counter]}, expected {row}"
        if problem:
            raise InputError(path, f"line {row + 1}", f"is damaged: {problem}; {REMEDY}")
    return entries


def _problem(entry: dict[str, Any], kind: type[_Line]) -> str:
    """Problem with the values of an entry; "" if there is none."""
    try:
        kind.model_validate(entry)
    except ValidationError as error:
        return f"{error.errors()[0]['loc'][0]} is missing or invalid"
    return ""


Count = Annotated[int, Field(ge=0, lt=2**63)]
Number = Annotated[float, Field(gt=-1e300, lt=1e300)]
Numbers = Annotated[list[Number], Field(min_length=1)]


class _Line(BaseModel):
    """Keys that a line must have, and kinds of values of those that it may have."""

    model_config = ConfigDict(strict=True, extra="allow")


class _Metrics(_Line):
    __pydantic_extra__: dict[str, Number | None]
    distance: Number = 0.0
    lifted_shares: list[Number] = []


class _Draws(_Line):
    fitness: Numbers
    distance: Numbers


class _Evaluation(_Line):
    index: Count
    iteration: Count
    genome: list[Number] | None
    metrics: _Metrics
    fitness: Number | None
    failure: str | None
    wall_time_s: Number
    engine: str
    draws: _Draws | None = None
    placed: Count | None = None


class _Iteration(_Line):
    iteration: Count
    evaluations: Count
    best_fitness: Number | None
    best_evaluation: Count | None
    stop: str | None
    mean_fitness: Number | None = None


class _Elite(_Line):
    trial: Count
    index: Count
    kept: Number
    mean_distance: Number | None


_KINDS: dict[str, type[_Line]] = {ITERATIONS: _Iteration, ELITES: _Elite}
"""Models of lines by file; the lines of other files are evaluations."""
_COUNTERS = {EVALUATIONS: "index", ITERATIONS: "iteration"}
"""The key that counts the lines of a file."""
