"""Measurement of the engines: how fast and how exact they are with different settings."""

from __future__ import annotations

import itertools
import math
import statistics
import time
from collections.abc import Callable, Container, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tetra_drake.benchmark.settings import (
    Changes,
    compiled,
    describe,
    grounds,
    mujoco,
    own,
    settings_of,
)
from tetra_drake.engines.mujoco import check_mujoco
from tetra_drake.engines.simulate import available_cores, simulate, simulate_many
from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.files import json_number
from tetra_drake.results.result import SimulationResult, versions
from tetra_drake.robot.gait import Gait, seeded_gait
from tetra_drake.scenario.schema import Scenario

CLOSE_IN = 0.05  # distances (in) that differ by no more count as the same

CONVERGED, CHECK = compiled(1e-3, 0.5, 1e-3), compiled(2e-3, 1.0, 2e-3)
"""What errors are measured against, but MuJoCo's; and the other converged setting: a gait that
walks elsewhere with it is ill-conditioned."""

MUJOCO_CONVERGED = mujoco("implicitfast", 0.0625)

SIZES = (5, 10, 20, 40)  # numbers of tetrahedra
BATCHES = (1, 2, 4, 8, 30, 240)  # gaits at a time on the compiled engine
MUJOCO_BATCH = 4  # gaits at a time in MuJoCo, for each core
LANES = 8  # gaits at a time for the cost per step
GROUND_BATCH = 30  # gaits at a time on each ground
ROUNDS = 3  # measurements of batches and costs, of which the medians count

SHORT = {"simulation.duration": "0.02 s", "simulation.steady_from": "0.01 s"}
"""For simulations that only load or compile what is timed later."""

Array = np.ndarray


@dataclass
class Row:
    """One row of the table: one setting, and what has been measured with it so far."""

    scenario: Scenario
    distances_in: list[float] = field(default_factory=list)
    """By gait, NaN where the simulation failed."""
    evaluations: list[int] = field(default_factory=list)
    simulated: float = 0.0
    """Simulated time in s, without failed simulations."""
    wall_time: float = 0.0
    """In s, from gait to result."""

    def __post_init__(self) -> None:
        self.engine = self.scenario.simulation.engine

    def time(self, gait: Gait) -> None:
        """Simulates a gait."""
        started = time.perf_counter()
        result = self.simulate(gait)
        taken = time.perf_counter() - started
        self.distances_in.append(math.nan if result is None else result.metrics.distance_in)
        if result is not None:
            self.evaluations.append(result.integrator.derivative_evaluations)
            self.wall_time += taken
            self.simulated += result.duration

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
        factor = self.simulated / self.wall_time if self.wall_time else None
        return {
            "engine": self.engine,
            "setting": describe(self.scenario),
            "real_time_factor_per_core": factor,
            "median_error_in": median,
            "worst_error_in": worst,
            "evaluations": round(statistics.mean(self.evaluations)) if self.evaluations else None,
            "failed": int(np.isnan(distances).sum()),
            "distances_in": _finite(self.distances_in),
            "exact_in": _finite(exact_in.tolist()),
        }


@dataclass
class Batch:
    """One row of the table of batches: random gaits, of seeds 0, 1 ..., at a time."""

    scenario: Scenario
    size: int
    """The number of gaits."""
    cores: int = 1
    factors: list[float] = field(default_factory=list)
    """By round: simulated time over wall time from gaits to results."""
    step_costs: list[float] = field(default_factory=list)
    """By round: the time (μs) that a step of one gait takes on one core, without preparation."""
    steps: int = 0
    failed: int = 0

    def time(self) -> None:
        """Simulates the gaits."""
        gaits = [seeded_gait(self.scenario, seed) for seed in range(self.size)]
        started = time.perf_counter()
        outcomes = simulate_many(scenario=self.scenario, gaits=gaits, workers=self.cores)
        taken = time.perf_counter() - started
        results = [outcome for outcome in outcomes if isinstance(outcome, SimulationResult)]
        self.failed = self.size - len(results)
        self.factors.append(sum(result.duration for result in results) / taken)
        self.steps = sum(result.integrator.steps for result in results)
        if results:
            self.step_costs.append(1e6 * sum(result.wall_time for result in results) / self.steps)

    def to_json(self) -> dict[str, Any]:
        """The row."""
        factor = statistics.median(self.factors)
        return {
            "engine": self.scenario.simulation.engine,
            "setting": describe(self.scenario),
            "gaits": self.size,
            "cores": self.cores,
            "real_time_factor_per_core": factor / self.cores,
            "real_time_factor": factor,
            "failed": self.failed,
        }


def measure(
    scenario: Scenario,
    gaits: Sequence[Gait],
    *,
    sets: Sequence[str] = ("default",),
    sizes: Sequence[int] = SIZES,
    say: Callable[[str], None] = lambda stage: None,
) -> dict[str, Any]:
    """Measures sets of settings (of SETS) on gaits, batches on the engines that simulate many gaits
    at a time, and the compiled engine's cost per step by number of tetrahedra.

    All settings simulate the first gait, then the second, and so on, and batches take turns, so
    that whatever else runs on the machine affects all alike. Returns what tables.to_markdown()
    prints and JSON can hold: lengths in inches, times in s, None for what failed. `say` is told
    which stage begins.

    Raises InputError if MuJoCo is asked for by its set and cannot simulate the scenario.
    """
    left_out = "mujoco" not in sets and not _mujoco_can(scenario)
    settings = [changes for name in sets for changes in settings_of(name)]
    rows = [row for row in _rows(scenario, settings) if not (left_out and row.engine == "mujoco")]
    engines = {row.engine for row in rows}
    say("converged runs of all gaits")
    exact_in, check_in = (_distances(scenario, changes, gaits) for changes in (CONVERGED, CHECK))
    counted = np.abs(exact_in - check_in) <= CLOSE_IN
    converged = dict.fromkeys(engines, exact_in)
    if "mujoco" in engines:
        converged["mujoco"] = _distances(scenario, MUJOCO_CONVERGED, gaits)
    batches = list(_batches(scenario, engines))
    on_grounds = list(_grounds(scenario)) if sizes and {"compiled", "drake"} <= engines else []
    sized = [{"robot.tetrahedra": size} | own("compiled") for size in sizes]
    costs = [[Batch(scenario.with_changes(each), n) for n in (1, LANES)] for each in sized]
    in_turn = list(itertools.chain(batches, *costs, *(ground for _, ground in on_grounds)))
    if "drake" in engines:
        Row(scenario.with_changes(own("drake") | SHORT)).simulate(gaits[0])
    for batch in in_turn:
        brief = batch.scenario.with_changes(SHORT)
        simulate_many(scenario=brief, gaits=[seeded_gait(brief)] * batch.size, workers=1)
    for i in range(len(gaits)):
        say(f"gait {i + 1} of {len(gaits)} with all settings")
        for row in rows:
            row.time(gaits[i])
    for i in range(ROUNDS if in_turn else 0):
        say(f"batches and sizes of the robot, round {i + 1} of {ROUNDS}")
        for batch in in_turn:
            batch.time()
    apart, _ = error_statistics(converged.get("mujoco", exact_in) - exact_in, counted)
    return {
        "schema": 4,
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
        "batches": [batch.to_json() for batch in batches],
        "step_costs": [step_cost(*pair) for pair in costs],
        "grounds": [ground_speed(name, *three) for name, three in on_grounds],
    }


def error_statistics(errors: Array, counted: Array) -> tuple[float | None, float | None]:
    """Median and largest of the absolute errors (gaits,) that are counted and finite."""
    errors = np.abs(errors[counted & np.isfinite(errors)])
    return (float(np.median(errors)), float(errors.max())) if errors.size else (None, None)


def step_cost(alone: Batch, in_lanes: Batch) -> dict[str, Any]:
    """The cost per step of one gait, alone and beside others, on one robot."""
    tetrahedra = alone.scenario.robot.tetrahedra
    found: dict[str, Any] = {"tetrahedra": tetrahedra, "steps": alone.steps or None}
    for batch, which in ((alone, ""), (in_lanes, "_in_lanes")):
        cost = statistics.median(batch.step_costs) if batch.step_costs else None
        found[f"microseconds_per_step{which}"] = cost
        found[f"microseconds_per_tetrahedron{which}"] = cost and cost / tetrahedra
    return found


def ground_speed(name: str, alone: Batch, many: Batch, diagram: Batch) -> dict[str, Any]:
    """How fast the engines are on a ground, on one core."""
    columns = {"compiled": alone, "compiled_many": many, "drake": diagram}
    factors = {key: statistics.median(batch.factors) for key, batch in columns.items()}
    return {"ground": name, "steps": many.steps / GROUND_BATCH} | factors


def _mujoco_can(scenario: Scenario) -> bool:
    try:
        check_mujoco(scenario)
    except InputError:
        return False
    return True


def _grounds(scenario: Scenario) -> Iterator[tuple[str, list[Batch]]]:
    """Batches on each of grounds(): one gait, many gaits, and one on the diagram."""
    for name, changes in grounds().items():
        ours, diagram = (scenario.with_changes(changes | own(e)) for e in ("compiled", "drake"))
        yield name, [Batch(ours, 1), Batch(ours, GROUND_BATCH), Batch(diagram, 1)]


def _rows(scenario: Scenario, settings: Sequence[Changes]) -> Iterator[Row]:
    """A row for each setting that differs from those before it."""
    seen = set()
    for changes in settings:
        row = Row(scenario.with_changes(changes))
        if (row.engine, describe(row.scenario)) not in seen:
            seen.add((row.engine, describe(row.scenario)))
            yield row


def _batches(scenario: Scenario, engines: Container[str]) -> Iterator[Batch]:
    """Batches on one core, and on all that they fill."""
    cores = sorted({1, available_cores()})
    if "compiled" in engines:
        changed = scenario.with_changes(own("compiled"))
        sizes = [(size, n) for n in cores for size in BATCHES if n == 1 or size > 1]
        yield from (Batch(changed, size, min(size, n)) for size, n in sizes)
    if "mujoco" in engines:
        for row in _rows(scenario, [own("mujoco"), mujoco("implicitfast", 2)]):
            yield from (Batch(row.scenario, MUJOCO_BATCH * n, n) for n in cores)


def _distances(scenario: Scenario, changes: Changes, gaits: Sequence[Gait]) -> Array:
    """(gaits,): how far (in) gaits walk with a setting, NaN where the simulation failed."""
    outcomes = simulate_many(scenario=scenario.with_changes(changes), gaits=gaits)
    walked = (o.metrics.distance_in if isinstance(o, SimulationResult) else None for o in outcomes)
    return np.array([*walked], dtype=float)


def _finite(values: list[float]) -> list[float | None]:
    """The values for JSON, None for NaN."""
    return [json_number(value) for value in values]
