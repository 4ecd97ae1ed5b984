"""Sensors: what policies and controllers see of a robot, and what the robot does of it."""

import dataclasses

import numpy as np
import pytest
from helpers.anchored import HUNG, scenario_of

from tetra_drake.engines.simulate import simulate
from tetra_drake.lab.stepping.simulation import Simulation
from tetra_drake.robot.readings import Readings
from tetra_drake.scenario.disturbances import disturbed, draw_disturbances
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.scenario.sensing import Sensing

PERIOD = 0.02
NOISE = {"noise": {"lengths": 1e-3, "rates": 0.05}, "bias": {"lengths": 2e-3}}
LATE = {"delay": {"lengths": 3 * PERIOD, "tensions": PERIOD}}


def bouncing(engine: str = "!Compiled", **sensing: object) -> Scenario:
    """A bar that bounces on a driven cable."""
    tree = HUNG | {"actuated": {"motor": ["line top a"]}}
    changes = {"engine": engine, "friction.stiffness": "0 N/m", "sensing": Sensing(**sensing)}
    return scenario_of(tree, duration=0.3, **changes)


def test_errors_have_their_sizes():
    sizes = NOISE["noise"] | {"q_WB": 0.01}
    sensing = Sensing(noise=sizes, bias={"lengths": 2e-3}, resolution={"tensions": 0.5}, seed=3)
    exact = np.linspace(0.1, 0.2, 400)
    seen = np.array([sensing.seen("lengths", exact, step=step) for step in range(100)])
    errors = seen - exact
    noise = errors - errors.mean(axis=0)
    assert noise.std() == pytest.approx(1e-3, rel=0.03)  # of 40,000 draws
    assert errors.mean(axis=0).std() == pytest.approx(2e-3, rel=0.15)  # of 400
    between = np.corrcoef(noise[:-1].ravel(), noise[1:].ravel())[0, 1]
    assert abs(between) < 0.03
    np.testing.assert_array_equal(seen[7], sensing.seen("lengths", exact, step=7))
    read = sensing.seen("tensions", 10.0 * exact, step=0)
    np.testing.assert_array_equal(read % 0.5, 0.0)
    assert np.abs(read - 10.0 * exact).max() <= 0.25
    upright = np.tile([1.0, 0.0, 0.0, 0.0], (5000, 1))
    turned = sensing.seen("q_WB", upright, step=0)
    np.testing.assert_allclose(np.linalg.norm(turned, axis=1), 1.0, rtol=1e-12)
    np.testing.assert_allclose(2.0 * turned[:, 1:].std(axis=0), 0.01, rtol=0.05)


def test_readings_are_late_and_noisy_and_go_on_from_saved_states():
    robots = Simulation(bouncing(**NOISE, **LATE), count=3, control_period=PERIOD)
    seen, exact = [robots.reset(seed=5)], [robots.state]
    for step in range(1, 9):
        seen.append(robots.step(robots.rest))
        exact.append(robots.state)
        if step == 4:
            saved = robots.save([1])
    late = np.array([one.tensions for one in seen[1:]])
    np.testing.assert_array_equal(late, [one.tensions for one in exact[:-1]])
    errors = np.array([a.lengths - b.lengths for a, b in zip(seen[3:], exact, strict=False)])
    assert 1e-4 < np.abs(errors).max() < 1e-2
    assert np.ptp(errors[0]) > 0.0, "each robot has its own errors"
    np.testing.assert_array_equal(seen[8].p_WN, exact[8].p_WN)

    other = Simulation(bouncing(**NOISE, **LATE), control_period=PERIOD)
    other.restore(saved)
    for step in range(5, 9):
        found = other.step(other.rest)
        for name, values in found._asdict().items():
            np.testing.assert_array_equal(values[0], getattr(seen[step], name)[1], err_msg=name)


def test_a_controller_sees_the_same_errors_on_each_engine_and_each_time(engine):
    def watched(scenario: Scenario) -> list[Readings]:
        seen: list[Readings] = []

        def controller(time, readings):
            seen.append(Readings(*map(np.copy, readings)))
            return -5.0 * readings.rates[:1]

        simulate(scenario, controller=controller, control_period=PERIOD)
        return seen

    exact, noisy, again = map(watched, (bouncing(engine), *[bouncing(engine, **NOISE, **LATE)] * 2))
    np.testing.assert_array_equal([one.rates for one in noisy], [one.rates for one in again])
    for step in range(4):  # as late as at the start
        shown = Sensing(**NOISE).seen("lengths", exact[0].lengths, step=step)
        np.testing.assert_array_equal(noisy[step].lengths, shown)
    assert np.abs(noisy[-1].p_WN - exact[-1].p_WN).max() > 1e-5, "the robot follows its errors"


def test_draws_have_their_own_errors():
    scenario = bouncing(**NOISE)
    draws = [draw_disturbances(scenario, (1, 0, iteration, 0)) for iteration in (0, 0, 1)]
    first, same, other = (disturbed(scenario, draw).sensing.seed for draw in draws)
    assert first == same != other
    assert disturbed(scenario.with_sections(sensing=None), draws[0]).sensing is None
    assert dataclasses.asdict(draws[0])["factors"] == {}
