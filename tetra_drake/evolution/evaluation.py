"""GaitEvaluation: from a vector of parameters to its evaluation, by one simulation, or by one for
each draw of the scenario's disturbances."""

from __future__ import annotations

import dataclasses
import functools
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tetra_drake.engines.interface import engine_of
from tetra_drake.engines.simulate import simulate
from tetra_drake.engines.time_limit import time_limit
from tetra_drake.errors import (
    Diverged,
    InputError,
    SimulationFailure,
    StepBudgetExceeded,
    TimeBudgetExceeded,
)
from tetra_drake.evolution.draws import SeededVector, combine
from tetra_drake.optimizers.base import Evaluation
from tetra_drake.results.metrics import unmet_requirements
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.gait import Gait, ParameterSpace, Vector
from tetra_drake.scenario.disturbances import IterationSeed, draws_of_iteration
from tetra_drake.scenario.schema import Scenario

if TYPE_CHECKING:
    from tetra_drake.engines.compiled.lane_pool import LanePool

Objective = Callable[[SimulationResult], float]
"""Function of a result that evolution maximises; -inf or NaN is a failure. One that reads the
trajectory has the attribute `needs_trajectory = True`."""

_SEEDS_KEPT = 32
"""Number of seeds whose draws are kept: more than there are vectors under way."""


@dataclass(frozen=True)
class GaitEvaluation:
    """Evaluates vectors by simulating their gaits: with the same numbers, bit for bit, in any
    process, unless the time budget runs out."""

    scenario: Scenario
    objective: Objective | None = None
    """None for the scenario's own."""
    lanes: LanePool | None = None
    """Lane pool that simulates the gaits of many threads side by side."""

    def __call__(self, task: Vector | SeededVector) -> Evaluation:
        """Fitness and metrics of one vector, or the reason of a failure; of one with a seed, those
        among its draws, which end where one has failed."""
        if self.lanes is not None:
            return self._evaluate_in(self.lanes, [task])[0]
        started = time.perf_counter()
        gait, scenarios = self._walks(task)
        draws = []
        for scenario in scenarios:
            simulation = functools.partial(self._simulate, scenario, gait)
            draws.append(self._evaluation(scenario, simulation))
            if not draws[-1].metrics:
                break
        wall_time = time.perf_counter() - started
        return dataclasses.replace(self._combined(task, draws), wall_time=wall_time)

    @property
    def side_by_side(self) -> int:
        """The number of vectors, or a multiple, for which many() takes least time each."""
        lane_pool = engine_of(self.scenario).lane_pool
        return lane_pool.most_lanes() if lane_pool and self.lanes is None else 1

    def many(self, tasks: Sequence[Vector | SeededVector]) -> list[Evaluation]:
        """The evaluations of several vectors: in lanes on one core, if that is faster."""
        lane_pool = engine_of(self.scenario).lane_pool
        if len(tasks) == 1 or self.lanes is not None or lane_pool is None:
            return [self(task) for task in tasks]
        with lane_pool(1) as lanes:
            return self._evaluate_in(lanes, tasks)

    def __reduce__(self) -> tuple[object, ...]:
        return GaitEvaluation, (self.scenario, self.objective, self.lanes)  # nothing that is kept

    @functools.cached_property
    def _space(self) -> ParameterSpace:
        return ParameterSpace.of(self.scenario)

    @functools.cached_property
    def _draws(self) -> Callable[[IterationSeed], list[Scenario]]:
        """The scenario's draws of a seed: the same objects for all vectors of an iteration."""
        return functools.lru_cache(_SEEDS_KEPT)(
            functools.partial(draws_of_iteration, self.scenario)
        )

    def _evaluate_in(
        self, lanes: LanePool, tasks: Sequence[Vector | SeededVector]
    ) -> list[Evaluation]:
        """Evaluates all tasks, and all their draws, at once."""
        plans = [self._walks(task) for task in tasks]
        walks = [(scenario, gait) for gait, scenarios in plans for scenario in scenarios]
        budget = self.scenario.evolution.time_budget
        futures = iter(lanes.submit(walks, record=self._records, time_budget=budget))
        evaluations = []
        for task, (_, scenarios) in zip(tasks, plans, strict=True):
            draws = []
            for scenario in scenarios:
                simulation = functools.partial(lanes.result, next(futures))
                draws.append(self._evaluation(scenario, simulation))
            evaluations.append(self._combined(task, draws))
        return evaluations

    def _walks(self, task: Vector | SeededVector) -> tuple[Gait, list[Scenario]]:
        """The gait of a task and the scenarios to simulate it on."""
        if isinstance(task, SeededVector):
            return self._space.gait(task.vector, name="candidate"), self._draws(task.seed)
        return self._space.gait(task, name="candidate"), [self.scenario]

    def _combined(self, task: Vector | SeededVector, draws: list[Evaluation]) -> Evaluation:
        """The evaluation of a task from those of its draws."""
        settings = self.scenario.disturbances
        if settings is None or not isinstance(task, SeededVector):
            evaluation = draws[0]
        else:
            evaluation = combine(draws, settings.tail)
        return dataclasses.replace(evaluation, engine=self.scenario.engine_name)

    def _simulate(self, scenario: Scenario, gait: Gait) -> SimulationResult:
        with time_limit(self.scenario.evolution.time_budget):
            return simulate(scenario=scenario, gait=gait, record=self._records)

    @property
    def _records(self) -> bool:
        return bool(getattr(self.objective, "needs_trajectory", False))

    def _evaluation(
        self, scenario: Scenario, simulation: Callable[[], SimulationResult]
    ) -> Evaluation:
        """Evaluation of a gait by its simulation."""
        try:
            result = simulation()
        except (SimulationFailure, TimeBudgetExceeded) as error:
            failed = Evaluation.failed(f"{_KINDS[type(error)]}: {error}")
            return dataclasses.replace(failed, wall_time=error.wall_time)
        except InputError as error:
            if scenario is self.scenario:
                raise
            return Evaluation.failed(f"no start: {error}")
        fitness = self._fitness(result)
        metrics, wall_time = result.metrics.to_json(), result.wall_time
        if not math.isfinite(fitness):
            reason = "diverged: the fitness is not finite"
            return Evaluation(-math.inf, failure=reason, wall_time=wall_time)
        if unmet := unmet_requirements(result.metrics, self.scenario.require):
            reason = f"requirement: {'; '.join(unmet)}"
            return Evaluation(-math.inf, metrics, reason, wall_time)
        return Evaluation(fitness, metrics, wall_time=wall_time)

    def _fitness(self, result: SimulationResult) -> float:
        if self.objective is None:
            return result.fitness
        try:
            return float(self.objective(result))
        except InputError as error:
            if result.recorded is not None or error.key != "trajectory":
                raise
            problem = "reads the trajectory, expected its attribute needs_trajectory to be True"
            raise InputError("objective", "", problem) from error


_KINDS: dict[type[Exception], str] = {
    SimulationFailure: "failed",
    Diverged: "diverged",
    StepBudgetExceeded: "step budget",
    TimeBudgetExceeded: "time budget",
}
