"""What an optimiser and an evaluation are: all that the trial loop knows about them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import numpy.typing as npt

Genome = npt.NDArray[np.float64]
"""The parameters of a gait in one row; see genome.py."""


@dataclass(frozen=True)
class Evaluation:
    """What became of one genome. One that failed has the worst fitness and no metrics."""

    fitness: float
    metrics: Mapping[str, float] = field(default_factory=dict)
    failure: str | None = None
    wall_time: float = 0.0
    """Time from genome to fitness, in s."""
    engine: str = ""
    """What evaluated it."""

    @classmethod
    def failed(cls, reason: str, *, wall_time: float = 0.0, engine: str = "") -> Evaluation:
        """An evaluation that came to nothing, and why."""
        return cls(fitness=-math.inf, failure=reason, wall_time=wall_time, engine=engine)

    @property
    def distance_in(self) -> float:
        """How far the robot went, in inches; NaN where the evaluation failed."""
        return self.metrics.get("distance_in", math.nan)


Evaluate = Callable[[Genome], Evaluation]
"""A pure function; it must pickle if it is to run in other processes."""


@dataclass(frozen=True)
class Iteration:
    """What an optimiser did with the fitnesses it was told."""

    mean_fitness: float
    """Mean over the population's members that have not failed; NaN without any."""
    placed: tuple[int | None, ...]
    """For each genome of the batch, its place in the population; None if it was dropped."""
    stop: str | None
    """Why the optimisation ends here; None while it goes on."""


class Optimizer(Protocol):
    """Asks for genomes to be evaluated, batch by batch, and is told their fitnesses.

    Whatever it does may depend on its own random generator and on the fitnesses told only,
    so that a recorded trial can be gone through again.
    """

    @property
    def evaluations_at_most(self) -> int:
        """How many evaluations a trial has if it is not stopped early."""
        ...

    def ask(self) -> list[Genome]:
        """The genomes of the next iteration; they can be evaluated in any order, or at once."""
        ...

    def tell(self, fitnesses: Sequence[float]) -> Iteration:
        """Takes the fitnesses in the order in which the genomes were asked for."""
        ...
