"""References of the problems of verification/problems.yaml.

A reference is a formula of the file, see formula(), or a function here. It knows the numbers of the
problem, not the engines.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from types import CodeType
from typing import Any

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RotationMatrix
from pydrake.multibody.tree import SpatialInertia, UnitInertia
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from scipy.special import ellipj, ellipk

from tetra_drake.lab.study.equilibrium import (
    EquilibriumStudy,
    robot_of_structure,
    study_equilibrium,
)
from tetra_drake.laws.matsuoka import Network
from tetra_drake.scenario.robot_structure import StructureFile
from tetra_drake.systems import MatsuokaCpg

G = 9.80665
Array = np.ndarray
Case = Mapping[str, Any]
"""A problem with one of its cases: also its `robot`, `ground`, `start`, and the place `first` of a
node that is followed."""
FUNCTIONS = vars(np) | {"G": G, "ellipj": ellipj, "ellipk": ellipk}
"""Functions and constants in formulas."""


def solved(rate: Callable[..., Any], start: Any, times: Array, **options: Any) -> Array:
    """States (states, times) by SciPy's solve_ivp with small errors."""
    given = {"rtol": 1e-11, "atol": 1e-12, "method": "DOP853"} | options
    return np.asarray(solve_ivp(rate, (0.0, times[-1]), start, t_eval=times, **given).y)


def formula(times: Array, case: Case) -> Array:
    """Values (times,) of the formula `known`. It has the names in the case, the time t, `states` of
    differential equations, given by their starts and rates, and what `let` derives from these."""

    def code(text: object) -> CodeType:
        return compile(str(text), case["name"], "eval")

    states = case.get("states", {})
    rates = [code(rate) for _, rate in states.values()]
    derived = {name: code(text) for name, text in case.get("let", {}).items()}

    def names_at(t: Any, y: Any) -> dict[str, Any]:
        names = {**case, "t": t, **dict(zip(states, y, strict=True))}
        for name, each in derived.items():
            names[name] = eval(each, FUNCTIONS, names)
        return names

    def rate(t: float, y: Array) -> list[float]:
        names = names_at(t, y)
        return [eval(each, FUNCTIONS, names) for each in rates]

    start = [eval(code(each), FUNCTIONS, {**case}) for each, _ in states.values()]
    y = solved(rate, start, times, **case.get("solver", {})) if states else np.zeros(0)
    return np.asarray(eval(code(case["known"]), FUNCTIONS, names_at(times, y)) + 0.0 * times)


# Bodies


POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 0, -1], [1, 1, -1], [0, 1, -1], [0, 1, 0]], float)
AXES = np.cross(POINTS - np.roll(POINTS, 1, axis=0), np.roll(POINTS, -1, axis=0) - POINTS)
"""Joints of Bricard's linkage, along edges of a cube, and their axes."""


def bricard(times: Array, case: Case) -> Array:
    phase = np.linspace(0.0, 2.0 * math.pi, 1201)
    a = 2.0 * np.arctan(math.sqrt(3.0) * np.cos(phase))
    b = 2.0 * np.arcsin(math.sqrt(0.75) * np.sin(phase))
    turn, points = Rotation.identity(), [np.zeros((len(phase), 3))]
    for i in range(5):
        angle = (b if i % 2 else a) - 0.5 * math.pi
        turn = turn * Rotation.from_rotvec(angle[:, np.newaxis] * AXES[i])
        points.append(points[-1] + turn.apply(POINTS[i + 1] - POINTS[i]))

    def spline(values: Array) -> CubicSpline:
        return CubicSpline(phase, values, bc_type="periodic")

    path = spline(np.stack(points, axis=1))
    ways, places = path(phase, 1), path(phase)
    near, far = ways[:, :-1], ways[:, 1:]  # ends of rods, whose mass is m (a a + a b + b b) / 3
    mass = spline((near * near + near * far + far * far).sum(axis=(1, 2)) / 3.0)
    level = spline(0.5 * (places[:, :-1, 2] + places[:, 1:, 2]).sum(axis=1))

    def rate(_: float, y: Array) -> list[float]:
        return [y[1], (-0.5 * mass(y[0], 1) * y[1] ** 2 - G * level(y[0], 1)) / mass(y[0])]

    start = [math.acos(1.0 / math.sqrt(3.0)), 0.0]
    return path(solved(rate, start, times, rtol=1e-9, atol=1e-10)[0])[:, 3, 0]


def turning(inertia: Array, spin: Array, arm: Array, times: Array) -> Array:
    """Ways (times, 3) of a point of a free body, by Euler's equations."""

    def rate(_: float, y: Array) -> Array:
        w = y[4:]
        q = 0.5 * np.array([-y[1:4] @ w, *(y[0] * w + np.cross(y[1:4], w))])
        return np.append(q, np.linalg.solve(inertia, np.cross(inertia @ w, w)))

    y = solved(rate, [1.0, 0.0, 0.0, 0.0, *spin], times)
    return np.asarray(Rotation.from_quat(y[[1, 2, 3, 0]].T).apply(arm))


def free_body(times: Array, case: Case) -> Array:
    structure, axis = case["robot"].structure, "xyz".index(case["follow"][1])
    centre = structure.mass @ structure.p_WB / structure.mass.sum()
    inertia = np.zeros((3, 3))
    for mass, unit, q, p in zip(
        structure.mass, structure.unit_inertia, structure.q_WB, structure.p_WB, strict=True
    ):
        body = SpatialInertia(mass, np.zeros(3), UnitInertia(*unit))
        body = body.ReExpress(RotationMatrix(Quaternion(q))).Shift(centre - p)
        inertia += body.CopyToFullMatrix6()[:3, :3]
    arm, spin = case["first"] - centre, np.array(case["start"].spin)
    return centre[axis] + turning(inertia, spin, arm, times)[:, axis]


# Cables


def on_cables(times: Array, case: Case) -> Array:
    """Heights of the node where point masses hang on straight cables that only pull."""
    given = case["robot"].scenario.robot
    names, (cables,) = [*given.nodes], given.cables.values()
    first, last = np.array([[names.index(x) for x in pair] for pair in cables.pairs]).T
    start, held = np.array([*given.nodes.values()]), np.isin(names, [*given.anchors])
    masses = np.array([[given.masses.get(name, 1.0)] for name in names])

    def rate(_: float, y: Array) -> Array:
        p, v = y.reshape(2, -1, 3)
        apart = p[last] - p[first]
        length = np.linalg.norm(apart, axis=1)
        along = apart / length[:, None]
        pull = cables.stiffness * np.maximum(length - cables.free_length, 0.0)
        damped = cables.damping * ((v[last] - v[first]) * along).sum(axis=1)
        force = (pull + np.clip(damped, -pull, pull))[:, None] * along
        total = np.zeros_like(p)
        np.add.at(total, first, force)
        np.add.at(total, last, -force)
        acceleration = total / masses - [0.0, 0.0, given.gravity]
        acceleration[held] = 0.0
        return np.concatenate([v.ravel(), acceleration.ravel()])

    begin = np.append(start.ravel(), np.zeros(start.size))
    y = solved(rate, begin, times, rtol=1e-9, atol=1e-11)
    return y[3 * names.index(case["follow"][0]) + 2]


# At rest: what the package finds, and the reference


def at_rest(**tree: Any) -> EquilibriumStudy:
    """A structure without weight at rest."""
    given = {"unit": "m", "gravity": 0, "anchors": {}, **tree}
    return study_equilibrium(robot_of_structure(StructureFile.from_tree(given, "made"), "made"))


def truss(tree: dict[str, Any]) -> tuple[Array, Array, Array]:
    whole, loads = math.hypot(1.0, 0.3), np.arange(0.0, 901.0, 180.0)

    def missing(h: float, load: float) -> float:
        return 2e5 * (whole / math.hypot(1.0, h) - 1.0) * h - load

    expected = [brentq(missing, 0.175, 0.3, (load,), xtol=1e-14) for load in loads]
    downward = [{"p": [0, 0, f"{-load} N"]} for load in loads.tolist()]
    found = [at_rest(**tree, loads=each).nodes.z["p"] for each in downward]
    return loads, np.array(found), np.array(expected)


def twist(prisms: Sequence[dict[str, Any]]) -> tuple[Array, Array, Array]:
    counts, found = np.arange(3, 9), []
    for tree in prisms:
        nodes = at_rest(**tree).nodes
        first, last = np.arctan2(nodes.y, nodes.x)[["a0", "b0"]]
        found.append(math.degrees((last - first) % math.pi))
    return counts, np.array(found), 90.0 - 180.0 / counts


def prism_modes(prisms: Sequence[dict[str, Any]]) -> tuple[Array, Array, Array]:
    shares = np.array([1.0, 2.0, 4.0, 8.0, 16.0])
    found = np.array([at_rest(**tree).frequencies[0] ** 2 for tree in prisms])
    return shares, found / found[0], shares


def rope_modes(tree: dict[str, Any]) -> tuple[Array, Array, Array]:
    n, known = np.arange(1, 41), at_rest(**tree).frequencies
    expected = math.sqrt(10.0 / (0.01 * 0.025)) * np.sin(n * math.pi / 82) / math.pi
    return n, known[np.abs(known[:, None] - expected).argmin(axis=0)], expected


def rings(_: Any) -> tuple[Array, Array, Array]:
    tau, fatigue, beta = 0.1, 0.6, 2.5
    found, expected = list[float](), list[float]()
    for count, weight in ((2, 1.0 + tau / fatigue), (3, 2.5), (5, 2.5)):
        weights = np.zeros((count + count % 2,) * 2)
        for i in range(count):
            weights[i, (i - 1) % count] = weight
        start = np.append(0.3 + 0.01 * np.arange(len(weights)), np.full(len(weights), 0.3))
        network = Network.of(weights, tau_a=tau, tau_b=fatigue, self_inhibition_weight=beta)
        neurons = MatsuokaCpg(network, tonic=1.0, initial_state=start, gain=1.0)
        simulator = Simulator(neurons)
        ResetIntegratorFromFlags(simulator, "runge_kutta3", 1e-3).set_target_accuracy(1e-9)
        times, states = np.arange(0.0, 20.0, 0.005), []
        for time in times.tolist():
            simulator.AdvanceTo(time)
            states.append(simulator.get_context().get_continuous_state_vector().CopyToVector()[0])
        found.append(period(times, np.array(states)))

        def rate(_: float, y: Array, weights: Array = weights) -> Array:
            u, v = y.reshape(2, -1)
            y = np.maximum(u, 0.0)
            return np.append((1.0 - u - beta * v - weights @ y) / tau, (y - v) / fatigue)

        expected.append(period(times, solved(rate, start, times, max_step=1e-2)[0]))
    expected[0] = 2.0 * math.pi * math.sqrt(tau * fatigue / (beta - tau / fatigue))
    return np.array([2, 3, 5]), np.array(found), np.array(expected)


def period(times: Array, values: Array) -> float:
    """Mean time between upward crossings of the mean, in the second half."""
    late = times > 0.5 * times[-1]
    curve = CubicSpline(times[late], values[late] - values[late].mean())
    roots = curve.roots(extrapolate=False)
    return float(np.diff(roots[curve(roots, 1) > 0.0]).mean())
