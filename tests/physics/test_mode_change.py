"""When modes change under Coulomb friction and on a slope (on flat ground: test_contact)."""

import numpy as np
import pytest

from tetra_drake.physics.contact import (
    HEADING,
    MODE,
    MODE_COLUMNS,
    Ground,
    add_ground_forces,
    meet_ground,
    update_modes,
)
from tetra_drake.physics.kinematics import NODE_COLUMNS
from tetra_drake.physics.mode_change import mode_margin, time_to_mode_change
from tetra_drake.physics.terrain import FRAME_COLUMNS
from tetra_drake.robot.ground import make_ground
from tetra_drake.robot.structure import MakeStructure, Structure
from tetra_drake.scenario.friction_kinds import Coulomb
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.terrain_kinds import Flat, Incline, Terrain

LAW = Coulomb(static=0.6, kinetic=0.5, stiffness=1000.0, damping=70.0)
SLOPE = 0.2
R = np.array([[np.cos(SLOPE), 0, -np.sin(SLOPE)], [0, 1, 0], [np.sin(SLOPE), 0, np.cos(SLOPE)]])


def on_ground(structure: Structure, state: np.ndarray, ground: Ground) -> tuple:
    """The nodes of a state, and their frames."""
    nodes = np.empty((len(structure.node_names), NODE_COLUMNS))
    frames = np.empty((len(structure.contacts), FRAME_COLUMNS))
    meet_ground(state, structure.p_BN, ground, nodes, frames)
    return nodes, frames


class Sliding:
    """The robot 0.1 mm in the ground, all bodies moving alike; vectors are along t1, t2 and n."""

    def __init__(self, scenario: Scenario, terrain: Terrain) -> None:
        scenario = scenario.with_changes({"friction": LAW, "terrain": terrain})
        self.structure = MakeStructure(scenario)
        self.ground = make_ground(scenario, self.structure)
        self.R = R if isinstance(terrain, Incline) else np.eye(3)
        self.stiffness, self.damping = scenario.ground.stiffness, scenario.ground.damping
        self.modes = np.zeros((len(self.structure.contacts), MODE_COLUMNS))
        self.update()

    def at(self, v=(0.0, 0.0, 0.0), p=(0.0, 0.0, -1e-4)) -> tuple:
        """The state moved by p (m) from the start and moving at v (m/s), nodes and frames."""
        state = self.structure.initial_state
        state[:35].reshape(5, 7)[:, 4:] += self.R @ p
        state[35:].reshape(5, 6)[:, 3:] = self.R @ v
        nodes, frames = on_ground(self.structure, state, self.ground)
        return state, nodes, frames

    def update(self, v=(0.0, 0.0, 0.0), p=(0.0, 0.0, -1e-4)) -> bool:
        """Brings the modes up to date; whether they changed."""
        state, nodes, frames = self.at(v, p)
        return update_modes(state, nodes, self.ground, frames, self.modes)

    def time(self, v: tuple, a: tuple, p=(0.0, 0.0, -1e-4)) -> float:
        """Until the next mode change, at most 9 s, at an acceleration a (m/s^2)."""
        state, nodes, frames = self.at(v, p)
        acceleration = np.tile([0.0, 0.0, 0.0, *(self.R @ a)], 5)
        args = self.modes, self.ground, frames
        return time_to_mode_change(state, acceleration, nodes, *args, 9.0)

    def margin(self, v: tuple, p=(0.0, 0.0, -1e-4)) -> float:
        state, nodes, frames = self.at(v, p)
        return mode_margin(state, self.modes, self.structure.p_BN, self.ground, nodes, frames)


@pytest.fixture(params=[Flat(), Incline(slope=SLOPE)], ids=["flat", "incline"])
def sliding(request: pytest.FixtureRequest, scenario: Scenario) -> Sliding:
    return Sliding(scenario, request.param)


def test_a_stuck_node_breaks_free_when_its_bristle_reaches_the_limit(sliding):
    # c v + k v t = mu_s F_N at F_N = stiffness * 1e-4 m
    limit = 0.6 * sliding.stiffness * 1e-4
    expected = (limit - 70.0 * 1e-4) / (1000.0 * 1e-4)
    assert sliding.time((1e-4, 0.0, 0.0), (0.0, 0.0, 0.0)) == pytest.approx(expected, rel=1e-6)
    assert sliding.time((0.0, -1e-4, 0.0), (0.0, 0.0, 0.0)) == pytest.approx(expected, rel=1e-6)


def test_a_node_in_slip_sticks_when_its_damping_holds_it(sliding):
    # c (v - a t) = mu_k F_N
    sliding.modes[:, MODE] = 1.0
    limit = 0.5 * sliding.stiffness * 1e-4
    expected = (70.0 * 0.01 - limit) / 70.0
    time = sliding.time((0.01, 0.0, 0.0), (-1.0, 0.0, 0.0))
    assert time == pytest.approx(expected, rel=1e-6)


def test_a_growing_load_makes_it_stick_sooner(sliding):
    # F_N = (k + lambda w) d grows by k w + lambda w^2 as d grows by w; c v stays.
    sliding.modes[:, MODE] = 1.0
    w, depth, k = 1e-3, 1e-4, sliding.stiffness
    load = (k + sliding.damping * w) * depth
    expected = (70.0 * 0.01 - 0.5 * load) / (0.5 * (k * w + sliding.damping * w**2))
    assert sliding.time((0.01, 0.0, -w), (0.0, 0.0, 0.0)) == pytest.approx(expected, rel=1e-6)


def test_a_node_over_a_slope_lands_when_the_gap_is_closed(sliding):
    # 1 mm over the plane, at 5 mm/s along it and 2 mm/s towards it: 0.5 s, whatever the slope.
    sliding.modes[:] = 0.0
    time = sliding.time((5e-3, 0.0, -2e-3), (0.0, 0.0, 0.0), p=(0.0, 0.0, 1e-3))
    assert time == pytest.approx(0.5, rel=1e-9)


@pytest.mark.parametrize("mode", [0.0, 1.0])
def test_the_margin_crosses_zero_where_the_pull_crosses_the_limit(sliding, mode):
    sliding.modes[:, MODE] = mode
    limit = (0.5 if mode else 0.6) * sliding.stiffness * 1e-4
    below, above = (sliding.margin((factor * limit / 70.0, 0.0, 0.0)) for factor in (0.999, 1.001))
    assert below * above < 0.0
    assert (below < 0.0) == bool(mode), "in slip, a mode change is due below it"


@pytest.mark.parametrize("way", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (-0.6, 0.8, 0.0)])
def test_beyond_the_limit_a_node_that_moves_back_stays_stuck(sliding, way):
    # The bristle is a millimetre out: 1 N.
    p = 1e-3 * np.array(way) - [0.0, 0.0, 1e-4]
    assert sliding.margin(-1e-5 * np.array(way), p=p) > 0.0
    assert sliding.margin(1e-5 * np.array(way), p=p) < 0.0


def test_a_node_that_sticks_again_does_so_where_it_is(sliding):
    assert sliding.update((0.02, 0.0, 0.0), (1e-3, 0.0, -1e-4)), "breaks free"
    np.testing.assert_allclose(sliding.modes[:-1, MODE : MODE + 2], [[1.0, 0.0]] * 10, atol=1e-9)
    slow, there = (1e-3, 0.0, 0.0), (5e-3, 1e-3, -1e-4)
    assert sliding.update(slow, there), "70 * 1e-3 N is below 0.5 * 0.44 N"
    _, nodes, frames = sliding.at(slow, there)
    pushes = np.empty((len(sliding.modes), 3))
    assert not sliding.modes[:, MODE : MODE + 2].any()
    add_ground_forces(nodes, sliding.modes, sliding.ground, frames, True, pushes)
    np.testing.assert_allclose(pushes[:-1, :2], [[-0.07, 0.0]] * 10, atol=1e-9)


def test_the_heading_is_that_of_the_body_at_touchdown(sliding):
    np.testing.assert_allclose(sliding.modes[:-1, HEADING : HEADING + 2], [[1.0, 0.0]] * 10)
    state = sliding.structure.initial_state
    turn = np.array([np.cos(0.3), 0.0, 0.0, np.sin(0.3)])  # by 0.6 about z
    state[:35].reshape(5, 7)[:, :4] = turn
    state[:35].reshape(5, 7)[:, 4:] += [0.0, 0.0, -0.2]
    nodes, frames = on_ground(sliding.structure, state, sliding.ground)
    sliding.modes[:] = 0.0
    update_modes(state, nodes, sliding.ground, frames, sliding.modes)
    forward = np.array([np.cos(0.6), np.sin(0.6), 0.0]) @ sliding.R
    expected = forward[:2] / np.linalg.norm(forward[:2])
    np.testing.assert_allclose(sliding.modes[:, HEADING : HEADING + 2], [expected] * 11, atol=1e-9)
