"""Actuators in motion, on the diagram and the compiled engine: analytic answers, energy, agreement.

The analytic answers are of a bar that sways along its axis between the ends of a frame, in the air
without gravity. A passive cable and a driven one of equal laws hold it, l1 = L + y and l2 = L - y:

    mu y'' = T2 - T1,    T1 = k (L + y - l0) + c y'
"""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
import xarray
from helpers.actuations import LIMITED
from helpers.quantities import with_unit
from helpers.states import body_velocities

from tetra_drake.engines.gait_simulation import GaitSimulation
from tetra_drake.engines.interface import engine_of
from tetra_drake.physics.cable import PASSIVE
from tetra_drake.physics.inertia import XX
from tetra_drake.robot.gait import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.actuator_kinds import Actuation, Force, TensionMotor, Winch
from tetra_drake.scenario.engine_kinds import Compiled, Drake
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.robot_structure import StructureFile
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.scenario.strut_contact_kinds import NoStrutContact

LENGTH, FREE_LENGTH, STIFFNESS, DAMPING = 0.2, 0.1, 100.0, 0.4  # L, l0, k, c in SI units

LIMITLESS = {"max_force": 1e6, "max_speed": 1e3}

FINE = {
    "drake": Drake(scheme="runge_kutta3", accuracy=1e-7, max_step=1e-3),
    "compiled": Compiled(tolerance=1e-6, max_step=5e-5),
}
ENGINES = pytest.mark.parametrize("engine", FINE.values(), ids=FINE)


@dataclasses.dataclass(frozen=True)
class Wound(Robot):
    """A robot whose actuators do not start as usual."""

    drives: np.ndarray = dataclasses.field(kw_only=True)

    def starting_drives(self) -> np.ndarray:
        return self.drives


def swaying(actuation: Actuation, *, damping: float, gain: float = 0.0) -> Scenario:
    """A bar between the ends of a frame, for 80 ms."""
    make = {"diameter": 0.008, "density": 1200.0, "node_diameter": 0.016}
    law = {"stiffness": STIFFNESS, "damping": damping, "free_length": FREE_LENGTH}
    along = {"a": 0.0, "b": LENGTH, "c": 2.0 * LENGTH, "d": 3.0 * LENGTH}
    kind = StructureFile(
        nodes={name: [x, 0.0, 0.5] for name, x in along.items()},
        struts={"frame": {"pairs": [["a", "d"]], **make}, "bar": {"pairs": [["b", "c"]], **make}},
        cables={
            "passive": {"pairs": [["a", "b"]], **law},
            "driven": {"pairs": [["c", "d"]], **law},
        },
        actuated={"one": ["driven c d"]},
        contacts=["a"],
        offsets=[[0.0, 0.0, 1.0], [0.0, 0.0, 1.0]],
        gravity=0.0,
    )
    times = {"duration": "80 ms", "steady_from": "40 ms", "sample_period": "1 ms"}
    changes = {f"simulation.{key}": value for key, value in times.items()}
    changes |= {"cpg.start_up": 0.0, "cpg.gain": f"{gain} N"}
    parts = {"robot": kind, "actuation": actuation, "strut_contact": NoStrutContact()}
    scenario = load_scenario("prism").with_sections(**parts)
    return scenario.with_changes(changes)


def trajectory_of(robot: Robot) -> xarray.Dataset:
    gait = seeded_gait(robot.scenario)
    result = engine_of(robot.scenario).simulate(GaitSimulation(robot, gait, record=True))
    return result.trajectory


def sway_of(trajectory: xarray.Dataset) -> np.ndarray:
    """The way (m) of the bar along the frame, at each time."""
    frame, bar = trajectory.p_WB.values[:, :, 0].T
    return (bar - bar[0]) - (frame - frame[0])


def sway(scenario: Scenario, drive: float) -> tuple[np.ndarray, np.ndarray]:
    """Times (s) and the way (m) of the bar, whose actuator starts at `drive`; signals are 0."""
    robot = Robot.of(scenario)
    wound = Wound(**vars(robot), drives=np.array([drive]))
    trajectory = trajectory_of(wound)
    return trajectory.time.values, sway_of(trajectory)


def reduced_mass(scenario: Scenario) -> float:
    """mu, in kg."""
    frame, bar = Robot.of(scenario).model.bodies.mass
    return float(frame * bar / (frame + bar))


@ENGINES
def test_a_spring_behind_a_lagging_winch_is_a_driven_oscillator(engine):
    # y'' + w² y = -w² d/2 exp(-t / tau), w² = 2 k / mu: the free length is d too long at first.
    tau, d = 0.02, 0.03
    scenario = swaying(Winch(time_constant=tau, **LIMITLESS), damping=0.0)
    t, y = sway(scenario.with_changes({"engine": engine}), FREE_LENGTH + d)
    w = np.sqrt(2.0 * STIFFNESS / reduced_mass(scenario))
    a = -0.5 * d * w**2 / (w**2 + 1.0 / tau**2)
    expected = a * (np.exp(-t / tau) - np.cos(w * t) + np.sin(w * t) / (tau * w))
    assert w * t[-1] > 2.0 * np.pi and np.ptp(expected) > 0.5 * d
    np.testing.assert_allclose(y, expected, atol=1e-6)


@pytest.mark.parametrize("speed", [0.3, -0.3], ids=["winds", "pays out"])
@ENGINES
def test_a_spring_behind_a_winch_at_its_speed_is_an_oscillator_on_a_ramp(engine, speed):
    # y'' + w² y = -w² (d - v t)/2: the free length is l0 + d - v t, until after 80 ms.
    d = 0.1 * speed
    limits = {"max_force": 1e6, "max_speed": abs(speed), "time_constant": 0.01}
    scenario = swaying(Winch(**limits), damping=0.0)
    t, y = sway(scenario.with_changes({"engine": engine}), FREE_LENGTH + d)
    w = np.sqrt(2.0 * STIFFNESS / reduced_mass(scenario))
    expected = 0.5 * d * (np.cos(w * t) - 1.0) + 0.5 * speed * (t - np.sin(w * t) / w)
    assert abs(d - speed * t[-1]) >= 0.99 * abs(speed) * limits["time_constant"]
    np.testing.assert_allclose(y, expected, atol=1e-6)


@ENGINES
def test_a_winch_on_its_force_speed_line_is_a_linear_system(engine):
    # x' = -v (1 - T2 / F) and T2 = k (L - y - x) + c (-y' - x'), so that
    # (1 + c v / F) T2 = k (L - y - x) - c y' + c v.
    f, v, d = 25.0, 0.4, 0.05
    limits = {"max_force": f, "max_speed": v, "time_constant": 0.001}
    scenario = swaying(Winch(**limits), damping=DAMPING)
    t, y = sway(scenario.with_changes({"engine": engine}), FREE_LENGTH + d)
    k, c, m, s = STIFFNESS, DAMPING, reduced_mass(scenario), 1.0 + DAMPING * v / f
    pull = np.array([-k, -c, -k]) / s  # how T2 depends on y, y' and x
    rates = np.array([[0.0, 1.0, 0.0], (pull - [k, c, 0.0]) / m, v / f * pull])
    at_zero = (k * LENGTH + c * v) / s
    constant = np.array([0.0, (at_zero - k * (LENGTH - FREE_LENGTH)) / m, v / f * at_zero - v])
    motion = linear_motion(rates, constant, start=[0.0, 0.0, FREE_LENGTH + d])(t)
    assert (motion[:, 2] > FREE_LENGTH + v * 0.001).all(), "it does not arrive"
    np.testing.assert_allclose(y, motion[:, 0], atol=1e-6)
    assert np.ptp(y) > 0.005


@ENGINES
def test_a_bar_on_a_tension_motor_is_a_linear_system(engine):
    # tau T2' = k (L - y - l0) - c y' - T2.
    tau = 0.01
    scenario = swaying(TensionMotor(time_constant=tau, **LIMITLESS), damping=DAMPING)
    k, c, m, stretch = STIFFNESS, DAMPING, reduced_mass(scenario), LENGTH - FREE_LENGTH
    rates = np.array([[0.0, 1.0, 0.0], [-k / m, -c / m, 1.0 / m], [-k / tau, -c / tau, -1.0 / tau]])
    constant = np.array([0.0, -k * stretch / m, k * stretch / tau])
    start = 0.8 * k * stretch
    t, y = sway(scenario.with_changes({"engine": engine}), start)
    expected = linear_motion(rates, constant, start=[0.0, 0.0, start])(t)
    assert (expected[:, 2] > 0.0).all() and np.ptp(expected[:, 0]) > 0.005
    np.testing.assert_allclose(y, expected[:, 0], atol=2e-6)


def linear_motion(
    rates: np.ndarray, constant: np.ndarray, *, start: list[float]
) -> Callable[[np.ndarray], np.ndarray]:
    """z(t), (times, n), of z' = rates z + constant."""
    values, vectors = np.linalg.eig(rates)
    rest = np.linalg.solve(rates, -constant)
    parts = np.linalg.solve(vectors, np.array(start) - rest)
    return lambda t: (np.exp(np.outer(t, values)) * parts @ vectors.T).real + rest


def test_a_winch_without_limits_and_lag_is_the_force_law():
    # The difference falls in proportion to the time constant.
    def driven(actuation: Actuation) -> np.ndarray:
        scenario = swaying(actuation, damping=0.0, gain=10.0).with_changes(
            {"engine": FINE["compiled"], "simulation.duration": "0.5 s", "cpg.signals": "live"}
        )
        return sway_of(trajectory_of(Robot.of(scenario)))

    expected = driven(Force())
    assert np.ptp(expected) > 0.005
    apart = [
        np.abs(driven(Winch(time_constant=tau, **LIMITLESS)) - expected).max()
        for tau in (2e-3, 1e-3, 5e-4)
    ]
    assert apart[0] < 0.05 * np.ptp(expected)
    assert apart[0] / apart[1] == pytest.approx(2.0, abs=0.1)
    assert apart[1] / apart[2] == pytest.approx(2.0, abs=0.05)


@pytest.mark.parametrize("engine", ["drake", "compiled"])
def test_a_robot_in_the_air_gains_the_work_of_its_winches(scenario, engine):
    # Without damping: kinetic and elastic energy, k (l - x)² / 2 of a taut cable, grow by the
    # integral of T (-x').
    floating = {
        "robot.tetrahedra": 3,
        "robot.gravity": 0.0,
        "robot.offsets": with_unit(np.random.default_rng(0).normal([0, 0, 1], 0.005, (3, 3)), "m"),
        "robot.cables.damping": 0.0,
        "simulation.duration": "0.15 s",
        "simulation.steady_from": "0.1 s",
        "simulation.sample_period": "0.1 ms",
        "cpg.start_up": 0.0,
        "actuation": LIMITED["winch"],
    }
    robot = Robot.of(scenario.with_changes({**floating, "engine": FINE[engine]}))
    structure, bodies, motion = robot.structure, robot.model.bodies, trajectory_of(robot)
    v_WB, w_WB = body_velocities(motion, structure)
    kinetic = 0.5 * (bodies.mass[0] * v_WB**2 + bodies.inertia[0, XX] * w_WB**2).sum(axis=(1, 2))
    stretch = np.maximum(motion.length.values - motion.free_length.values, 0.0)
    energy = kinetic + 0.5 * stretch**2 @ structure.cables["stiffness"]

    driven = structure.cables["signal"] != PASSIVE
    tension, x = motion.tension.values[:, driven], motion.free_length.values[:, driven]
    works = -0.5 * (tension[1:] + tension[:-1]) * np.diff(x, axis=0)
    work = np.append(0.0, works.sum(axis=1).cumsum())
    assert np.ptp(work) > 0.01, "J"
    np.testing.assert_allclose(energy - energy[0], work, atol=1e-4 * np.ptp(work))
