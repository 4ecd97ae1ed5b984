"""Interface between optimisers and the trial loop: tasks, evaluations, iterations."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from tetra_drake.robot.parameter_space import ParameterSpace, Vector
from tetra_drake.scenario.disturbances import IterationSeed
from tetra_drake.scenario.experiment_sections import EvolutionSection


@dataclass(frozen=True)
class Evaluation:
    """Fitness and metrics of one vector. A failure has fitness -inf; it has metrics only if the
    simulation was completed."""

    fitness: float = -math.inf
    metrics: Mapping[str, Any] = field(default_factory=dict)
    """Metrics in the form of Metrics.to_json()."""
    failure: str | None = None
    """Reason of a failure; None for a success."""
    wall_time: float = 0.0
    """Wall time in s. Simulations that run side by side on a core share the time of the core."""
    engine: str = ""
    draws: Mapping[str, Sequence[float]] | None = None
    """Fitness and distance (m) of each draw of disturbances; None without disturbances."""
    task: str = field(default="", compare=False)
    """Trial and number of its task, such as "trial 0, evaluation 3"; "" if it does not name it."""


@dataclass(frozen=True, eq=False)
class Task:
    """A parameter vector to evaluate, with its trial, index and iteration in the record."""

    vector: Vector
    trial: int = 0
    index: int = 0
    """Number of the evaluation in its trial."""
    iteration: int = 0
    seed: IterationSeed | None = None
    """Seed of the draws of disturbances; None without disturbances."""

    def __str__(self) -> str:
        return f"trial {self.trial}, evaluation {self.index}"


Evaluate = Callable[[Task], Evaluation]
"""Function that evaluates a task. The result depends only on the task. The function must be
picklable to run in worker processes."""


@dataclass(frozen=True)
class Iteration:
    """What an optimiser reports after it got the evaluations of an iteration."""

    report: Mapping[str, Any]
    """Numbers to record with the iteration, by name; an unknown number is None."""
    stop: str | None = None
    """Reason to stop before all evaluations are used; None to continue."""
    placed: Sequence[int | None] | None = None
    """Index in the population of each vector of the batch; None for a dropped vector. None instead
    of a list for an optimiser without a population."""


def mean_fitness(fitnesses: Vector) -> float:
    """Mean of the fitnesses of vectors that did not fail; NaN if all failed."""
    finite = fitnesses[np.isfinite(fitnesses)]
    return float(np.mean(finite)) if finite.size else math.nan


class Optimizer(Protocol):
    """Interface of an optimiser: ask() returns a batch of vectors, tell() takes their evaluations.

    It depends only on the evaluations and its random generator, so that a trial can be repeated
    from its record. Every trial ends after `evolution.evaluations` evaluations at the latest. Its
    last batch is cut to the number of evaluations that are left.
    """

    def ask(self) -> list[Vector]:
        """The vectors of the next iteration. They may be evaluated in any order."""

    def tell(self, evaluations: Sequence[Evaluation]) -> Iteration:
        """Takes the evaluations of the vectors that ask() returned last, in the same order. Returns
        a report on the iteration. If the batch was cut, only its first vectors have evaluations."""


MakeOptimizer = Callable[[ParameterSpace, EvolutionSection, np.random.Generator], Optimizer]
"""Function that makes the optimiser of one trial. Its arguments are the search space, the
`evolution` section of the scenario, and the random generator of the trial."""
