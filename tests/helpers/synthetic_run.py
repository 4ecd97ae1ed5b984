"""Made-up runs, for tests of tables, figures and pages."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tetra_drake.evolution.entries import EliteLine, EvaluationLine, IterationLine
from tetra_drake.evolution.manifest import RunRecord
from tetra_drake.evolution.run import load_run
from tetra_drake.evolution.trials import RepeatedFile
from tetra_drake.optimizers.base import Evaluation, Task
from tetra_drake.robot.parameter_space import ParameterSpace
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.optimizer_kinds import QualityDiversity
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.settings.units import INCH

Child = tuple[float | None, int | None]
"""Fitness, None where the gait failed, and the place it took, None where it took none."""

PER_DISTANCE = 2.0
"""Fitness per inch of distance, so that no figure can mistake one for the other."""


def tiny_scenario(*, name: str = "tiny") -> Scenario:
    """A robot of three tetrahedra that walks for a moment."""
    times = {"simulation.duration": "0.3 s", "simulation.steady_from": "0.1 s"}
    return load_scenario("thesis").with_changes({"name": name, "robot.tetrahedra": 3} | times)


def write_run(
    directory: Path,
    trials: Sequence[Sequence[Sequence[Child]]],
    *,
    scenario: Scenario | None = None,
    unfinished: Sequence[int] = (),
    metrics: Mapping[float, Mapping[str, Any]] | None = None,
) -> Path:
    """Writes a run. A trial is given as its iterations, an iteration as its children.

    The mean fitness follows from who took whose place. Genomes are random, and the same
    wherever the same fitness is given. `unfinished` trials have not ended. `metrics`: more of them,
    in SI, by fitness.
    """
    scenario = scenario or tiny_scenario()
    scenario = scenario.with_changes({"evolution.trials": len(trials)})
    with RunRecord.create(directory, scenario=scenario, seed=7) as record:
        record.begin()
        for number, iterations in enumerate(trials):
            lines = RepeatedFile(record, number, "evaluations.jsonl")
            ends = RepeatedFile(record, number, "iterations.jsonl")
            made, population = [], {}
            for iteration, children in enumerate(iterations):
                begin = len(made)
                for fitness, placed in children:
                    task, evaluation = _result(len(made), iteration, fitness, scenario)
                    more = (metrics or {}).get(fitness, {})
                    made.append((task, replace(evaluation, metrics={**evaluation.metrics, **more})))
                    population |= {} if placed is None else {placed: fitness}
                finite = [fitness for fitness in population.values() if fitness is not None]
                task, best = max(made, key=lambda result: result[1].fitness)
                is_last = iteration == len(iterations) - 1 and number not in unfinished
                placed = zip(made[begin:], children, strict=True)
                new = [EvaluationLine.of(*one, placed=place) for one, (_, place) in placed]
                line = IterationLine(
                    iteration=iteration,
                    evaluations=len(made),
                    mean_fitness=sum(finite) / len(finite) if finite else None,
                    best_fitness=None if best.failure else best.fitness,
                    best_evaluation=None if best.failure else task.index,
                    stop="all evaluations done" if is_last else None,
                )
                lines.write(new, first=begin)
                ends.write([line], first=iteration)
    return directory


def write_map(directory: Path, kept: Mapping[int, float]) -> Path:
    """A run with a map of 3 by 2 cells: fitness 2, 4 and 3 in cells 0 0, 1 0 and 2 1. `kept`: share
    of the draws that gaits keep, by index."""
    measures = {"speed": [0.0, 3.0 * INCH], "lifted": [0.0, 1.0]}
    kind = QualityDiversity(measures=measures, cells=[3, 2])
    scenario = tiny_scenario().with_changes({"optimizer": kind})
    places = {2.0: (0.5, 0.1), 4.0: (1.5, 0.1), 3.0: (2.5, 0.9)}
    metrics = {f: {"speed": x * INCH, "lifted": y} for f, (x, y) in places.items()}
    trial = [[(fitness, None) for fitness in places]]
    if not directory.exists():
        write_run(directory, [trial], scenario=scenario, metrics=metrics)
    (directory / "elites.jsonl").unlink(missing_ok=True)
    for index, share in kept.items():
        line = EliteLine(trial=0, index=index, kept=share, mean_distance=0.1)
        load_run(directory).file("elites.jsonl").append([line])
    return directory


def _result(index, iteration, fitness, scenario):
    seed = index if fitness is None else abs(hash(fitness)) % 2**32
    genome = ParameterSpace.of(scenario).random(np.random.default_rng(seed))
    evaluation = Evaluation(-math.inf, failure="fell over", wall_time=0.5)
    if fitness is not None:
        inches = {"distance": fitness / PER_DISTANCE, "steady_distance": fitness, "lead": 9.0}
        inches |= {"twist": 0.0, "lateral_drift": 0.0}
        metrics = {name: value * INCH for name, value in inches.items()}
        evaluation = Evaluation(fitness, metrics, wall_time=0.5)
    return Task(genome, index=index, iteration=iteration), evaluation
