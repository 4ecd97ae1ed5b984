"""Cheap fitness functions for tests of the trial loop, with a scenario and a reader of its record.

A module of its own so that worker processes can import it.
"""

import json
import os
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tetra_drake.evolution.evaluation import combine
from tetra_drake.evolution.evaluators import Evaluator, Submit, evaluate_all, on_executor
from tetra_drake.evolution.manifest import RunRecord
from tetra_drake.evolution.trials import TrialStatus, open_trials, run_trials
from tetra_drake.optimizers.base import Evaluate, Evaluation, Iteration, MakeOptimizer, Task
from tetra_drake.robot.parameter_space import Vector
from tetra_drake.scenario.disturbances import IterationSeed
from tetra_drake.scenario.experiment_sections import Disturbances
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.scenario import Scenario


@dataclass(frozen=True)
class Bowl:
    """Fitness falls with the squared distance of the weights from 2; about one genome in
    `fails_every` fails. Lasts up to `delay` s, differently for each genome."""

    delay: float = 0.0
    fails_every: int = 5

    def __call__(self, task):
        genome = task.vector
        chance = hash(tuple(genome.tolist()))
        time.sleep(self.delay * (chance % 97) / 97)
        if chance % self.fails_every == 0:
            return Evaluation(failure="fell off the table")
        fitness = -float(((genome[:-2] - 2.0) ** 2).sum())
        metrics = {"distance": 10.0 + fitness, **measures(genome)}
        return Evaluation(fitness, metrics, wall_time=self.delay)


BOWL = Bowl()


def measures(genome):
    """Two metrics that two weights decide: 0.25 to 0.85 of weights from 1 to 3.4."""
    return {"travelling_index": genome[0] / 4.0, "lifted": genome[1] / 4.0}


TAIL = 0.3


@dataclass(frozen=True)
class DrawnBowl:
    """Bowl in three draws, for drawn_scenario(). Each draw moves it in all directions."""

    delay: float = 0.0

    def __call__(self, task):
        bowl = Bowl(self.delay / 3, fails_every=15)
        draws = []
        for k in range(3):
            generator = np.random.default_rng([*task.seed, k])
            draws.append(bowl(Task(task.vector + generator.normal(size=task.vector.size))))
        return combine(draws, TAIL)


@dataclass(frozen=True)
class Dying:
    """Bowl, which ends its process at the task with this index."""

    index: int

    def __call__(self, task):
        if task.index == self.index:
            os._exit(3)
        return Bowl()(task)


def small_scenario(
    *, oscillators: int = 4, population: int = 12, iterations: int = 15, trials: int = 2
) -> Scenario:
    """The thesis with little to do."""
    evaluations = population + 2 * iterations
    changes = {"robot.tetrahedra": oscillators + 1, "optimizer.population": population}
    changes |= {"evolution.evaluations": evaluations, "evolution.trials": trials}
    return load_scenario("thesis").with_changes(changes)


def drawn_scenario(**options) -> Scenario:
    """small_scenario() with three draws of disturbances and a tail."""
    settings = Disturbances(draws=3, tail=TAIL)
    return small_scenario(**options).with_changes({"disturbances": settings})


def in_threads(evaluate: Evaluate = BOWL, workers: int = 2) -> Evaluator:
    """An evaluator in threads."""
    return on_executor(evaluate, ThreadPoolExecutor, workers)


def evaluated(submit: Submit, tasks: Sequence[Task]) -> dict[int, Evaluation]:
    """The evaluations of tasks, by their indices."""
    return {task.index: evaluation for task, evaluation in evaluate_all(submit, tasks)}


def tasks_of(vectors: Iterable[Vector], seed: IterationSeed | None = None) -> list[Task]:
    """A task for each vector, numbered."""
    return [Task(vector, index=index, seed=seed) for index, vector in enumerate(vectors)]


def record_run(
    directory: Path,
    scenario: Scenario | None = None,
    *,
    seed: int = 5,
    evaluate: Evaluate = BOWL,
    workers: int = 2,
    evaluator: Evaluator | None = None,
    optimizer: MakeOptimizer | None = None,
    **options: Any,
) -> list[TrialStatus]:
    """Begins a run in a new directory, or without a scenario goes on with one; its trials' ends.
    The evaluator is in_threads() by default."""
    if scenario is None:
        record = RunRecord.resume(directory)
    else:
        record = RunRecord.create(directory, scenario=scenario, seed=seed)
    with record, evaluator or in_threads(evaluate, workers) as entered:
        trials = open_trials(record, optimizer=optimizer)
        return run_trials(trials, entered, **options)


def read_record(directory: Path) -> dict[str, object]:
    """All files of a run, wall times taken out, by their names."""
    record: dict[str, object] = {}
    for path in sorted(path for path in directory.rglob("*") if path.is_file()):
        name = str(path.relative_to(directory))
        record[name] = path.read_bytes()
        if path.name == "evaluations.jsonl":
            varying, lines = {"wall_time_s": 0.0, "crc": ""}, path.read_text().splitlines()
            record[name] = [json.dumps(json.loads(line) | varying) for line in lines]
    return record


def optimise(optimizer, evaluate, evaluations):
    """The vectors that are evaluated for an optimiser, batch by batch, and its iterations; as many
    evaluations as a trial has."""
    batches, iterations, left = [], [], evaluations
    while left and (not iterations or iterations[-1].stop is None):
        batches.append(optimizer.ask()[:left])
        iterations.append(optimizer.tell([evaluate(vector) for vector in batches[-1]]))
        left -= len(batches[-1])
    return batches, iterations


class RandomSearch:
    """An optimiser: two batches of four without a population."""

    def __init__(self, space, settings, generator):
        self.space, self.generator, self.told = space, generator, []

    def ask(self):
        return [self.space.random(self.generator) for _ in range(4)]

    def tell(self, evaluations):
        self.told += [evaluation.metrics.get("distance", 0.0) for evaluation in evaluations]
        report = {"farthest": max(self.told), "note": "wide"}
        return Iteration(report=report, stop="done" if len(self.told) == 8 else None)
