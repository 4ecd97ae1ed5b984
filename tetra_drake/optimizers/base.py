"""Evaluations and optimisers: all that the trial loop knows about either."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from tetra_drake.robot.gait import ParameterSpace, Vector
from tetra_drake.scenario.common_sections import EvolutionSection
from tetra_drake.scenario.disturbances import IterationSeed


@dataclass(frozen=True)
class Evaluation:
    """The outcome of one vector. A failed one has fitness -inf, and metrics only if it walked."""

    fitness: float
    metrics: Mapping[str, Any] = field(default_factory=dict)
    """Metrics in the form of Metrics.to_json()."""
    failure: str | None = None
    wall_time: float = 0.0
    """Wall time in s; for simulations side by side on a core, its share of that core's time."""
    engine: str = ""
    draws: Mapping[str, Sequence[float]] | None = None
    """Among disturbances, fitness and distance (m) of each draw."""

    @classmethod
    def failed(cls, reason: str) -> Evaluation:
        """A failed evaluation and its reason."""
        return cls(fitness=-math.inf, failure=reason)


@dataclass(frozen=True, eq=False)
class Task:
    """A vector to evaluate, numbered as in the record."""

    vector: Vector
    trial: int = 0
    index: int = 0
    """Number of the evaluation in its trial."""
    iteration: int = 0
    seed: IterationSeed | None = None
    """Seed of its draws; None without disturbances."""

    def __str__(self) -> str:
        return f"trial {self.trial}, evaluation {self.index}"


Evaluate = Callable[[Task], Evaluation]
"""A pure function of a task; it must pickle to run in worker processes."""


@dataclass(frozen=True)
class Iteration:
    """Iteration of an optimiser: its report on the evaluations it was told."""

    report: Mapping[str, Any]
    """Numbers to record with the iteration, by the optimiser's own names; None where unknown."""
    stop: str | None = None
    """Why the optimisation ends before its evaluations are used up; None while it goes on."""
    placed: Sequence[int | None] | None = None
    """Index in the population of each vector of the batch, None if it was dropped; None for
    an optimiser without a population."""


class Optimizer(Protocol):
    """Asks for vectors to be evaluated, batch by batch, and is told their evaluations; it depends
    on these and its random generator only, so that a trial can be repeated from its record.

    The trial ends after `evolution.evaluations`, whatever the optimiser. Its last batch is cut to
    the evaluations that are left.
    """

    def ask(self) -> list[Vector]:
        """The vectors of the next iteration, to be evaluated in any order."""

    def tell(self, evaluations: Sequence[Evaluation]) -> Iteration:
        """Takes the evaluations in the order in which the vectors were asked for; of a batch that
        was cut, those of its first vectors."""


MakeOptimizer = Callable[[ParameterSpace, EvolutionSection, np.random.Generator], Optimizer]
"""Makes the optimiser of one trial from the space to search, the scenario's `evolution` section
and the trial's own generator."""
