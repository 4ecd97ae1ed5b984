"""When modes change, by each law of friction, on flat ground and on a slope."""

import numpy as np
import pytest
from helpers.robot_on_ground import RobotOnGround
from scipy.spatial.transform import Rotation

from tetra_drake.laws.contact import HEADING, MODE
from tetra_drake.laws.friction import Coulomb, ResetConstants
from tetra_drake.laws.terrain import Flat, Incline
from tetra_drake.scenario.scenario import Scenario

SLOPE = 0.2
R = np.array([[np.cos(SLOPE), 0, -np.sin(SLOPE)], [0, 1, 0], [np.sin(SLOPE), 0, np.cos(SLOPE)]])


# The reset integrator, on flat ground.


@pytest.fixture
def reset(scenario: Scenario) -> RobotOnGround:
    """The robot just landed, under the reading by which nodes slip."""
    robot = RobotOnGround(scenario.with_changes({"friction.reset": "reversal"}), np.eye(3))
    robot.update()
    return robot


def test_a_change_is_due_at_the_stiction_range_and_at_the_surface(reset):
    p0, outward = (
        ResetConstants(*reset.model.ground.friction.constants).stiction_range,
        (1e-9, 0, 0),
    )
    near, far = ((factor * p0, 0.0, -1e-4) for factor in (0.9999, 1.0001))
    assert [reset.is_due(outward, p) for p in (near, far)] == [False, True]
    assert [reset.is_due(p=(0.0, 0.0, z)) for z in (-1e-6, 1e-6)] == [False, True]
    assert not reset.is_due((-1e-9, 0.0, 0.0), far), "a node that moves back stays stuck"


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("mode", [-1.0, 1.0])
def test_a_slipping_node_sticks_when_its_velocity_changes_sign(reset, axis, mode):
    reset.modes[2, MODE + axis] = mode  # of T2's bottom left
    for speed in (3e-6, -3e-6):
        state = reset.state()
        state[35 + 6 + 3 + axis] = mode * speed
        assert reset.is_due_at(state) == (speed < 0.0)


FORESEEN = [(0.05, 0.0, 0.004 * 0.0254 / 0.05)]  # free at p0 / v
FORESEEN += [(0.0, 2.0, 0.01)]  # 2 m/s^2 lift nodes 1e-4 m deep after sqrt(2 * 1e-4 / 2) s


@pytest.mark.parametrize(("v_x", "upward", "expected"), FORESEEN)
def test_a_mode_change_is_foreseen_when_it_comes(reset, v_x, upward, expected):
    time = reset.time_to_change((v_x, 0.0, 0.0), (0.0, 0.0, upward))
    assert time == pytest.approx(expected, rel=1e-9)


def test_a_reset_at_the_range_is_no_mode_change(scenario):
    robot = RobotOnGround(scenario, np.eye(3))
    robot.update()
    far, fast = 1.1 * scenario.friction.stiction_range, (0.05, 0.0, 0.0)
    assert not robot.is_due(fast, (far, 0.0, -1e-4))
    assert robot.time_to_change(fast) == 9.0, "the horizon"


# Coulomb friction, on flat ground and on a slope.


@pytest.fixture(params=[Flat(), Incline(slope=SLOPE)], ids=["flat", "incline"])
def sliding(request: pytest.FixtureRequest, scenario: Scenario) -> RobotOnGround:
    """The robot just landed."""
    law = Coulomb(static=0.6, kinetic=0.5, stiffness=1000.0, damping=70.0)
    scenario = scenario.with_changes({"friction": law, "terrain": request.param})
    robot = RobotOnGround(scenario, R if isinstance(request.param, Incline) else np.eye(3))
    robot.update()
    return robot


@pytest.mark.parametrize("v", [(1e-4, 0.0, 0.0), (0.0, -1e-4, 0.0)])
def test_a_stuck_node_breaks_free_when_its_bristle_reaches_the_limit(sliding, scenario, v):
    # c v + k v t = mu_s F_N at F_N = stiffness * 1e-4 m
    expected = (0.6 * scenario.ground.stiffness * 1e-4 - 70.0 * 1e-4) / (1000.0 * 1e-4)
    assert sliding.time_to_change(v) == pytest.approx(expected, rel=1e-6)


def test_a_node_in_slip_sticks_when_its_damping_holds_it(sliding, scenario):
    sliding.modes[:, MODE] = 1.0
    k, damping, w, depth = scenario.ground.stiffness, scenario.ground.damping, 1e-3, 1e-4
    # As it slows down: c (v - a t) = mu_k F_N.
    slower = sliding.time_to_change((0.01, 0.0, 0.0), (-1.0, 0.0, 0.0))
    assert slower == pytest.approx((70.0 * 0.01 - 0.5 * k * depth) / 70.0, rel=1e-6)
    # As its load grows: F_N = (k + lambda w) d grows by k w + lambda w^2 as d grows by w.
    expected = (70.0 * 0.01 - 0.5 * (k + damping * w) * depth) / (0.5 * (k * w + damping * w**2))
    assert sliding.time_to_change((0.01, 0.0, -w)) == pytest.approx(expected, rel=1e-6)


def test_a_node_over_a_slope_lands_when_the_gap_is_closed(sliding):
    # 1 mm over the plane, at 5 mm/s along it and 2 mm/s towards it: 0.5 s, whatever the slope.
    sliding.modes[:] = 0.0
    time = sliding.time_to_change((5e-3, 0.0, -2e-3), p=(0.0, 0.0, 1e-3))
    assert time == pytest.approx(0.5, rel=1e-9)


@pytest.mark.parametrize("mode", [0.0, 1.0])
def test_a_change_is_due_where_the_pull_crosses_the_limit(sliding, mode, scenario):
    sliding.modes[:, MODE] = mode
    limit = (0.5 if mode else 0.6) * scenario.ground.stiffness * 1e-4
    due = [sliding.is_due((factor * limit / 70.0, 0.0, 0.0)) for factor in (0.999, 1.001)]
    assert due == ([True, False] if mode else [False, True]), "in slip, below it"


@pytest.mark.parametrize("way", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (-0.6, 0.8, 0.0)])
def test_beyond_the_limit_a_node_that_moves_back_stays_stuck(sliding, way):
    # The bristle is a millimetre out: 1 N.
    p = 1e-3 * np.array(way) - [0.0, 0.0, 1e-4]
    due = [sliding.is_due(sign * 1e-5 * np.array(way), p) for sign in (-1.0, 1.0)]
    assert due == [False, True]


def test_the_heading_is_that_of_the_body_at_touchdown(sliding):
    np.testing.assert_allclose(sliding.modes[:-1, HEADING : HEADING + 2], [[1.0, 0.0]] * 10)
    # By 0.6 about z, after the nose has gone down by 0.4.
    yaw, pitch = Rotation.from_rotvec([0.0, 0.0, 0.6]), Rotation.from_rotvec([0.0, 0.4, 0.0])
    x, y, z, w = (yaw * pitch).as_quat()
    state = sliding.structure.initial_state
    state[:35].reshape(5, 7)[:, :4] = [w, x, y, z]
    state[:35].reshape(5, 7)[:, 4:] += [0.0, 0.0, -0.3]
    sliding.modes[:] = 0.0
    sliding.update_at(state)
    forward = (yaw * pitch).apply([1.0, 0.0, 0.0]) @ sliding.R
    expected = forward[:2] / np.linalg.norm(forward[:2])
    np.testing.assert_allclose(sliding.modes[:, HEADING : HEADING + 2], [expected] * 11, atol=1e-9)
