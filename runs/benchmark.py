"""Measures the speed and the accuracy of the engines.

    python runs/benchmark.py [TABLE ...]

Prints tables in Markdown, as in tetra_drake/engines/README.md, of random gaits of seeds 0, 1 ...
on the scenario `thesis`; without names, all but `integrators`:

    engines        speed and error of the engines, each with a few settings
    integrators    the same for settings of the diagram; takes longest
    batches        speed with many gaits at a time, on one core and on all
    sizes          cost of a step of the compiled engine by the number of tetrahedra
    grounds        speed by ground, friction and network

Errors are of distances, against converged runs of the compiled engine (MuJoCo's against its own,
as its ground differs). Times are meaningful on an idle machine only.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from tetra_drake.engines.mujoco import installed
from tetra_drake.engines.simulate import simulate_many
from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.formatting import Table, fixed, listed
from tetra_drake.machine import available_cores
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.gait import seeded_gait
from tetra_drake.scenario.engine_kinds import Mujoco
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.schema import Scenario

Changes = Mapping[str, object]

GAITS = 12  # for each setting
BATCHES = (1, 2, 4, 8, 30, 240)  # gaits at a time on the compiled engine
MUJOCO_BATCH = 4  # gaits at a time in MuJoCo, for each core
SIZES = (5, 10, 20, 40)  # numbers of tetrahedra
LANES = 8  # gaits at a time for the cost of a step
GROUND_BATCH = 30  # gaits at a time on each ground
ROUNDS = 3  # measurements, of which the medians count

DRAKE = {"engine": "!Drake"}
COMPILED = {"engine": "!Compiled"}
MUJOCO = {"engine": "!Mujoco"}
FINE = {"tolerance": "0.001 mm/s", "max_step": "0.5 ms", "look_ahead": "0.001 ms"}
CONVERGED = COMPILED | {f"engine.{key}": value for key, value in FINE.items()}
MUJOCO_CONVERGED = MUJOCO | {"engine.step": "0.0625 ms"}
FAST_MUJOCO = MUJOCO | {"engine.step": "2 ms"}
EXPLICIT = {
    "engine.scheme": "runge_kutta3",
    "engine.accuracy": 1e-3,
    "engine.max_step": "2 ms",
}
STEP_END, WITNESS = {"engine.look_ahead": "0 s"}, {"engine.mode_changes": "witness"}

SETTINGS: dict[str, list[Changes]] = {
    "engines": [
        DRAKE,
        DRAKE | EXPLICIT | STEP_END,
        COMPILED,
        MUJOCO,
        FAST_MUJOCO,
    ],
    "integrators": [
        DRAKE,
        DRAKE | STEP_END,
        DRAKE | WITNESS,
        DRAKE | {"engine.accuracy": 1e-3},
        DRAKE | EXPLICIT | STEP_END,
        DRAKE | EXPLICIT | WITNESS,
    ],
}


class Batch(NamedTuple):
    """Random gaits, of seeds 0, 1 ..., to be simulated at the same time."""

    scenario: Scenario
    gaits: int
    cores: int = 1


class Timing(NamedTuple):
    """Speed and cost of a batch."""

    speed: float
    """Times real time, of all gaits together."""
    step_cost: float
    """Time of one step of one gait, in μs of a core."""
    steps: float
    """Number of steps of all gaits."""


def measure(batches: Sequence[Batch]) -> list[Timing]:
    """Medians of rounds in which batches take turns, so that whatever else runs on the machine
    affects all alike. Gaits that fail do not count."""
    for batch in batches:
        timing_of(batch._replace(scenario=brief(batch.scenario)))
    rounds = [[timing_of(batch) for batch in batches] for _ in range(ROUNDS)]
    return [Timing(*np.median(timings, axis=0)) for timings in zip(*rounds, strict=True)]


def timing_of(batch: Batch) -> Timing:
    """Speed and cost of a batch, measured once."""
    scenario, count, cores = batch
    started = time.perf_counter()
    gaits = [seeded_gait(scenario, seed) for seed in range(count)]
    outcomes = simulate_many(scenario=scenario, gaits=gaits, workers=cores)
    seconds = time.perf_counter() - started
    results = successes(scenario, outcomes)
    steps = sum(result.integrator.steps for result in results)
    cost = 1e6 * sum(result.wall_time for result in results) / steps
    return Timing(sum(result.duration for result in results) / seconds, cost, steps)


def settings_table(scenario: Scenario, settings: Sequence[Changes]) -> str:
    """Speed and error of settings."""
    walking = [seeded_gait(scenario, seed) for seed in range(GAITS)]
    exact_in: dict[str, np.ndarray] = {}
    rows = []
    for changes in settings:
        changed = scenario.with_changes(changes)
        engine = changed.engine_name
        if engine == "mujoco" and not installed():
            continue
        if engine not in exact_in:
            fine = scenario.with_changes(MUJOCO_CONVERGED if engine == "mujoco" else CONVERGED)
            exact_in[engine] = distances_in(simulate_many(scenario=fine, gaits=walking))
        simulate_many(scenario=brief(changed), gaits=walking[:1], workers=1)
        started = time.perf_counter()
        # One at a time: together they would share a core's lanes.
        outcomes = [simulate_many(scenario=changed, gaits=[g], workers=1)[0] for g in walking]
        speed = GAITS * changed.simulation.duration / (time.perf_counter() - started)
        results = successes(changed, outcomes)
        errors_in = np.abs(distances_in(outcomes) - exact_in[engine])
        errors = [fixed(np.nanmedian(errors_in), 3), fixed(np.nanmax(errors_in), 3)]
        evaluations = [result.integrator.derivative_evaluations for result in results]
        counts = [f"{statistics.mean(evaluations):,.0f}", str(GAITS - len(results))]
        values = [f"{key.partition('.')[2]} {value}" for key, value in changes.items()]
        rows.append([engine, ", ".join(values[1:]) or "default", f"{speed:.3g}", *errors, *counts])
    headings = ["engine", "setting", "times real time per core", "median error, in"]
    headings += ["worst error, in", "evaluations per gait", "failed"]
    return Table(headings, rows, text_columns=(0, 1)).markdown()


def successes(
    scenario: Scenario, outcomes: Sequence[SimulationResult | SimulationFailure]
) -> list[SimulationResult]:
    """The results; InputError if all simulations failed."""
    results = [outcome for outcome in outcomes if isinstance(outcome, SimulationResult)]
    if not results:
        raise InputError(f"scenario {scenario.name}", "", f"no gait walks: {outcomes[0]}")
    return results


def distances_in(outcomes: Sequence[SimulationResult | SimulationFailure]) -> np.ndarray:
    """Distances (in) of gaits, NaN where the simulation failed."""
    walked = [o.metrics.distance_in if isinstance(o, SimulationResult) else None for o in outcomes]
    return np.array(walked, dtype=float)


def brief(scenario: Scenario) -> Scenario:
    """A simulation that only loads and compiles what is measured later."""
    return scenario.with_changes(
        {"simulation.duration": "0.02 s", "simulation.steady_from": "0.01 s"}
    )


def batches_table(scenario: Scenario) -> str:
    """Speed with many gaits at a time, on one core and on all that they fill."""
    batches = []
    for cores in sorted({1, available_cores()}):
        ours = scenario.with_changes(COMPILED)
        batches += [Batch(ours, size, cores) for size in BATCHES if size >= cores]
        for changes in (MUJOCO, FAST_MUJOCO) if installed() else ():
            batches.append(Batch(scenario.with_changes(changes), cores * MUJOCO_BATCH, cores))
    rows = []
    for batch, timing in zip(batches, measure(batches), strict=True):
        engine: str = batch.scenario.engine_name
        if engine == "mujoco":
            step = batch.scenario.settings_of(Mujoco).step
            engine += f", steps of {1e3 * step:g} ms"
        rows.append([engine, str(batch.gaits), str(batch.cores), f"{timing.speed:,.1f}"])
    return Table(["engine", "gaits at a time", "cores", "times real time"], rows).markdown()


def sizes_table(scenario: Scenario) -> str:
    """Cost of a step of the compiled engine by the number of tetrahedra."""
    robots = [scenario.with_changes(COMPILED | {"robot.tetrahedra": size}) for size in SIZES]
    timings = measure([Batch(robot, gaits) for robot in robots for gaits in (1, LANES)])
    rows = []
    for size, alone, in_lanes in zip(SIZES, timings[::2], timings[1::2], strict=True):
        costs = [alone.step_cost, alone.step_cost / size]
        costs += [in_lanes.step_cost, in_lanes.step_cost / size]
        rows.append([str(size), f"{alone.steps:,.0f}", *map(fixed, costs)])
    headings = ["tetrahedra", "steps", "μs per step", "and tetrahedron"]
    headings += [f"one of {LANES}: μs per step", "and tetrahedron"]
    return Table(headings, rows, text_columns=()).markdown()


def grounds_table(scenario: Scenario) -> str:
    """Speed on one core by ground, friction and network."""
    shipped = load_scenario("rough")
    rough: Changes = {"terrain": shipped.terrain, "robot.contacts": shipped.robot.contacts}
    coulomb: Changes = {"friction": shipped.friction, "engine": shipped.engine}
    grounds: dict[str, Changes] = {
        "the scenario's": {},
        "signals computed beforehand": {"cpg.signals": "listing", "cpg.feedback": []},
        "live network": {"cpg.signals": "live"},
        "Coulomb friction": coulomb,
        "rough": rough,
        "rough, Coulomb friction": {**rough, **coulomb},
    }
    columns = (COMPILED, 1), (COMPILED, GROUND_BATCH), (DRAKE, 1)
    walks = [scenario.with_changes(changes) for changes in grounds.values()]
    timings = measure([Batch(walk.with_changes(e), n) for walk in walks for e, n in columns])
    rows = []
    for k, name in enumerate(grounds):
        alone, many, diagram = timings[3 * k : 3 * k + 3]
        speeds = [f"{alone.speed:,.0f}", f"{many.speed:,.0f}", fixed(diagram.speed)]
        rows.append([name, f"{many.steps / GROUND_BATCH:,.0f}", *speeds])
    headings = ["ground", "steps per gait", "compiled, one gait", f"{GROUND_BATCH} gaits", "drake"]
    return Table(headings, rows).markdown()


TABLES = {"batches": batches_table, "sizes": sizes_table, "grounds": grounds_table}


def main(names: Sequence[str], scenario: Scenario) -> None:
    """Prints the tables of the given names, or all but `integrators`. Raises InputError."""
    tables = [*SETTINGS, *TABLES]
    if unknown := {*names} - {*tables}:
        raise InputError("TABLE", "", f"found {listed([*unknown])}, expected {listed(tables)}")
    for name in names or ["engines", *TABLES]:
        if name in SETTINGS:
            table = settings_table(scenario, SETTINGS[name])
        else:
            table = TABLES[name](scenario)
        print(f"{table}\n", flush=True)


if __name__ == "__main__":
    try:
        main(sys.argv[1:], load_scenario("thesis"))
    except InputError as error:
        sys.exit(f"benchmark.py: {error}")
