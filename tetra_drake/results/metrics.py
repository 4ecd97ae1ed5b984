"""Metrics and fitness of a simulation."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from tetra_drake.formatting import fixed
from tetra_drake.laws.tally import Tally
from tetra_drake.robot.path import CentrePath
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import Structure, followed_nodes
from tetra_drake.scenario.metrics import METRICS, UNITS, Metrics, Poses, Walk, looks_for_distance
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.settings.units import INCH, current


def steady_start(scenario: Scenario) -> float:
    """Start (s) of the steady stretch. Mean values are over this stretch."""
    return max(scenario.simulation.settling_time, scenario.cpg.start_up)


def compute_metrics(
    robot: Robot, *, nodes: np.ndarray, path: CentrePath, totals: Tally, signals: np.ndarray
) -> Metrics:
    """The metrics of a simulation.

    Args:
        nodes: positions p_WN (3, nodes, 3) in m at 0, at `simulation.steady_from` and at the end.
        path: path of the centre.
        totals: tally of the whole simulation, as plain arrays.
        signals: signals (k, m) in N at evenly spaced times from `simulation.steady_from` on.
    """
    structure, scenario = robot.structure, robot.scenario
    steady_from = scenario.simulation.settling_time
    walk = Walk(
        **vars(poses_of(structure, nodes, float(path.times[-1] - steady_from))),
        path=path.centre[np.searchsorted(path.times, steady_from) :, :2],
        heading=path.heading,
        signals=signals,
        scale=structure.scale,
        weight=robot.weight,
        actuators=robot.driven.size,
        tally=totals,
    )
    return Metrics.of(walk, lacking=scenario.lacking, units=scenario.units)


def poses_of(structure: Structure, nodes: np.ndarray, since_steady_from: float) -> Poses:
    """The poses of a structure, from positions p_WN (3, nodes, 3) in m at three times. The last two
    are `since_steady_from` (s) apart."""
    return Poses(
        markers=followed_nodes(nodes, structure),
        tip=nodes[:, structure.p_WN[:, 0].argmax()],
        centre=structure.node_shares @ nodes,
        since_steady_from=since_steady_from,
    )


def pose_fitness(poses: Poses, objective: Mapping[str, float]) -> float:
    """The part of the fitness that follows from poses alone."""
    parts = {name: weight for name, weight in objective.items() if METRICS[name].of_pose}
    return sum(weight * float(METRICS[name].compute(poses)) for name, weight in parts.items())


def compute_fitness(metrics: Metrics, objective: Mapping[str, float]) -> float:
    """Fitness: the sum of metrics times the objective's weights (SI)."""
    total = 0.0
    for name, weight in objective.items():
        # Inches give Eq. 10 the constants of the thesis, and keep the digits of recorded numbers.
        unit = INCH if UNITS[name] == "m" else 1.0
        total += (weight * unit) * (getattr(metrics, name) / unit)
    return total


def headline_metric(objective: Mapping[str, float], metrics: Mapping[str, float]) -> str:
    """Name of the most important metric of a gait: the distance if the objective rewards it,
    otherwise the metric with the largest part in the fitness. Metrics that it only punishes do not
    count beside one that it rewards."""
    if looks_for_distance(objective):
        return "distance"
    rewarded = {name: weight for name, weight in objective.items() if weight > 0.0} or objective
    parts = {name: abs(weight * metrics[name]) for name, weight in rewarded.items()}
    return max(parts, key=lambda name: -1.0 if math.isnan(parts[name]) else parts[name])


def headline(scenario: Scenario, metrics: Mapping[str, float]) -> str:
    """Short result of a gait, chosen by the scenario's objective, such as "walks 14.3 inches in
    15 s"."""
    seconds = f"in {scenario.simulation.duration:g} s"
    units, distance = scenario.units, metrics["distance"]
    length = fixed(abs(distance) / units.length, units.decimals)
    way = [f"walks {length} {units.length_word}", "backward" if distance < 0.0 else ""]
    walk = " ".join(filter(None, [*way, scenario.terrain.where, seconds]))
    name = headline_metric(scenario.objective, metrics)
    if name == "distance":
        return walk
    if name == "heading_change":
        return f"turns {fixed(abs(math.degrees(metrics[name])), 0)} degrees {seconds}"
    return f"{name.replace('_', ' ')} {units.shown(metrics[name], UNITS[name])}, {walk}"


def unmet_requirements(metrics: Metrics, require: Mapping[str, float]) -> list[str]:
    """Texts about the metrics that do not meet their required SI values, such as "clearance is
    0.05 in, less than 0.125 in". NaN meets no requirement."""
    texts, shown = [], current(metrics.units).shown
    for name, limit in require.items():
        value, unit, is_cost = getattr(metrics, name), UNITS[name], METRICS[name].is_cost
        is_met = value <= limit if is_cost else value >= limit
        if not is_met:
            beyond = "more" if is_cost else "less"
            texts.append(f"{name} is {shown(value, unit)}, {beyond} than {shown(limit, unit)}")
    return texts
