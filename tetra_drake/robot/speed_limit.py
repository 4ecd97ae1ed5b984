"""Speed limit of a simulation: a robot with a faster body has diverged."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from tetra_drake.laws.actuator import limits_of
from tetra_drake.laws.cable import CableLaw, elastic_energy, elastic_tension
from tetra_drake.robot.signals import DrivenRobot
from tetra_drake.robot.structure import node_positions

LEAST_LIMIT = 10.16
"""Least default of the limit in m/s (400 in/s)."""


def speed_limit(driven: DrivenRobot) -> float:
    """Speed (m/s) of a body above which a simulation counts as diverged: `simulation.max_speed`, by
    default a speed that the robot cannot reach.

    The default is the speed of the lightest body if it had all possible energy. This is the energy
    of a fall from the robot's top to the lowest ground, of the cables and of the motion at the
    start, and of a pull by each actuator over the length of its cable. To it are added the speed
    that loads, and the weight downhill or without ground, can give the whole robot in the duration,
    and what pushes can give the lightest body. The default is at least 10.16 m/s (LEAST_LIMIT).
    """
    robot = driven.robot
    scenario, structure = robot.scenario, robot.structure
    if scenario.simulation.max_speed is not None:
        return scenario.simulation.max_speed
    start, slope = node_positions(structure, structure.initial_state), scenario.terrain.plane_slope
    above = start[:, 2] - start[:, 0] * math.tan(slope or 0.0)
    fall = max(0.0, above.max() - (robot.ground.heights.min() if slope is None else 0.0))
    law, cpg = CableLaw.of(structure.cables), scenario.cpg
    length: Any = structure.initial_lengths
    stretch = length - law.free_length
    if structure.slack:
        stretch = np.maximum(stretch, 0.0)
    pull = limits_of(robot.model.actuator).max_force
    if math.isnan(pull):  # actuators without limits
        pull = max(2.0 * cpg.usual_amplitude, np.abs(driven.samples).max(initial=0.0))
    # A pull is at most the force that stretches the cable by its whole length.
    pulls = np.minimum(pull, elastic_tension(length, law)) * length
    energy = float(np.sum(elastic_energy(stretch, law)) + pulls[robot.driven].sum())
    if structure.v_WB is not None:
        spins, speeds = (structure.v_WB.reshape(-1, 2, 3) ** 2).sum(axis=2).T
        moments = 0.5 * structure.unit_inertia[:, :3].sum(axis=1)  # no axis has a larger one
        energy += float(0.5 * structure.mass @ (speeds + moments * spins))
    speed = math.sqrt(2.0 * (robot.weight * fall + energy))
    speed /= math.sqrt(structure.mass.min())
    pushes = [event.push.impulse for event in scenario.events if event.push]
    speed += sum(map(np.linalg.norm, pushes)) / structure.mass.min()
    downhill = math.sin(abs(slope or 0.0)) if structure.contacts.size else 1.0
    pushed = np.linalg.norm(structure.node_load, axis=1).sum() / structure.mass.sum()
    acceleration = downhill * scenario.robot.gravity + pushed
    return max(LEAST_LIMIT, float(speed + acceleration * scenario.simulation.duration))
