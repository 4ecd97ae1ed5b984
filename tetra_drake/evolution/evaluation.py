"""Fitness of a parameter vector, by one simulation or by one per draw of the scenario's
disturbances."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import itertools
import math
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, SupportsFloat

import numpy as np

from tetra_drake.engines.simulate import simulate
from tetra_drake.engines.time_limit import time_limit
from tetra_drake.errors import (
    InputError,
    SimulationFailure,
    TimeBudgetExceeded,
)
from tetra_drake.evolution.manifest import Method
from tetra_drake.optimizers.base import Evaluation, Task
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.parameter_space import ParameterSpace, with_body
from tetra_drake.scenario.disturbances import draws_of_iteration
from tetra_drake.scenario.metrics import METRICS, unmet_requirements
from tetra_drake.scenario.scenario import Scenario

if TYPE_CHECKING:
    from tetra_drake.engines.queue import SimulationQueue

Objective = Callable[[SimulationResult], float]
"""Function of a result that evolution maximises; -inf or NaN is a failure. A function that reads
the trajectory must have the attribute `needs_trajectory = True`."""

_SEEDS_KEPT = 32
"""Number of seeds whose disturbed scenarios are cached; more than the concurrent evaluations."""


@dataclass(eq=False)
class GaitEvaluation:
    """Fitness function of evolution: it simulates the gait of a parameter vector.

    The result is the same in any process, bit for bit, unless the time budget runs out.
    """

    scenario: Scenario
    objective: Objective | None = None
    """Function to maximise; None for the objective of the scenario."""

    def __post_init__(self) -> None:
        self.records = bool(getattr(self.objective, "needs_trajectory", False))
        """True if the objective needs the trajectory of each simulation."""
        self._space = ParameterSpace.of(self.scenario)
        # All vectors of an iteration share the same disturbed scenarios.
        draws = functools.partial(draws_of_iteration, self.scenario)
        self._draws = functools.lru_cache(_SEEDS_KEPT)(draws)

    def __call__(self, task: Task) -> Evaluation:
        """Fitness and metrics of a task's vector, or the reason of its failure.

        With disturbances there is one simulation per draw (randomly changed scenario), one after
        another. The first that yields no metrics ends the evaluation: the gait has failed.
        """
        started = time.perf_counter()
        limited = time_limit(self.scenario.evolution.time_budget)(simulate)
        draws = []
        for scenario, gait in self._simulations(task):
            simulation = functools.partial(limited, scenario, gait, record=self.records)
            draws.append(self._judged(scenario, simulation))
            if not draws[-1].metrics:
                break
        wall_time = time.perf_counter() - started
        return dataclasses.replace(self._combined(task, draws), wall_time=wall_time)

    def on_queue(self, task: Task, queue: SimulationQueue) -> Future[Evaluation]:
        """Begins the evaluation of a task and returns its future. With disturbances, `queue`
        simulates the gait in all draws (randomly changed scenarios) side by side."""
        simulations, ended = self._simulations(task), itertools.count(1)
        time_budget = self.scenario.evolution.time_budget
        results = queue.submit(simulations, time_budget=time_budget)
        evaluated = Future[Evaluation]()

        def end(_: object) -> None:
            if next(ended) < len(results):
                return
            try:
                draws = [
                    self._judged(scenario, result.result)
                    for (scenario, _), result in zip(simulations, results, strict=True)
                ]
                evaluated.set_result(self._combined(task, draws))
            except BaseException as error:
                evaluated.set_exception(error)

        for result in results:
            result.add_done_callback(end)
        return evaluated

    def __reduce__(self) -> tuple[object, ...]:
        return GaitEvaluation, (self.scenario, self.objective)  # without the caches

    def _simulations(self, task: Task) -> list[tuple[Scenario, Gait]]:
        """Scenario and gait of each simulation that a task needs: one simulation, or with
        disturbances one per draw (randomly changed scenario). A body that cannot be disturbed,
        because no robot can have it, needs one simulation, which refuses it."""
        gait = self._space.gait(task.vector, name=str(task))
        if task.seed is None:
            return [(self.scenario, gait)]
        if not gait.body:
            return [(scenario, gait) for scenario in self._draws(task.seed)]
        try:
            scenario, bare = with_body(self.scenario, gait)
        except InputError:
            return [(self.scenario, gait)]
        return [(draw, bare) for draw in draws_of_iteration(scenario, task.seed)]

    def _judged(self, scenario: Scenario, simulation: Callable[[], SimulationResult]) -> Evaluation:
        """Calls `simulation`, which simulates a gait on `scenario`, and evaluates its result. A
        simulation that fails, or an unmet requirement, gives an evaluation with the reason. An
        InputError counts as a failure only if the scenario is disturbed or bodies evolve; otherwise
        it is raised."""
        try:
            result = simulation()
        except (SimulationFailure, TimeBudgetExceeded) as error:
            failure = f"{error.kind}: {error}"
            return Evaluation(failure=failure, wall_time=error.wall_time)
        except InputError as error:
            if scenario is self.scenario and not scenario.evolve:
                raise
            return Evaluation(failure=f"no start: {error}")
        fitness = self._fitness(result)
        metrics, wall_time = result.metrics.to_json(), result.wall_time
        if not math.isfinite(fitness):
            failure = "diverged: the fitness is not finite"
            return Evaluation(failure=failure, wall_time=wall_time)
        if unmet := unmet_requirements(result.metrics, self.scenario.require):
            failure = f"requirement: {'; '.join(unmet)}"
            return Evaluation(-math.inf, metrics, failure, wall_time)
        return Evaluation(fitness, metrics, wall_time=wall_time)

    def _combined(self, task: Task, draws: Sequence[Evaluation]) -> Evaluation:
        """Combines the evaluations of a task's simulations, one per draw, into one; see
        combine()."""
        settings, evaluation = self.scenario.disturbances, draws[0]
        if settings is not None and task.seed is not None:
            evaluation = combine(draws, settings.tail)
        engine = self.scenario.engine_name
        return dataclasses.replace(evaluation, engine=engine, task=str(task))

    def _fitness(self, result: SimulationResult) -> float:
        if self.objective is None:
            return result.fitness
        try:
            fitness: Any = self.objective(result)
        except InputError as error:
            if result.recorded is not None or error.key != "trajectory":
                raise
            problem = "reads the trajectory, expected its attribute needs_trajectory to be True"
            raise InputError("objective", "", problem) from error
        if isinstance(fitness, SupportsFloat):
            with contextlib.suppress(TypeError):  # of an array
                return float(fitness)
        name = Method.of(self.scenario, objective=self.objective).objective
        raise InputError("objective", name, f"returned {fitness!r:.60}, expected a number")


def combine(draws: Sequence[Evaluation], share: float) -> Evaluation:
    """Combines the evaluations of one gait, one per draw of disturbances (randomly changed
    scenario), into one. Fitness is the mean over the worst `share` (0 to 1) of the draws. The gait
    fails if it fails in any draw."""
    wall_time = sum(draw.wall_time for draw in draws)
    failures = [f"draw {k}: {e.failure}" for k, e in enumerate(draws) if e.failure is not None]
    metrics = combine_metrics([draw.metrics for draw in draws])
    if failures:
        return Evaluation(-math.inf, metrics, failures[0], wall_time)
    fitnesses = [draw.fitness for draw in draws]
    lists = {"fitness": fitnesses, "distance": [draw.metrics["distance"] for draw in draws]}
    return Evaluation(worst_mean(fitnesses, share), metrics, wall_time=wall_time, draws=lists)


def combine_metrics(draws: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Combines the metrics of one gait, one mapping per draw of disturbances. A metric that is a
    minimum, such as clearance, keeps its least value, a maximum its greatest; of others the mean is
    taken. Empty if a draw has no metrics."""
    if not all(draws):
        return {}
    combined: dict[str, Any] = {}
    for name in draws[0]:
        values, metric = [draw[name] for draw in draws], METRICS.get(name)
        if None in values:  # an infinite metric is recorded as null
            combined[name] = None
        elif metric and metric.least:
            combined[name] = min(values)
        elif metric and metric.most:
            combined[name] = max(values)
        else:
            combined[name] = np.mean(values, axis=0).tolist()
    return combined


def worst_mean(fitnesses: Sequence[float], share: float) -> float:
    """Mean of the lowest `share` (0 to 1) of the fitnesses. If this share is 2.5 values, the third
    lowest has weight 0.5. At least one value counts."""
    ranked, count = sorted(fitnesses), max(1.0, share * len(fitnesses))
    weights = [min(1.0, max(0.0, count - i)) for i in range(len(ranked))]
    return math.fsum(w * f for w, f in zip(weights, ranked, strict=True)) / count
