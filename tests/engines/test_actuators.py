"""Actuators in motion, on the diagram and the compiled engine: analytic answers.

A bar sways along its axis between the ends of a frame, in the air without gravity. A passive
cable and a driven one of equal laws hold it, l1 = L + y and l2 = L - y:

    mu y'' = T2 - T1,    T1 = k (L + y - l0) + c y'
"""

import dataclasses
import itertools

import numpy as np
import pytest
from helpers.anchored import TREES, scenario_of
from helpers.structures import motion_of
from scipy.linalg import expm

from tetra_drake.laws.actuator import Actuation, TensionMotor, Winch
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.engine_kinds import Compiled, Drake
from tetra_drake.scenario.scenario import Scenario

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


def swaying(actuation: Actuation, *, damping: float) -> Scenario:
    """A bar between the ends of a frame, for 80 ms."""
    groups = TREES["swaying"]["cables"].items()
    cables = {name: group | {"damping": damping} for name, group in groups}
    still = {"cpg.gain": 0.0, "simulation.sample_period": "1 ms"}
    tree = TREES["swaying"] | {"cables": cables}
    return scenario_of(tree, duration=0.08, actuation=actuation, **still)


@dataclasses.dataclass(frozen=True)
class Linear:
    """An actuator whose tension T2 and rate of its drive are linear in (y, y', drive, 1)."""

    actuation: Actuation
    tension: np.ndarray
    rate: np.ndarray
    start: float
    """The drive at first."""
    drive: str = "free_length"
    """The free length x (m), or the tension (N)."""
    damping: float = 0.0
    away: float = 0.0
    """Least way (m) of the free length from where the signal wants it, for the law to hold."""


def linear_actuators() -> dict[str, Linear]:
    """By their names."""
    k, c, stretch = STIFFNESS, DAMPING, LENGTH - FREE_LENGTH
    spring = np.array([-k, 0.0, -k, k * LENGTH])  # T2 = k (L - y - x)
    tau = 0.02
    lagging = np.array([0.0, 0.0, -1.0, FREE_LENGTH]) / tau  # x' = (l0 - x) / tau
    winch = Winch(time_constant=tau, **LIMITLESS)
    found = {"a lagging winch": Linear(winch, spring, lagging, FREE_LENGTH + 0.03)}
    for name, v in (("a winch that winds", 0.3), ("a winch that pays out", -0.3)):
        winch = Winch(max_force=1e6, max_speed=abs(v), time_constant=0.01)
        speed = np.array([0.0, 0.0, 0.0, -v])
        away = 0.0099 * abs(v)
        found[name] = Linear(winch, spring, speed, FREE_LENGTH + 0.1 * v, away=away)
    # x' = -v (1 - T2 / F) and T2 = k (L - y - x) + c (-y' - x'), so that
    # (1 + c v / F) T2 = k (L - y - x) - c y' + c v.
    f, v = 25.0, 0.4
    pull = np.add(spring, [0.0, -c, 0.0, c * v]) / (1.0 + c * v / f)
    winch = Winch(max_force=f, max_speed=v, time_constant=0.001)
    speed = v / f * pull - [0.0, 0.0, 0.0, v]
    start = FREE_LENGTH + 0.05
    found["a winch at its limits"] = Linear(winch, pull, speed, start, damping=c, away=0.001 * v)
    # tau T2' = k (L - y - l0) - c y' - T2.
    motor = TensionMotor(time_constant=0.01, **LIMITLESS)
    rate = np.array([-k, -c, -1.0, k * stretch]) / 0.01
    itself = np.array([0.0, 0.0, 1.0, 0.0])
    found["a tension motor"] = Linear(motor, itself, rate, 0.8 * k * stretch, "tension", c)
    return found


@ENGINES
@pytest.mark.parametrize("one", linear_actuators().values(), ids=linear_actuators())
def test_a_bar_on_an_actuator_is_a_linear_system(one, engine):
    scenario = swaying(one.actuation, damping=one.damping).with_changes({"engine": engine})
    robot = Robot.of(scenario)
    trajectory = motion_of(Wound(**vars(robot), drives=np.array([one.start])))
    frame, bar = robot.model.bodies.mass
    mu = frame * bar / (frame + bar)
    passive = np.array([STIFFNESS, one.damping, 0.0, STIFFNESS * (LENGTH - FREE_LENGTH)])
    rates = np.array([[0, 1, 0, 0], (one.tension - passive) / mu, one.rate, [0, 0, 0, 0]])
    start = [0.0, 0.0, one.start, 1.0]
    times = trajectory.time.values
    np.testing.assert_allclose(times, times[1] * np.arange(len(times)), atol=1e-12)
    step = expm(rates * times[1])
    motion = np.array([*itertools.accumulate(times[1:], lambda at, _: step @ at, initial=start)])
    assert (np.abs(motion[:, 2] - FREE_LENGTH) >= one.away).all(), "it does not arrive"
    assert np.ptp(motion[:, 0]) > 0.005
    frame, bar = trajectory.p_WB.values[:, :, 0].T
    sway = (bar - bar[0]) - (frame - frame[0])
    np.testing.assert_allclose(sway, motion[:, 0], atol=2e-6)
    drive = trajectory[one.drive].sel(cable="driven c d")
    np.testing.assert_allclose(drive, motion[:, 2], atol=2e-5)
