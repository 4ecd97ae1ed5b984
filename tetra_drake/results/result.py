"""SimulationResult: what every engine returns; result.json and the summary made from it."""

from __future__ import annotations

import dataclasses
import json
import math
import platform
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tetra_drake.files import write_whole
from tetra_drake.formatting import fixed
from tetra_drake.results.metrics import Metrics, compute_fitness, compute_metrics
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.structure import Structure, node_positions
from tetra_drake.scenario.fields import tree_of
from tetra_drake.scenario.schema import Coulomb, Scenario
from tetra_drake.scenario.terrain import Flat
from tetra_drake.scenario.units import INCH

if TYPE_CHECKING:
    import xarray

SCHEMA = 1


@dataclass(frozen=True)
class IntegratorWork:
    """What the integrator was asked for and what that took."""

    scheme: str
    accuracy: float
    """Drake's target accuracy, the compiled engine's tolerance (m/s), or MuJoCo's step (s)."""
    steps: int
    derivative_evaluations: int
    jacobian_evaluations: int = 0
    """Derivative evaluations that went into Jacobian columns, among those above."""


@dataclass(frozen=True)
class SimulationResult:
    """What simulate() returns."""

    metrics: Metrics
    fitness: float
    duration: float
    """Simulated time in s."""
    wall_time: float
    """Time from the start of the integration to its end, in s; building is not in it."""
    integrator: IntegratorWork
    engine: str
    """That of the scenario."""
    trajectory: xarray.Dataset | None = field(default=None, repr=False)
    """See results.trajectory.assemble_dataset; None unless asked for."""


def make_result(
    scenario: Scenario,
    structure: Structure,
    *,
    states: Iterable[np.ndarray],
    wall_time: float,
    integrator: IntegratorWork,
    trajectory: xarray.Dataset | None,
) -> SimulationResult:
    """The result of a simulation on the scenario's engine.

    `states` are [q; v] of the bodies at t = 0, at the start of the steady stretch, and at the end;
    `wall_time` in s.
    """
    start, steady, end = (node_positions(structure, state) for state in states)
    metrics = compute_metrics(structure, start=start, steady=steady, end=end)
    return SimulationResult(
        metrics=metrics,
        fitness=compute_fitness(metrics, scenario.fitness),
        duration=scenario.simulation.duration,
        wall_time=wall_time,
        integrator=integrator,
        engine=scenario.simulation.engine,
        trajectory=trajectory,
    )


def versions(engine: str = "") -> dict[str, str]:
    """The versions on which the last digits of a result of an engine depend."""
    names = ["tetra_drake", "drake", "numpy", "numba"] + ["mujoco"] * (engine == "mujoco")
    packages = {name: metadata.version(name) for name in names}
    return packages | {"python": platform.python_version()}


def save_result(path: str | Path, scenario: Scenario, gait: Gait, result: SimulationResult) -> None:
    """Writes result.json: metrics in SI, lengths in inches beside them, times in s."""
    content = {
        "schema": SCHEMA,
        "scenario": scenario.name,
        "metrics": dataclasses.asdict(result.metrics),
        **result.metrics.in_inches(),
        "fitness": result.fitness,
        "duration_s": result.duration,
        "wall_time_s": result.wall_time,
        "real_time_factor": result.duration / result.wall_time,
        "engine": result.engine,
        "integrator": dataclasses.asdict(result.integrator),
        "versions": versions(result.engine),
        "gait": gait.to_json(scenario),
    }
    write_whole(path, json.dumps(content, indent=1, allow_nan=False) + "\n")


def ground_text(scenario: Scenario) -> str:
    """On what the robot walks, in a line; empty for the thesis's flat ground and friction.

    As "incline (slope 5 deg), Coulomb friction (static 0.5, kinetic 0.5)". Lengths are in inches;
    values that are their defaults are left out, but for the coefficients of friction.
    """
    terrain, law = scenario.terrain, scenario.friction
    if isinstance(law, Coulomb):
        numbers = {"static": law.static, "kinetic": law.kinetic}
        friction = f"Coulomb friction ({_listed(numbers | tree_of(law, _shown, sparse=True))})"
    elif scenario.simulation.engine == "mujoco":
        friction = f"MuJoCo's friction (coefficient {scenario.mujoco.friction:g})"
    elif isinstance(terrain, Flat):
        return ""
    else:
        friction = "the thesis's friction"
    sizes = _listed(tree_of(terrain, _shown, sparse=True))
    return f"{type(terrain).__name__.lower()}{f' ({sizes})' if sizes else ''}, {friction}"


def _shown(number: float, unit: str) -> str:
    """A quantity as people read it; `unit` is SI."""
    factor, name = {"m": (INCH, "in"), "rad": (math.pi / 180.0, "deg")}.get(unit, (1.0, unit))
    return f"{number / factor:.4g} {name}"


def _listed(values: Mapping[str, Any]) -> str:
    texts = {k: " ".join(v) if isinstance(v, list) else str(v) for k, v in values.items()}
    return ", ".join(f"{k} {Path(v).name if k == 'file' else v}" for k, v in texts.items())


def summary(scenario: Scenario, gait: Gait, result: SimulationResult) -> str:
    """Metrics, lengths in inches, and what the simulation took, as lines for the terminal."""
    metrics, work = result.metrics, result.integrator
    after = f"from {scenario.simulation.steady_from:g} s on"
    rows = [
        ("distance", metrics.distance, ""),
        ("steady distance", metrics.steady_distance, after),
        ("twist", metrics.twist, "x1 - x2 at the end: turned about the vertical"),
        ("lateral drift", metrics.lateral_drift, ""),
    ]
    lines = [f"{gait.name}: {result.duration:g} s on scenario {scenario.name}"]
    if ground := ground_text(scenario):
        lines.append(f"  ground: {ground}")
    for name, metres, note in rows:
        line = f"  {name:<16}{fixed(metres / INCH):>8} in   {f'({note})' if note else ''}"
        lines.append(line.rstrip())
    lines.append(f"  {'fitness':<16}{fixed(result.fitness):>8}")
    reference = scenario.reference
    if reference is not None:
        best = {"random": reference.best_initial_distance, "evolved": reference.best_distance}
        texts = [f"{name} {d / INCH:.4g} in" for name, d in best.items() if d is not None]
        lines.append(f"  {reference.source}: best distances {', '.join(texts)}")
    speed = fixed(result.duration / result.wall_time, 1)
    lines.append(
        f"  simulated in {fixed(result.wall_time, 1)} s, {speed} times real time: {work.scheme}, "
        f"accuracy {work.accuracy:g}, {work.steps} steps, "
        f"{work.derivative_evaluations} derivative evaluations"
    )
    return "\n".join(lines)
