"""Runs made up for tests of what is shown of them, written as the real ones are."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tetra_drake.evolution.optimizers.base import Evaluation
from tetra_drake.evolution.record import RunRecord, TrialRecord, evaluation_entry, trial_folder
from tetra_drake.robot.gait import ParameterSpace
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.units import INCH

Child = tuple[float | None, int | None]
"""Fitness, None where the gait failed, and the place it took, None where it took none."""

PER_DISTANCE = 2.0
"""Fitness per inch of distance, so that no figure can mistake one for the other."""


def tiny_scenario(*, trials: int = 1, name: str = "tiny") -> Scenario:
    """A robot of three tetrahedra that walks for a moment."""
    scenario = load_scenario("thesis")
    scenario.name = name
    scenario.robot.tetrahedra = 3
    scenario.simulation.duration = 0.3
    scenario.simulation.steady_from = 0.1
    scenario.evolution.trials = trials
    return scenario


def write_run(
    directory: Path,
    trials: Sequence[Sequence[Sequence[Child]]],
    *,
    scenario: Scenario | None = None,
    unfinished: Sequence[int] = (),
) -> Path:
    """A run of which each trial is given as its iterations, each as its children.

    The mean fitness follows from who took whose place. Genomes are random, and the same
    wherever the same fitness is given. `unfinished` trials have not ended.
    """
    scenario = scenario or tiny_scenario()
    scenario.evolution.trials = len(trials)
    with RunRecord.create(directory, scenario=scenario, seed=7):
        for number, iterations in enumerate(trials):
            trial = TrialRecord(trial_folder(directory, number))
            for entries, line in _lines(iterations, scenario, ends=number not in unfinished):
                trial.complete(entries, line)
    return directory


def _lines(iterations, scenario, *, ends):
    population: dict[int, float | None] = {}
    count = 0
    best: tuple[float, int] | None = None
    for iteration, children in enumerate(iterations):
        entries = []
        for fitness, placed in children:
            entries.append(_entry(count, iteration, fitness, scenario) | {"placed": placed})
            if placed is not None:
                population[placed] = fitness
            if fitness is not None and (best is None or fitness > best[0]):
                best = fitness, count
            count += 1
        finite = [fitness for fitness in population.values() if fitness is not None]
        last = iteration == len(iterations) - 1
        yield (
            entries,
            {
                "iteration": iteration,
                "evaluations": count,
                "mean_fitness": sum(finite) / len(finite) if finite else None,
                "best_fitness": best[0] if best else None,
                "best_evaluation": best[1] if best else None,
                "stop": "all iterations done" if last and ends else None,
            },
        )


def _entry(index, iteration, fitness, scenario):
    seed = index if fitness is None else abs(hash(fitness)) % 2**32
    genome = ParameterSpace.of(scenario).random(np.random.default_rng(seed))
    evaluation = Evaluation(-math.inf, failure="fell over", wall_time=0.5)
    if fitness is not None:
        distances = {
            "distance": fitness / PER_DISTANCE * INCH,
            "steady_distance": fitness * INCH,
            "twist": 0.0,
            "lead": 9.0 * INCH,
            "lateral_drift": 0.0,
        }
        evaluation = Evaluation(fitness, distances, wall_time=0.5)
    return evaluation_entry(index, iteration, genome, evaluation)


def iterations_with_means(means: Sequence[float]) -> list[list[Child]]:
    """Iterations of a trial whose population of one has these fitnesses, one after the other."""
    assert all(math.isfinite(mean) for mean in means)
    return [[(mean, 0)] for mean in means]
