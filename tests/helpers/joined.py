"""Structures with cables over rings and with ball joints, and their motions by analysis."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from verification import PROBLEMS
from verification_references import formula

from helpers.anchored import TREES, scenario_of, supported_prism
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.changes import merged
from tetra_drake.scenario.scenario import Scenario

G = 9.80665
HEAVY, LIGHT, STIFFNESS, REACH = 0.2, 0.1, 1e3, 0.2
EXACT = {"rtol": 1e-10, "atol": 1e-12}

UPPER, LOWER = 0.4, 0.3
ATWOOD, STRING, DOUBLE, HINGED, RHOMBUS = (
    TREES[name] for name in ("atwood", "string", "double", "hinged", "rhombus")
)


def with_arm(**changes: object) -> Scenario:
    """The shipped prism on supports, with an arm on a ball joint and a driven cable over a ring at
    the arm's end."""
    return scenario_of(merged(supported_prism().robot.model_dump(), TREES["arm"]), **changes)


def released() -> Robot:
    """Atwood's machine without its load."""
    robot = Robot.of(scenario_of(ATWOOD, duration=0.4))
    structure = dataclasses.replace(robot.structure, node_load=0.0 * robot.structure.node_load)
    model = robot.model._replace(loads=structure.loads)
    return dataclasses.replace(robot, structure=structure, model=model)


def as_atwood(robot: Robot, times: np.ndarray) -> np.ndarray:
    """Weights on an elastic rope: the difference of momenta grows with the difference of weights,
    and the stretch s oscillates: s'' = 2 g - k s (1 / m + 1 / n)."""
    per_mass = 1.0 / HEAVY + 1.0 / LIGHT
    middle, square = 2.0 * G / (STIFFNESS * per_mass), STIFFNESS * per_mass
    before = LIGHT * G / STIFFNESS
    stretch = middle + (before - middle) * np.cos(np.sqrt(square) * times)
    moment = 0.5 * (HEAVY - LIGHT) * G * times**2
    heavy = (moment + LIGHT * (stretch - before)) / (HEAVY + LIGHT)
    start = np.array(robot.structure.p_WN)
    moved = np.tile(start, (len(times), 1, 1))
    names = robot.structure.node_names
    moved[:, names.index("a"), 2] -= heavy
    moved[:, names.index("b"), 2] -= stretch - before - heavy
    return moved


def plucked() -> Robot:
    return Robot.of(scenario_of(STRING | {"offsets": [[0.0, 0.0, 0.06]]}, duration=0.3))


def as_a_string(robot: Robot, times: np.ndarray) -> np.ndarray:
    """m z'' = -2 T z / l, with the length l of each half and the tension T = k (2 l - l0)."""

    def rate(_: float, y: np.ndarray) -> list[float]:
        half = np.hypot(REACH, y[0])
        return [y[1], -2.0 * STIFFNESS * (2.0 * half - 0.38) * y[0] / half / LIGHT]

    z = solve_ivp(rate, (0.0, times[-1]), [0.06, 0.0], t_eval=times, **EXACT).y[0]
    moved = np.tile(robot.structure.p_WN, (len(times), 1, 1))
    moved[:, robot.structure.node_names.index("p"), 2] = 1.0 + z
    return moved


def turned(robot: Robot, angles: dict[int, float], pivots: dict[int, np.ndarray]) -> Robot:
    """A robot whose bodies are turned by angles (rad) about the y axis, each about a pivot (two
    positions: before and after)."""
    p_WB, q_WB = robot.structure.p_WB.copy(), robot.structure.q_WB.copy()
    for body, angle in angles.items():
        before, after = pivots[body]
        turn = Rotation.from_euler("y", angle)
        p_WB[body] = after + turn.apply(p_WB[body] - before)
        q_WB[body] = np.roll(turn.as_quat(), 1)
    structure = dataclasses.replace(robot.structure, p_WB=p_WB, q_WB=q_WB)
    return dataclasses.replace(robot, structure=structure)


def along(angle: np.ndarray) -> np.ndarray:
    """Directions (times, 3) of a bar that hangs down and is turned by angles (times,) about y."""
    return np.stack([-np.sin(angle), 0.0 * angle, -np.cos(angle)], axis=-1)


LEANS = 0.5, 1.0


def folded(duration: float = 0.4) -> Robot:
    """The double pendulum with both bars aslant."""
    robot = Robot.of(scenario_of(DOUBLE, duration=duration))
    knee = np.array([0.0, 0.0, -UPPER]), UPPER * along(np.array(LEANS[0]))
    pivots = {0: np.zeros((2, 3)), 1: np.array(knee)}
    return turned(robot, dict(enumerate(LEANS)), pivots)


def as_a_double_pendulum(robot: Robot, times: np.ndarray) -> np.ndarray:
    """Lagrange's equations of two bars, for their angles from the vertical."""
    problem, (a, b) = PROBLEMS["double_pendulum"], LEANS
    states = problem["states"] | {"a": [a, "a_rate"], "b": [b, "b_rate"]}
    upper, lower = formula(times, problem | {"states": states, "known": "array([a, b])"})
    knee = UPPER * along(upper)
    return np.stack([0.0 * knee, knee, knee, knee + LOWER * along(lower)], axis=1)


def ajar(tree: dict[str, Any] = HINGED, duration: float = 0.5, **changes: object) -> Robot:
    """The triangle on its hinge, turned by 0.5 rad."""
    robot = Robot.of(scenario_of(tree, duration, **changes))
    return turned(robot, {1: LEANS[0]}, {1: np.tile([0.0, 0.0, 1.0], (2, 1))})


def swing(square: float, times: np.ndarray, *, angle: float, rate: float = 0.0) -> np.ndarray:
    """Angles (times,) of a pendulum, a'' = -square sin a, from an angle (rad) and a rate (rad/s) at
    time 0."""
    given = {"t_eval": times, **EXACT}
    return solve_ivp(
        lambda _, y: [y[1], -square * np.sin(y[0])], (0.0, times[-1]), [angle, rate], **given
    ).y[0]


def as_a_flap(robot: Robot, times: np.ndarray) -> np.ndarray:
    """A pendulum about the hinge, with the inertia of the triangle."""
    structure = robot.structure
    hinge = structure.node_names.index("c")
    lever = structure.p_BN[hinge, 2]
    square = G * lever / (structure.unit_inertia[1, 1] + lever**2)
    angle = swing(square, times, angle=LEANS[0])
    moved = np.tile(structure.p_WN, (len(times), 1, 1))
    moved[:, structure.node_names.index("e")] = [0.0, 0.0, 1.0] + 0.3 * along(angle)
    return moved
