"""The files of a record, and what their lines hold.

trial_00/
  evaluations.jsonl       one line per evaluation, in the order asked; metrics in SI
  iterations.jsonl        one line per iteration: best fitness, the optimiser's report
  in_progress.jsonl       during an iteration: those of its evaluations that are done
  best_gait.json          the fittest gait so far, a gait file
  reevaluations.jsonl     gaits evaluated once more on the Drake diagram
elites.jsonl              of a map: its gaits on disturbed robots
"""

from __future__ import annotations

import math
from collections.abc import Mapping
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

_COUNTERS = {EVALUATIONS: "index", ITERATIONS: "iteration"}
"""The key that counts the lines of a file."""


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


def recorded_evaluation(entry: Mapping[str, Any]) -> Evaluation:
    """The evaluation of a line of the record."""
    return Evaluation(
        fitness=-math.inf if entry["fitness"] is None else entry["fitness"],
        metrics=entry["metrics"],
        failure=entry["failure"],
        wall_time=entry["wall_time_s"],
        engine=entry["engine"],
        draws=entry.get("draws"),
    )


def read_entries(path: Path) -> list[dict[str, Any]]:
    """The lines of a file of a record; InputError, naming file and line, where one is damaged or
    missing."""
    entries = read_lines(path)
    counter = _COUNTERS.get(path.name)
    if counter is not None:
        for row, entry in enumerate(entries):
            if entry.get(counter) != row:
                problem = f"{counter} is {entry.get(counter)}, expected {row}"
                raise InputError(path, f"line {row + 1}", f"is damaged: {problem}; {REMEDY}")
    return entries
