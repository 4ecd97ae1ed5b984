"""Model predictive control by sampled motions, `td.Planner`, without any search before."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

import numpy as np

from tetra_drake.lab.planner import Cost, Planner
from tetra_drake.robot.readings import Readings
from tetra_drake.robot.robot import Robot

if TYPE_CHECKING:
    from bench import Problem, Solution

HORIZON, DECISION_PERIOD, CONTROL_PERIOD = 1.5, 0.5, 0.1
EFFORT = 0.03
"""Weight of the work per weight, in m, beside the way."""


def ahead(readings: Readings) -> np.ndarray:
    """Minus the way along x."""
    return np.asarray(-readings.p_WN[-1, ..., 0].mean(axis=-1))


def left(readings: Readings) -> np.ndarray:
    """Minus the angle by which a row turns to the left."""
    row = readings.p_WN[..., -4:, :2].mean(axis=-2) - readings.p_WN[..., :4, :2].mean(axis=-2)
    headings = np.unwrap(np.arctan2(row[..., 1], row[..., 0]), axis=0)
    return np.asarray(headings[0] - headings[-1])


def cheaply_ahead(readings: Readings, *, weight: float) -> np.ndarray:
    """The way along x, and the work of the cables that shorten."""
    power = np.maximum(0.0, -readings.tensions * readings.rates).sum(axis=-1)
    return ahead(readings) + EFFORT * CONTROL_PERIOD * power.sum(axis=0) / weight


def solve(problem: Problem, seed: int) -> Solution:
    scenario = problem.scenario
    decisions = round(scenario.simulation.duration / DECISION_PERIOD)
    samples = int(problem.left / (decisions * HORIZON))
    problem.spend(samples * decisions * HORIZON)
    cheaply = functools.partial(cheaply_ahead, weight=Robot.of(scenario).weight)
    costs: dict[str, Cost] = {"turn": left, "efficient": cheaply}
    return Planner(
        scenario,
        costs.get(problem.task.name, ahead),
        samples=samples,
        horizon=HORIZON,
        knots=6,
        temperature=0.1,
        noise=0.5,
        decision_period=DECISION_PERIOD,
        seed=seed,
    )
