"""GaitEvaluation: from a vector of parameters to its evaluation, by one simulation, or by one for
each draw of the scenario's disturbances."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import math
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from types import FrameType
from typing import TYPE_CHECKING

from tetra_drake.engines.simulate import simulate
from tetra_drake.errors import (
    Diverged,
    InputError,
    SimulationFailure,
    StepBudgetExceeded,
    TimeBudgetExceeded,
)
from tetra_drake.evolution.draws import Seed, SeededVector, combine, draws_of, worst_share
from tetra_drake.evolution.optimizers.base import Evaluation
from tetra_drake.results.metrics import unmet_requirements
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.gait import Gait, ParameterSpace, Vector
from tetra_drake.scenario.schema import Scenario

if TYPE_CHECKING:
    from tetra_drake.engines.compiled.lane_pool import LanePool

Objective = Callable[[SimulationResult], float]
"""What evolution maximises; the result has no trajectory. -inf or NaN counts as a failure."""

_SEEDS_KEPT = 32
"""Of the seeds whose draws are kept: more than there are vectors under way."""


@dataclass(frozen=True)
class GaitEvaluation:
    """Evaluates vectors by simulating their gaits: with the same numbers, bit for bit, in any
    process, unless the time budget runs out."""

    scenario: Scenario
    objective: Objective | None = None
    """None for the scenario's own."""
    lanes: LanePool | None = None
    """Where many threads that evaluate have their gaits simulated side by side."""

    def __call__(self, task: Vector | SeededVector) -> Evaluation:
        """Fitness and metrics of one vector, or the reason of a failure; of one with a seed, those
        among its draws."""
        started = time.perf_counter()
        if isinstance(task, SeededVector):
            draws = self._evaluations(task.vector, self._draws(task.seed))
            found = combine(draws, worst_share(self.scenario))
        else:
            (found,) = self._evaluations(task, [self.scenario])
        wall_time = time.perf_counter() - started if self.lanes is None else found.wall_time
        engine = self.scenario.simulation.engine
        return dataclasses.replace(found, wall_time=wall_time, engine=engine)

    def __reduce__(self) -> tuple[object, ...]:
        return GaitEvaluation, (self.scenario, self.objective, self.lanes)  # nothing that is kept

    @functools.cached_property
    def _space(self) -> ParameterSpace:
        return ParameterSpace.of(self.scenario)

    @functools.cached_property
    def _draws(self) -> Callable[[Seed], list[Scenario]]:
        """The scenario's draws of a seed: the same objects for all vectors of an iteration."""
        return functools.lru_cache(_SEEDS_KEPT)(functools.partial(draws_of, self.scenario))

    def _evaluations(self, vector: Vector, scenarios: Sequence[Scenario]) -> list[Evaluation]:
        """A gait's evaluations on scenarios; one after another, they end where one has failed."""
        gait, found = self._space.gait(vector, name="candidate"), []
        for scenario, simulation in zip(scenarios, self._simulations(gait, scenarios), strict=True):
            found.append(self._evaluation(scenario, simulation))
            if self.lanes is None and not found[-1].metrics:
                break
        return found

    def _simulations(
        self, gait: Gait, scenarios: Sequence[Scenario]
    ) -> list[Callable[[], SimulationResult]]:
        """Simulations to be made, or waited for where all are under way at once."""
        if self.lanes is None:
            return [functools.partial(self._simulate, scenario, gait) for scenario in scenarios]
        walks = [(scenario, gait) for scenario in scenarios]
        futures = self.lanes.submit(walks, time_budget=self.scenario.evolution.time_budget)
        return [functools.partial(self.lanes.result, future) for future in futures]

    def _simulate(self, scenario: Scenario, gait: Gait) -> SimulationResult:
        with time_limit(self.scenario.evolution.time_budget):
            return simulate(scenario=scenario, gait=gait)

    def _evaluation(
        self, scenario: Scenario, simulation: Callable[[], SimulationResult]
    ) -> Evaluation:
        """What a simulation says of its gait."""
        try:
            result = simulation()
        except (SimulationFailure, TimeBudgetExceeded) as error:
            failed = Evaluation.failed(f"{_KINDS[type(error)]}: {error}")
            return dataclasses.replace(failed, wall_time=error.wall_time)
        except InputError as error:
            if scenario is self.scenario:
                raise
            return Evaluation.failed(f"no start: {error}")
        fitness = result.fitness if self.objective is None else float(self.objective(result))
        found = Evaluation(fitness, result.metrics.to_json())
        if not math.isfinite(fitness):
            found = Evaluation.failed("diverged: the fitness is not finite")
        elif unmet := unmet_requirements(result.metrics, self.scenario.require):
            found = Evaluation(-math.inf, found.metrics, f"requirement: {'; '.join(unmet)}")
        return dataclasses.replace(found, wall_time=result.wall_time)


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
