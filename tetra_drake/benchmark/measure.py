"""Measurement of the engines: how fast and how exact they are with different settings."""

from __future__ import annotations

import itertools
import math
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tetra_drake.benchmark.settings import Changes, compiled, describe, mujoco, own, settings_of
from tetra_drake.engines.mujoco import installed
from tetra_drake.engines.simulate import simulate
from tetra_drake.errors import SimulationFailure
from tetra_drake.evolution.executors import available_cores, thread_executor
from tetra_drake.formatting import listed
from tetra_drake.results.result import SimulationResult, versions
from tetra_drake.robot.gait import Gait, seeded_gait
from tetra_drake.scenario.schema import Scenario

CLOSE_IN = 0.05  # distances (in) that differ by no more count as the same

CONVERGED, CHECK = compiled(1e-3, 0.5, 1e-3), compiled(2e-3, 1.0, 2e-3)
"""What errors are measured against, but MuJoCo's; and the other converged setting: a gait that
walks elsewhere with it is ill-conditioned."""

MUJOCO_CONVERGED = mujoco("implicitfast", 0.0625)

SIZES = (5, 10, 20, 40)  # numbers of tetrahedra
BATCH = 20  # simulations per core in a batch on all cores

Array = np.ndarray


@dataclass
class Row:
    """One row of the table: one setting, and what has been measured with it so far."""

    scenario: Scenario
    batch: bool = False
    """Whether many gaits are simulated at a time, on all cores."""
    distances_in: list[float] = field(default_factory=list)
    """By gait, NaN where the simulation failed."""
    evaluations: list[int] = field(default_factory=list)
    simulated: float = 0.0
    """Simulated time in s, without failed simulations."""
    wall_time: float = 0.0
    """In s, from gait to result."""

    def __post_init__(self) -> None:
        self.engine = self.scenario.simulation.engine
        self.cores = available_cores() if self.batch else 1

    def time(self, gaits: Sequence[Gait]) -> None:
        """Simulates the first gait, or a batch that begins with it."""
        number = BATCH * self.cores if self.batch else 1
        with thread_executor(self.cores) as executor:
            run = executor.map if self.batch else map
            started = time.perf_counter()
            results = list(run(self.simulate, itertools.islice(itertools.cycle(gaits), number)))
            taken = time.perf_counter() - started
        first = results[0]
        self.distances_in.append(math.nan if first is None else first.metrics.distance_in)
        if first is not None:
            self.evaluations.append(first.integrator.derivative_evaluations)
            self.wall_time += taken
            self.simulated += sum(result.duration for result in results if result is not None)

    def simulate(self, gait: Gait) -> SimulationResult | None:
        """The result of a gait; None if its simulation fails."""
        try:
            return simulate(scenario=self.scenario, gait=gait)
        except SimulationFailure:
            return None

    def to_json(self, exact_in: Array, counted: Array) -> dict[str, Any]:
        """The row; errors are those of the gaits that are `counted` and did not fail."""
        distances = np.array(self.distances_in)
        median, worst = error_statistics(distances - exact_in, counted)
        work = self.wall_time * self.cores
        return {
            "engine": self.engine,
            "setting": describe(self.scenario) + (", many gaits at a time" if self.batch else ""),
            "batch": self.batch,
            "real_time_factor_per_core": self.simulated / work if work else None,
            "median_error_in": median,
            "worst_error_in": worst,
            "evaluations": round(statistics.mean(self.evaluations)) if self.evaluations else None,
            "failed": int(np.isnan(distances).sum()),
            "distances_in": _finite(self.distances_in),
            "exact_in": _finite(exact_in.tolist()),
        }


def measure(
    scenario: Scenario,
    gaits: Sequence[Gait],
    *,
    sets: Sequence[str] = ("default",),
    sizes: Sequence[int] = SIZES,
    say: Callable[[str], None] = lambda stage: None,
) -> dict[str, Any]:
    """Measures sets of settings (of SETS) on gaits, and the cost per step by robot size.

    All settings simulate the first gait, then the second, and so on, so that whatever else runs on
    the machine affects all alike. Returns what tables.to_markdown() prints and JSON can hold:
    lengths in inches, times in s, None for what failed. `say` is told which stage begins.

    Raises InputError if MuJoCo is asked for by its set and cannot simulate the scenario.
    """
    left_out = "mujoco" not in sets and (scenario.cables.slack or not installed())
    settings = [changes for name in sets for changes in settings_of(name)]
    rows = [row for row in _rows(scenario, settings) if not (left_out and row.engine == "mujoco")]
    engines = {row.engine for row in rows}
    say("converged runs of all gaits")
    exact_in, check_in = (_distances(scenario, changes, gaits) for changes in (CONVERGED, CHECK))
    counted = np.abs(exact_in - check_in) <= CLOSE_IN
    converged = dict.fromkeys(engines, exact_in)
    if "mujoco" in engines:
        converged["mujoco"] = _distances(scenario, MUJOCO_CONVERGED, gaits)
    if "drake" in engines:  # loads what the diagram calls
        short = {"simulation.duration": 0.02, "simulation.steady_from": 0.01}
        Row(scenario.with_changes(own("drake") | short)).simulate(gaits[0])
    for i in range(len(gaits)):
        say(f"gait {i + 1} of {len(gaits)} with all settings")
        for row in rows:
            row.time([*gaits[i:], *gaits[:i]])
    say(f"cost per step for these numbers of tetrahedra: {listed(sizes)}")
    apart, _ = error_statistics(converged.get("mujoco", exact_in) - exact_in, counted)
    return {
        "schema": 2,
        "scenario": scenario.name,
        "duration_s": scenario.simulation.duration,
        "versions": versions("mujoco" if "mujoco" in engines else ""),
        "cores": available_cores(),
        "converged": describe(scenario.with_changes(CONVERGED)),
        "gaits": [
            {"name": gait.name, "well_conditioned": bool(good)}
            for gait, good in zip(gaits, counted, strict=True)
        ],
        "rows": [row.to_json(converged[row.engine], counted) for row in rows],
        "mujoco": {
            "left_out": left_out,
            "converged": describe(scenario.with_changes(MUJOCO_CONVERGED)),
            "median_distance_from_ours_in": apart if "mujoco" in engines else None,
        },
        "step_costs": [step_cost(scenario, size) for size in sizes],
    }


def error_statistics(errors: Array, counted: Array) -> tuple[float | None, float | None]:
    """Median and largest of the absolute errors (gaits,) that are counted and finite."""
    errors = np.abs(errors[counted & np.isfinite(errors)])
    return (float(np.median(errors)), float(errors.max())) if errors.size else (None, None)


def step_cost(scenario: Scenario, tetrahedra: int) -> dict[str, Any]:
    """The cost per step of the compiled engine with so many tetrahedra and a random gait."""
    changes = {"simulation.engine": "compiled", "robot.tetrahedra": tetrahedra}
    row = Row(scenario.with_changes(changes))
    results = [row.simulate(seeded_gait(row.scenario, 0)) for _ in range(3)]
    times = [1e6 * r.wall_time / r.integrator.steps for r in results if r is not None]
    per_step = statistics.median(times) if times else None
    return {
        "tetrahedra": tetrahedra,
        "steps": results[0].integrator.steps if results[0] else None,
        "microseconds_per_step": per_step,
        "microseconds_per_tetrahedron": per_step / tetrahedra if per_step else None,
    }


def _rows(scenario: Scenario, settings: Sequence[Changes]) -> Iterator[Row]:
    """A row for each setting that differs from those before it; after the compiled engine's own
    settings, one for a batch on all cores."""
    seen = set()
    for changes in settings:
        row = Row(scenario.with_changes(changes))
        if (row.engine, describe(row.scenario)) not in seen:
            seen.add((row.engine, describe(row.scenario)))
            yield row
            if changes == own("compiled"):
                yield Row(row.scenario, batch=True)


def _distances(scenario: Scenario, changes: Changes, gaits: Sequence[Gait]) -> Array:
    """(gaits,): how far (in) gaits walk with a setting; simulated on all cores."""
    row = Row(scenario.with_changes(changes))
    with thread_executor(available_cores()) as executor:
        results = executor.map(row.simulate, gaits)
        return np.array([math.nan if r is None else r.metrics.distance_in for r in results])


def _finite(values: list[float]) -> list[float | None]:
    """The values for JSON, None for NaN."""
    return [value if math.isfinite(value) else None for value in values]
