"""The metrics of a simulation, and the fitness that a scenario's objective makes of them."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from tetra_drake.formatting import fixed
from tetra_drake.physics.actuator import has_drive
from tetra_drake.physics.tally import Tally
from tetra_drake.results.measures import travelling_index
from tetra_drake.robot.path import CentrePath, curvature
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import followed_nodes
from tetra_drake.scenario.metrics import LEAST_WAY, METRICS, MOST, Metrics, looks_for_distance
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.scenario.units import INCH, shown


def steady_start(scenario: Scenario) -> float:
    """Time (s) at which the steady stretch begins, over which means are taken."""
    return max(scenario.simulation.steady_from, scenario.cpg.start_up)


def empty_tally(robot: Robot) -> Tally:
    """The tally of a walk that begins."""
    structure = robot.structure
    return Tally(
        begins=np.array([steady_start(robot.scenario)]),
        time=np.zeros(1),
        signals=np.zeros(structure.signals),
        lengths=np.zeros(len(structure.cables)),
        work=np.zeros(1),
        peaks=np.zeros(3),
        sums=np.zeros(4),
        roughness=np.zeros(1),
        lifted=np.zeros(len(structure.bodies)),
        tension=np.array([math.inf]),
        clearance=np.array([math.inf]),
    )


def compute_metrics(
    robot: Robot,
    *,
    start: np.ndarray,
    steady: np.ndarray,
    end: np.ndarray,
    path: CentrePath,
    totals: Tally,
    signals: np.ndarray,
) -> Metrics:
    """The metrics of a walk.

    `start`, `steady` and `end` are node positions p_WN (nodes, 3) in m at 0, at
    `simulation.steady_from` and at the end. `path` is that of the centre. `totals` is the tally of
    the whole walk, as plain arrays. `signals` (k, m) in N are those at evenly spaced times of the
    steady stretch.
    """
    structure, steady_from = robot.structure, robot.scenario.simulation.steady_from
    first, middle, last = (followed_nodes(nodes, structure) for nodes in (start, steady, end))
    way, twist, lead = last[0] - middle[0], math.nan, math.nan
    if structure.markers.size:
        way = end.mean(axis=0) - steady.mean(axis=0)  # of the centre, as recorded
        twist = float(abs(last[0, 0] - last[1, 0]))
        lead = float(end[-1, 0] - last[0, 0])  # of the foremost tip, the last node
    x_way, y_way, _ = way.tolist()
    steady_path = path.centre[np.searchsorted(path.times, steady_from) :, :2]
    work = float(totals.work[0])
    carried = robot.weight * max(math.hypot(x_way, y_way), LEAST_WAY)
    steady_time = max(0.0, totals.time[0] - totals.begins[0])
    per_time = 1.0 / float(steady_time or 1)
    lifted = (per_time * totals.lifted).tolist()
    peak_force, peak_speed, peak_power = totals.peaks.tolist()
    per_actuator = per_time / max(robot.driven.size, 1)
    force, speed, power, limited = (per_actuator * totals.sums).tolist()
    return Metrics(
        distance=float(last[0, 0] - first[0, 0]),
        steady_distance=float(last[0, 0] - middle[0, 0]),
        speed=float(x_way / (path.times[-1] - steady_from)),
        twist=twist,
        lead=lead,
        lateral_drift=float(abs(last[0, 1] - first[0, 1])),
        heading_change=float(path.heading[-1] - path.heading[0]),
        path_curvature=curvature(steady_path),
        actuator_work=work,
        cost_of_transport=work / carried if carried else math.inf,
        signal_rate=math.sqrt(per_time * float(totals.roughness[0]) / max(structure.signals, 1)),
        lifted=sum(lifted) / len(lifted),
        clearance=float(totals.clearance[0]),
        tension=float(totals.tension[0]),
        travelling_index=travelling_index(signals),
        peak_actuator_force=peak_force,
        mean_actuator_force=force,
        peak_actuator_speed=peak_speed,
        mean_actuator_speed=speed,
        peak_actuator_power=peak_power,
        mean_actuator_power=power,
        actuator_limited=limited if has_drive(robot.model.actuator) else math.nan,
        lifted_shares=tuple(lifted),
    )


def compute_fitness(metrics: Metrics, objective: Mapping[str, float]) -> float:
    """The sum of the metrics times an objective's weights, which are SI; Eq. 10 by default."""
    total = 0.0
    for name, weight in objective.items():
        # In inches, so that Eq. 10 has the thesis's constants, and its numbers their digits.
        unit = INCH if METRICS[name] == "m" else 1.0
        total += (weight * unit) * (getattr(metrics, name) / unit)
    return total


def headline_metric(objective: Mapping[str, float], metrics: Mapping[str, float]) -> str:
    """The metric that says most about a gait: the distance if the objective looks for it, else the
    one with the largest part in the fitness."""
    if looks_for_distance(objective):
        return "distance"
    parts = {name: abs(weight * metrics[name]) for name, weight in objective.items()}
    return max(parts, key=lambda name: -1.0 if math.isnan(parts[name]) else parts[name])


def headline(scenario: Scenario, metrics: Mapping[str, float]) -> str:
    """What a gait does, by its scenario's objective, such as "walks 14.3 inches in 15 s"."""
    seconds = f"in {scenario.simulation.duration:g} s"
    inches = metrics["distance"] / INCH
    backward = " backward" if inches < 0.0 else ""
    walk = f"walks {fixed(abs(inches), 1)} inches{backward}{_ground(scenario)} {seconds}"
    name = headline_metric(scenario.objective, metrics)
    if name == "distance":
        return walk
    if name == "heading_change":
        return f"turns {fixed(abs(math.degrees(metrics[name])), 0)} degrees {seconds}"
    return f"{name.replace('_', ' ')} {shown(metrics[name], METRICS[name])}, {walk}"


_GROUNDS = {"Rough": "on rough ground", "Steps": "over steps", "Obstacles": "over obstacles"}
"""How one says where the robot walks, by kind of terrain."""


def _ground(scenario: Scenario) -> str:
    """Where the robot walks unless the ground is level, as " on rough ground"."""
    slope = scenario.terrain.plane_slope
    if slope is None:
        return f" {_GROUNDS.get(type(scenario.terrain).__name__, 'on uneven ground')}"
    if slope == 0.0:
        return ""
    return f" {'up' if slope > 0.0 else 'down'} {abs(math.degrees(slope)):.3g} degrees"


def unmet_requirements(metrics: Metrics, require: Mapping[str, float]) -> list[str]:
    """Metrics beyond their required SI values, or NaN: name, value and limit, as
    "clearance is 0.05 in, less than 0.125 in"."""
    texts = []
    for name, limit in require.items():
        value, unit = getattr(metrics, name), METRICS[name]
        is_met = value <= limit if name in MOST else value >= limit
        if not is_met:
            beyond = "more" if name in MOST else "less"
            texts.append(f"{name} is {shown(value, unit)}, {beyond} than {shown(limit, unit)}")
    return texts
