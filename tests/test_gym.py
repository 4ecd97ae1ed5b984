"""Environments of Gymnasium."""

import importlib
import sys

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from helpers.actuations import FORCE, MOTOR, WINCH
from helpers.converged import shortly

from tetra_drake.engines.compiled.lane_engine import processor_lanes
from tetra_drake.engines.simulation import Simulation
from tetra_drake.gym import ROLL, WALK, TensegrityEnv, TensegrityVectorEnv
from tetra_drake.robot.robot import AMPLITUDE
from tetra_drake.scenario.common_sections import Disturbances
from tetra_drake.scenario.scenario import Scenario

LANES = processor_lanes()


@pytest.fixture
def short(scenario: Scenario) -> Scenario:
    """0.2 s of disturbed robots on the compiled engine."""
    disturbances = Disturbances(draws=1, spreads={"robot.cables.outer_stiffness": 0.1}, start=0.01)
    changes = {"disturbances": disturbances, "simulation.steady_from": "0.05 s"}
    return shortly(scenario, 0.2, engine="!Compiled", **changes)


def episode(env: gymnasium.Env, *, seed: int) -> tuple[np.ndarray, list[float], bool, bool]:
    """Observations, rewards, and the two flags at the end of an episode with drawn actions."""
    seen, rewards = [env.reset(seed=seed)[0]], []
    actions = np.random.default_rng(0).uniform(-1, 1, (1000, *env.action_space.shape))
    for action in actions:
        observation, reward, terminated, truncated, _ = env.step(action)
        seen.append(observation)
        rewards.append(reward)
        if terminated or truncated:
            return np.array(seen), rewards, terminated, truncated
    raise AssertionError("it does not end")


@pytest.mark.filterwarnings("ignore:.*infinity")
@pytest.mark.parametrize("name", [WALK, ROLL])
def test_the_environments_pass_gymnasiums_checks(name):
    env = gymnasium.make(name).unwrapped
    assert ("rolled" in env._episodes.simulation.scenario.objective) == (name == ROLL)
    check_env(env, skip_render_check=True)


@pytest.mark.parametrize("actuation", [FORCE, WINCH, MOTOR])
def test_an_action_is_the_signal_as_a_share_of_the_networks(short, actuation):
    env = TensegrityEnv(short.with_changes(actuation), grouped=True)
    env.reset(seed=0)
    env.step(np.array([0.0, 1.0, -1.0, 0.0]))
    simulation: Simulation = env._episodes.simulation
    amplitude = short.cpg.gain * AMPLITUDE * short.cpg.external_input
    shifts = np.array([0.0, 0.0, 1.0, 1.0, -1.0, -1.0, 0.0, 0.0])
    stiffness = simulation.robot.structure.cables["stiffness"][simulation.robot.driven]
    per_newton = -1.0 / stiffness if actuation is WINCH else np.ones(8)
    setpoints = env._episodes._setpoints(np.array([[0.0, 1.0, -1.0, 0.0]]))[0]
    rest = env._episodes._setpoints(np.zeros((1, 4)))[0]
    np.testing.assert_allclose(setpoints - rest, amplitude * shifts * per_newton, rtol=1e-9)


def test_seeds_repeat_episodes_bit_for_bit(short):
    env = TensegrityEnv(short)
    first, again, other = (episode(env, seed=seed) for seed in (1, 1, 2))
    assert np.array_equal(first[0], again[0]) and first[1] == again[1]
    assert not np.array_equal(first[0][0], other[0][0]), "another draw"
    assert first[2:] == (False, True), "it ends with the time"


@pytest.mark.parametrize("objective", ["", "speed", "cost_of_transport", "rolled"])
def test_the_rewards_of_an_episode_are_the_fitness(short, objective):
    chosen = short.with_sections(objective={objective: 2.0}) if objective else short
    env = TensegrityEnv(chosen)
    rewards = episode(env, seed=3)[1]
    fitness = env._episodes.simulation.result().fitness
    assert sum(rewards) == pytest.approx(fitness, rel=1e-9)
    assert fitness != 0.0
    dense = np.flatnonzero(rewards[:-1])
    assert (dense.size > 5) == (objective != "cost_of_transport")


def test_a_robot_that_fails_ends_its_episode_with_nothing(short):
    env = TensegrityEnv(short.with_changes({"cpg.gain": "4e9 N"}))
    _, rewards, terminated, truncated = episode(env, seed=0)
    assert (terminated, truncated) == (True, False)
    assert sum(rewards) == pytest.approx(0.0, abs=1e-9)


def test_robots_side_by_side_begin_again_when_they_end(short):
    many = TensegrityVectorEnv(LANES, short, workers=1)
    start, _ = many.reset(seed=5)
    assert len({row.tobytes() for row in start}) == LANES, "each has a draw"
    still = np.zeros(many.action_space.shape)
    for _ in range(9):
        _, _, terminated, truncated, info = many.step(still)
        assert not (terminated | truncated).any() and not info
    begun, _, _, truncated, info = many.step(still)
    assert truncated.all() and info["_final_obs"].all()
    angular_velocities = slice(-15, None)
    assert not begun[:, angular_velocities].any()
    assert np.stack(info["final_obs"])[:, angular_velocities].all()
    assert not np.array_equal(begun, start), "another draw"
    assert many.step(still)[3].sum() == 0
    assert np.array_equal(many.reset(seed=5)[0], start)


def test_an_action_of_wrong_shape_is_refused(short, refused):
    env, many = TensegrityEnv(short, grouped=True), TensegrityVectorEnv(LANES, short)
    for each, action, expected in (
        (env, np.zeros((2, 4)), "(4,)"),
        (env, "left", "(4,)"),
        (many, np.zeros(8), f"found the shape (8,), expected ({LANES}, 8)"),
    ):
        each.reset(seed=0)
        with refused("tetra_drake.gym", "actions", expected):
            each.step(action)


def test_without_gymnasium_the_import_tells_what_to_install(monkeypatch, refused):
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    monkeypatch.delitem(sys.modules, "tetra_drake.gym")
    with refused("tetra_drake.gym", "", "tetra_drake[gym]"):
        importlib.import_module("tetra_drake.gym")
