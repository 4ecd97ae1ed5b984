"""Measures what each way of simulating the robot costs and how exact it is."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import itertools
import math
import statistics
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field

import numpy as np

from tetra_drake.benchmark import mujoco_steps
from tetra_drake.benchmark.errors import ErrorStatistics, well_conditioned
from tetra_drake.benchmark.work_precision import (
    CONVERGED_COMPILED,
    STEP_END,
    AnySetting,
    CompiledSetting,
    Run,
    Setting,
    default_setting,
    run_setting,
)
from tetra_drake.engines import mujoco as mujoco_robot
from tetra_drake.engines.compiled.engine import compile_engine
from tetra_drake.engines.compiled.walk import walk
from tetra_drake.evolution.executors import thread_executor
from tetra_drake.robot.gait import Gait, seeded_gait
from tetra_drake.scenario.schema import Scenario

CHECK = CompiledSetting(2e-3, 1.0, 2e-3)
"""The other converged setting: a gait that goes elsewhere with it is ill-conditioned."""

SIZES = (5, 10, 20, 40)
"""Numbers of tetrahedra to measure the cost of a step for."""

_MANY = 20
"""Evaluations a core of a batch of many."""

_REPETITIONS = 3
"""Of the measurement of a step's cost, whose median counts."""

Say = Callable[[str], None]
"""Is told which stage has begun."""


@dataclass
class Method:
    """One row of the table: a way to simulate, and what it has given so far."""

    what: str
    setting: str
    walk: Callable[[Gait], float]
    """How far (in) a gait goes; NaN if it fails."""
    exact_in: np.ndarray
    """(gaits,): how far they should go."""
    cores: int = 1
    distances_in: list[float] = field(default_factory=list)
    """By gait."""
    simulated: float = 0.0
    """Simulated time in s, of what has not failed."""
    wall_time: float = 0.0
    """What that took, in s, from gait to distance."""

    @property
    def real_time_factor(self) -> float:
        """Simulated time over wall time and cores; NaN if all gaits have failed."""
        return self.simulated / (self.wall_time * self.cores) if self.simulated else math.nan

    @property
    def failed(self) -> int:
        """How many gaits have failed."""
        return sum(not math.isfinite(distance) for distance in self.distances_in)

    def errors(self, counted: np.ndarray) -> ErrorStatistics:
        """Of the gaits that are counted."""
        return ErrorStatistics.of(np.array(self.distances_in) - self.exact_in, counted)

    def time(self, gait: Gait, duration: float) -> None:
        """Walks one gait of `duration` (s) and adds it to the rest."""
        started = time.perf_counter()
        distance = self.walk(gait)
        taken = time.perf_counter() - started
        self.distances_in.append(distance)
        if math.isfinite(distance):
            self.simulated += duration
            self.wall_time += taken

    def time_many(self, gaits: Sequence[Gait], duration: float, executor: Executor) -> None:
        """Walks gaits of `duration` (s) again and again on all cores; only the first of them is
        added to the distances."""
        batch = list(itertools.islice(itertools.cycle(gaits), _MANY * self.cores))
        started = time.perf_counter()
        distances = list(executor.map(self.walk, batch))
        self.wall_time += time.perf_counter() - started
        self.distances_in.append(distances[0])
        self.simulated += duration * sum(math.isfinite(distance) for distance in distances)


@dataclass(frozen=True)
class StepCost:
    """What a step of the compiled engine costs with so many tetrahedra; NaN if it failed."""

    tetrahedra: int
    steps: int
    microseconds: float


@dataclass(frozen=True)
class Measurement:
    """Everything that the command tells."""

    scenario: Scenario
    gaits: tuple[Gait, ...]
    counted: np.ndarray
    """(gaits,) of bool: the well-conditioned ones."""
    compile_time: float
    """In s, until the compiled engine was ready."""
    from_cache: bool
    methods: list[Method]
    mujoco_from_ours_in: float | None
    """The median distance of MuJoCo's reference from ours; None without MuJoCo."""
    step_costs: list[StepCost]


def measure(scenario: Scenario, gaits: Sequence[Gait], *, cores: int, say: Say) -> Measurement:
    """Measures all methods on the gaits, one gait after another in turn across the methods.

    So whatever else runs on the machine hits all alike. `cores` are those that many gaits are
    evaluated on.
    """
    duration = scenario.simulation.duration
    say("getting the compiled engine ready")
    compile_time, from_cache = get_ready(scenario)
    with contextlib.ExitStack() as stack:
        executor = stack.enter_context(thread_executor(cores))
        say("converged runs of all gaits")
        exact_in, check_in = (
            np.array(list(executor.map(_walk_with(scenario, setting), gaits)))
            for setting in (CONVERGED_COMPILED, CHECK)
        )
        counted = well_conditioned(exact_in, check_in)
        single, many = _our_methods(scenario, exact_in, cores)
        mujoco: list[Method] = []
        from_ours: float | None = None
        if mujoco_robot.installed():
            stack.enter_context(mujoco_robot.mujoco_kept_quiet())
            mujoco, mujoco_exact_in = _mujoco_methods(scenario, gaits, executor, counted, say)
            from_ours = ErrorStatistics.of(mujoco_exact_in - exact_in, counted).median_in
        _warm_up(scenario, gaits[0])
        for i, gait in enumerate(gaits):
            say(f"gait {i + 1} of {len(gaits)} by all methods")
            for method in (*single, *mujoco):
                method.time(gait, duration)
            many.time_many([*gaits[i:], *gaits[:i]], duration, executor)
    say(f"cost of a step for {', '.join(map(str, SIZES))} tetrahedra")
    return Measurement(
        scenario=scenario,
        gaits=tuple(gaits),
        counted=counted,
        compile_time=compile_time,
        from_cache=from_cache,
        methods=[*single, many, *mujoco],
        mujoco_from_ours_in=from_ours,
        step_costs=measure_step_costs(scenario, SIZES),
    )


def get_ready(scenario: Scenario) -> tuple[float, bool]:
    """Compiles the engine or loads it; how long that takes (s), and whether it was loaded."""
    started = time.perf_counter()
    compile_engine(scenario)
    taken = time.perf_counter() - started
    return taken, bool(walk.stats.cache_hits)  # type: ignore[attr-defined]


def measure_step_costs(scenario: Scenario, sizes: Sequence[int]) -> list[StepCost]:
    """What a step of the compiled engine costs with so many tetrahedra, walking at random."""
    runs: dict[int, list[Run]] = {size: [] for size in sizes}
    for _ in range(_REPETITIONS):
        for size in sizes:
            sized = scenario.with_changes(
                {"robot.tetrahedra": size, "simulation.engine": "compiled"}
            )
            runs[size].append(run_setting(sized, seeded_gait(sized, 0), default_setting(sized)))
    costs = []
    for size, repeated in runs.items():
        steps = repeated[0].steps
        wall_time = statistics.median(run.wall_time for run in repeated)
        costs.append(StepCost(size, steps, 1e6 * wall_time / steps if steps else math.nan))
    return costs


def _our_methods(
    scenario: Scenario, exact_in: np.ndarray, cores: int
) -> tuple[list[Method], Method]:
    """Those that walk one gait at a time, and the one that walks many."""
    drake = scenario.with_changes({"simulation.engine": "drake"})
    compiled = scenario.with_changes({"simulation.engine": "compiled"})
    rows: list[tuple[str, AnySetting]] = [
        ("Drake diagram, default", default_setting(drake)),
        ("Drake diagram", Setting("runge_kutta3", 1e-3, 2.0, STEP_END)),
        ("compiled engine, one gait", default_setting(compiled)),
    ]
    single = [
        Method(what, _text(setting), _walk_with(scenario, setting), exact_in)
        for what, setting in rows
    ]
    last = single[-1]
    what, threads = "compiled engine, many gaits", "1 thread" if cores == 1 else f"{cores} threads"
    return single, dataclasses.replace(
        last, what=what, setting=f"the same, {threads}", cores=cores, distances_in=[]
    )


def _mujoco_methods(
    scenario: Scenario, gaits: Sequence[Gait], executor: Executor, counted: np.ndarray, say: Say
) -> tuple[list[Method], np.ndarray]:
    """Those worth a row, and the converged distances (in) of the gaits in MuJoCo."""

    def walk_all(integrator: str, step_ms: float) -> np.ndarray:
        walk_one = _mujoco_walk(scenario, integrator, step_ms)
        return np.array(list(executor.map(walk_one, gaits)))

    say("MuJoCo's converged runs of all gaits")
    exact_in = walk_all(*mujoco_steps.REFERENCE)
    methods = []
    for integrator, steps_ms in mujoco_steps.STEPS_MS.items():
        say(f"the steps that MuJoCo's {integrator} can take")
        chosen = mujoco_steps.choose_steps(
            integrator,
            steps_ms,
            functools.partial(walk_all, integrator),
            exact_in=exact_in,
            counted=counted,
        )
        for choice in chosen:
            methods.append(
                Method(
                    f"MuJoCo {integrator}",
                    f"{choice.step_ms:g} ms ({choice.reason})",
                    _mujoco_walk(scenario, integrator, choice.step_ms),
                    exact_in,
                )
            )
    return methods, exact_in


def _mujoco_walk(scenario: Scenario, integrator: str, step_ms: float) -> Callable[[Gait], float]:
    return functools.partial(
        mujoco_robot.walk_in_mujoco, scenario=scenario, integrator=integrator, step=1e-3 * step_ms
    )


def _text(setting: AnySetting) -> str:
    scheme, accuracy, max_step, mode_changes = setting.cells
    return f"{scheme} at {accuracy}, steps up to {max_step}, {mode_changes}"


def _walk_with(scenario: Scenario, setting: AnySetting) -> Callable[[Gait], float]:
    """How far (in) a gait goes with a setting of the engine that the setting is for."""
    engine = "compiled" if isinstance(setting, CompiledSetting) else "drake"
    chosen = scenario.with_changes({"simulation.engine": engine})
    return lambda gait: run_setting(chosen, gait, setting).distance_in


def _warm_up(scenario: Scenario, gait: Gait) -> None:
    """Loads what the diagram calls, which belongs to no gait's wall time."""
    instant = scenario.with_changes(
        {
            "simulation.engine": "drake",
            "simulation.duration": 0.02,
            "simulation.steady_from": 0.01,
        }
    )
    run_setting(instant, gait, default_setting(instant))
