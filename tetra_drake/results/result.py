"""SimulationResult: what every engine returns; result.json and the summary made from it."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tetra_drake.files import json_number, write_whole
from tetra_drake.formatting import fixed
from tetra_drake.machine import versions
from tetra_drake.results.metrics import (
    Totals,
    compute_fitness,
    compute_metrics,
    headline_metric,
    unmet_requirements,
)
from tetra_drake.results.path import PERIOD, CentrePath, follow
from tetra_drake.results.trajectory import sample_times
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.structure import Structure, node_positions
from tetra_drake.scenario.fields import tree_of
from tetra_drake.scenario.metric_units import Metrics
from tetra_drake.scenario.schema import Coulomb, Scenario, SimulationScenario
from tetra_drake.scenario.terrain_kinds import Flat
from tetra_drake.scenario.units import INCH, POUND_FORCE, shown

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
    path: CentrePath = field(repr=False, compare=False)
    """Of the robot's centre from start to end, in steps of results.path.PERIOD."""
    trajectory: xarray.Dataset | None = field(default=None, repr=False)
    """See results.trajectory.assemble_dataset; None unless asked for."""


def result_times(simulation: SimulationScenario) -> np.ndarray:
    """The times (s), ascending, at which make_result() needs the states of a simulation."""
    return np.unique([*_ends(simulation), *_path_times(simulation)])


def _ends(simulation: SimulationScenario) -> tuple[float, float, float]:
    return 0.0, simulation.steady_from, simulation.duration


def _path_times(simulation: SimulationScenario) -> np.ndarray:
    return sample_times(simulation.duration, PERIOD)


def make_result(
    scenario: Scenario,
    structure: Structure,
    *,
    times: np.ndarray,
    states: np.ndarray,
    signals: np.ndarray,
    totals: Totals,
    mass: float,
    wall_time: float,
    integrator: IntegratorWork,
    trajectory: xarray.Dataset | None,
) -> SimulationResult:
    """The result of a simulation on the scenario's engine.

    `times` (k,) in s, ascending, are those of result_times(), and maybe more; `states` (k, 13 n)
    are [q; v] of the bodies and `signals` (k, m) those of the oscillators, in N, then; `totals` are
    of the whole simulation; `mass` of a tetrahedron in kg, `wall_time` in s.
    """
    simulation, bodies = scenario.simulation, len(structure.bodies)
    ends = np.searchsorted(times, _ends(simulation))
    start, steady, end = (node_positions(structure, states[i]) for i in ends)
    instants = _path_times(simulation)
    rows = np.searchsorted(times, instants)
    poses = states[rows, : 7 * bodies].reshape(-1, bodies, 7)
    path = follow(instants, poses)
    metrics = compute_metrics(
        structure,
        start=start,
        steady=steady,
        end=end,
        path=path,
        steady_from=simulation.steady_from,
        totals=totals,
        signals=signals[rows[instants >= simulation.steady_from]],
        weight=bodies * mass * scenario.robot.gravity,
    )
    return SimulationResult(
        metrics=metrics,
        fitness=compute_fitness(metrics, scenario.objective),
        duration=simulation.duration,
        wall_time=wall_time,
        integrator=integrator,
        engine=simulation.engine,
        path=path,
        trajectory=trajectory,
    )


def save_result(path: str | Path, scenario: Scenario, gait: Gait, result: SimulationResult) -> None:
    """Writes result.json: metrics in SI, lengths in inches beside them, times in s, and the path of
    the centre as columns."""
    way, radius = result.path, result.metrics.path_radius
    content = {
        "schema": SCHEMA,
        "scenario": scenario.name,
        "metrics": result.metrics.to_json(),
        **result.metrics.in_inches(),
        "path_radius_in": json_number(radius / INCH),
        "fitness": result.fitness,
        "duration_s": result.duration,
        "wall_time_s": result.wall_time,
        "real_time_factor": result.duration / result.wall_time,
        "engine": result.engine,
        "integrator": dataclasses.asdict(result.integrator),
        "versions": versions(result.engine),
        "gait": gait.to_json(scenario),
        "path": {
            "time_s": way.times.tolist(),
            "x_m": way.centre[:, 0].tolist(),
            "y_m": way.centre[:, 1].tolist(),
            "heading_rad": way.heading.tolist(),
        },
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
        friction = f"Coulomb friction ({_listed(numbers | tree_of(law, shown, sparse=True))})"
    elif scenario.simulation.engine == "mujoco":
        friction = f"MuJoCo's friction (coefficient {scenario.mujoco.friction:g})"
    elif isinstance(terrain, Flat):
        return ""
    else:
        friction = "the thesis's friction"
    sizes = _listed(tree_of(terrain, shown, sparse=True))
    return f"{type(terrain).__name__.lower()}{f' ({sizes})' if sizes else ''}, {friction}"


def _listed(values: Mapping[str, Any]) -> str:
    texts = {k: " ".join(v) if isinstance(v, list) else str(v) for k, v in values.items()}
    return ", ".join(f"{k} {Path(v).name if k == 'file' else v}" for k, v in texts.items())


def summary(scenario: Scenario, gait: Gait, result: SimulationResult) -> str:
    """Metrics, lengths in inches, and what the simulation took, as lines for the terminal."""
    metrics = result.metrics
    after = f"from {scenario.simulation.steady_from:g} s on"
    side = "to the left" if metrics.path_curvature > 0.0 else "to the right"
    diameter = shown(scenario.robot.strut_diameter, "m")
    clearance = f"least, between the axes of struts, which overlap below {diameter}"
    bends = "straight" if math.isinf(metrics.path_radius) else side
    rows = [
        ("distance", metrics.distance / INCH, "in", ""),
        ("steady distance", metrics.steady_distance / INCH, "in", after),
        ("twist", metrics.twist / INCH, "in", "x1 - x2 at the end: turned about the vertical"),
        ("lateral drift", metrics.lateral_drift / INCH, "in", ""),
        ("heading change", math.degrees(metrics.heading_change), "deg", "positive to the left"),
        ("path radius", metrics.path_radius / INCH, "in", f"{bends}, {after}"),
        ("actuator work", metrics.actuator_work, "J", after),
        ("cost of transport", metrics.cost_of_transport, "", "work over weight and way"),
        ("signal rate", metrics.signal_rate / POUND_FORCE, "lbf/s", "root mean square"),
        ("lifted", 100.0 * metrics.lifted, "%", "of the time, mean of the tetrahedra"),
        ("clearance", metrics.clearance / INCH, "in", clearance),
        ("tension", metrics.tension / POUND_FORCE, "lbf", "least of a cable"),
        ("travelling", metrics.travelling_index, "", "index of the signals: 0 stand, 1 travel"),
    ]
    first = headline_metric(scenario.objective, vars(metrics)).replace("_", " ")
    rows.sort(key=lambda row: row[0] != first)
    lines = [f"{gait.name}: {result.duration:g} s on scenario {scenario.name}"]
    if ground := ground_text(scenario):
        lines.append(f"  ground: {ground}")
    for name, value, unit, note in rows:
        line = f"  {name:<17}{fixed(value):>7} {unit:<5} {f'({note})' if note else ''}"
        lines.append(line.rstrip())
    lines.append(f"  {'fitness':<17}{fixed(result.fitness):>7}")
    unmet = unmet_requirements(metrics, scenario.require)
    lines += [f"  {text} (requirement not met)" for text in unmet]
    reference = scenario.reference
    if reference is not None:
        best = {"random": reference.best_initial_distance, "evolved": reference.best_distance}
        texts = [f"{name} {d / INCH:.4g} in" for name, d in best.items() if d is not None]
        lines.append(f"  {reference.source}: best distances {', '.join(texts)}")
    speed = fixed(result.duration / result.wall_time, 1)
    lines.append(
        f"  simulated in {fixed(result.wall_time, 1)} s, {speed} times real time: "
        f"{_work_text(result)}"
    )
    return "\n".join(lines)


def _work_text(result: SimulationResult) -> str:
    """What the integrator of an engine was asked for, and what it took."""
    work = result.integrator
    if result.engine == "mujoco":
        return f"{work.scheme}, {work.steps} steps of {1e3 * work.accuracy:g} ms"
    asked = "accuracy {:g}" if result.engine == "drake" else "tolerance {:g} m/s"
    evaluations = f"{work.derivative_evaluations} derivative evaluations"
    return f"{work.scheme}, {asked.format(work.accuracy)}, {work.steps} steps, {evaluations}"
