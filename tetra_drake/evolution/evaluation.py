"""GaitEvaluation: from a vector of parameters to its evaluation, by one simulation."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import math
import signal
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from types import FrameType
from typing import TYPE_CHECKING

from tetra_drake.engines.simulate import simulate
from tetra_drake.errors import (
    Diverged,
    SimulationFailure,
    StepBudgetExceeded,
    TimeBudgetExceeded,
)
from tetra_drake.evolution.optimizers.base import Evaluation
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.gait import Gait, ParameterSpace, Vector
from tetra_drake.scenario.schema import Scenario

if TYPE_CHECKING:
    from tetra_drake.engines.compiled.lane_pool import LanePool

Objective = Callable[[SimulationResult], float]
"""What evolution maximises; the result has no trajectory. -inf or NaN counts as a failure."""


@dataclass(frozen=True)
class GaitEvaluation:
    """Evaluates vectors by simulating their gaits: with the same numbers, bit for bit, in any
    process, unless the time budget runs out."""

    scenario: Scenario
    objective: Objective | None = None
    """None for the scenario's fitness."""
    lanes: LanePool | None = None
    """Where many threads that evaluate have their gaits simulated side by side."""

    def __call__(self, vector: Vector) -> Evaluation:
        """Fitness and metrics of one vector, or the reason of a failure."""
        started, scenario = time.perf_counter(), self.scenario
        gait = self._space.gait(vector, name="candidate")
        try:
            result = self._simulate(gait)
        except (SimulationFailure, TimeBudgetExceeded) as error:
            found, cost = Evaluation.failed(f"{_KINDS[type(error)]}: {error}"), error.wall_time
        else:
            fitness = result.fitness if self.objective is None else float(self.objective(result))
            found, cost = Evaluation(fitness, result.metrics.to_json()), result.wall_time
            if not math.isfinite(fitness):
                found = Evaluation.failed("diverged: the fitness is not finite")
        wall_time = time.perf_counter() - started if self.lanes is None else cost
        return dataclasses.replace(found, wall_time=wall_time, engine=scenario.simulation.engine)

    @functools.cached_property
    def _space(self) -> ParameterSpace:
        return ParameterSpace.of(self.scenario)

    def _simulate(self, gait: Gait) -> SimulationResult:
        budget = self.scenario.evolution.time_budget
        if self.lanes is not None:
            return self.lanes.simulate(scenario=self.scenario, gait=gait, time_budget=budget)
        with time_limit(budget):
            return simulate(scenario=self.scenario, gait=gait)


_KINDS: dict[type[Exception], str] = {
    SimulationFailure: "failed",
    Diverged: "diverged",
    StepBudgetExceeded: "step budget",
    TimeBudgetExceeded: "time budget",
}


@contextlib.contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """A block that ends with TimeBudgetExceeded after this wall time, in a process's main thread;
    in other threads there is no limit."""
    if threading.current_thread() is not threading.main_thread() or not math.isfinite(seconds):
        yield
        return

    def give_up(number: int, frame: FrameType | None) -> None:
        raise TimeBudgetExceeded(f"not done after {seconds:g} s")

    # Drake calls back into Python at every derivative evaluation: there the alarm is heard.
    before = signal.signal(signal.SIGALRM, give_up)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
