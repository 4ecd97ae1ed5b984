"""Environments of Gymnasium."""

import copy
import importlib
import pickle
import sys

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from helpers.actuations import FORCE, MOTOR, WINCH
from helpers.converged import shortly

from tetra_drake.engines.lanes.batch import processor_lanes
from tetra_drake.gym import ROLL, WALK, TensegrityEnv, TensegrityVectorEnv
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.experiment_sections import Disturbances
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.scenario.sensing import Sensing
from tetra_drake.visualization.scene import COLOURS

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
    assert ("rolled" in env._one.simulation.scenario.objective) == (name == ROLL)
    check_env(env, skip_render_check=True)


@pytest.mark.parametrize("actuation", [FORCE, WINCH, MOTOR])
def test_an_action_is_the_signal_as_a_share_of_the_networks(short, actuation):
    calm = short.with_changes(actuation | {"disturbances": None})

    def signals(action):
        env = TensegrityEnv(calm, grouped=True, record=True)
        env.reset(seed=0)
        while not any(env.step(np.array(action))[2:4]):
            pass
        return env.result().trajectory.signal.values

    amplitude = 0.5 * short.cpg.gain * short.cpg.external_input
    expected = amplitude * np.array([0.0, 0.0, 2.0, 2.0, -1.0, -1.0, 0.0, 0.0])
    found = signals([0.0, 2.0, -1.0, 0.0]) - signals([0.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(found, [expected] * len(found), rtol=1e-9, atol=1e-9)


def test_observations_are_what_sensors_show_and_rewards_are_exact(short):
    seen, exact = short.with_sections(sensing=Sensing(noise={"rates": 0.05})), short
    noisy, paid, *_ = episode(TensegrityEnv(seen), seed=3)
    clean, due, *_ = episode(TensegrityEnv(exact), seed=3)
    assert paid == due
    cables = len(Robot.of(short).structure.cable_names)
    errors = (noisy - clean)[:, cables : 2 * cables] * Robot.of(short).structure.initial_lengths
    assert errors.std() == pytest.approx(0.05, rel=0.15)  # of 264 numbers
    np.testing.assert_array_equal(noisy[:, :cables], clean[:, :cables])


@pytest.mark.parametrize("objective", ["", "speed", "cost_of_transport", "rolled"])
def test_the_rewards_of_an_episode_are_the_fitness(short, objective):
    chosen = short.with_sections(objective={objective: 2.0}) if objective else short
    env = TensegrityEnv(chosen, record=True)
    _, rewards, *flags = episode(env, seed=3)
    result = env.result()
    assert flags == [False, True], "it ends with the time"
    assert sum(rewards) == pytest.approx(result.fitness, rel=1e-9)
    assert result.fitness != 0.0 and result.trajectory.time[-1] == 0.2
    dense = np.flatnonzero(rewards[:-1])
    assert (dense.size > 5) == (objective != "cost_of_transport")


def test_each_reward_for_rolling_is_the_angle_rolled_since_the_last(short):
    rolling = short.with_sections(objective={"rolled": 2.0})
    rewards, rolled = episode(TensegrityEnv(rolling), seed=3)[1], [0.0]
    for time in (0.1, 0.12, 0.14):
        env = TensegrityEnv(rolling.with_changes({"simulation.duration": f"{time} s"}))
        episode(env, seed=3)
        rolled.append(env.result().metrics.rolled)
    sums = np.diff([0.0, *np.cumsum(rewards)[[4, 5, 6]]])
    assert sums == pytest.approx(2.0 * np.diff(rolled), rel=1e-9)
    assert np.abs(rewards).min() > 0.0


def test_a_robot_that_fails_ends_its_episode_with_nothing(short):
    env = TensegrityEnv(short.with_changes({"cpg.gain": "4e9 N"}))
    _, rewards, terminated, truncated = episode(env, seed=0)
    assert (terminated, truncated) == (True, False)
    assert sum(rewards) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_robots_side_by_side_do_what_environments_of_one_robot_do(short, mode):
    """Also with some robots reset by a mask, and with other modes of beginning again."""
    many = TensegrityVectorEnv(LANES, short, autoreset_mode=mode.value, workers=1)
    single = SyncVectorEnv([lambda: TensegrityEnv(short)] * LANES, autoreset_mode=mode)
    generator, some = np.random.default_rng(0), np.arange(LANES) % 3 == 0
    start = many.reset(seed=7)[0]
    assert np.array_equal(many.reset(seed=[*range(7, 7 + LANES)])[0], start)
    assert not np.array_equal(many.reset()[0], start), "other draws"
    assert np.array_equal(many.reset(seed=7)[0], start)
    assert np.array_equal(single.reset(seed=7)[0], start)
    assert len({row.tobytes() for row in start}) == LANES, "each has a draw"
    ended = np.zeros(LANES, dtype=bool)
    for step in range(30):
        if step == 4 or (ended.any() and mode == AutoresetMode.DISABLED):
            masks = [{"reset_mask": ended if ended.any() else some} for _ in range(2)]
            ours, theirs = many.reset(options=masks[0]), single.reset(options=masks[1])
            assert np.array_equal(ours[0], theirs[0])
        actions = generator.uniform(-1.0, 1.0, many.action_space.shape)
        ours, theirs = many.step(actions), single.step(actions)
        for found, expected in zip(ours[:4], theirs[:4], strict=True):
            assert np.array_equal(found, expected), step
        ended = ours[2] | ours[3]
        assert ours[4].keys() == theirs[4].keys()


def test_a_picture_shows_the_robot_on_its_floor(short):
    env = gymnasium.make(WALK, scenario=short, render_mode="rgb_array")
    env.reset(seed=0)
    seen = [env.render() for _ in range(2) if env.step(env.action_space.sample())]
    for name in ("rear", "actuated", "passive", "square"):
        colour = np.frombuffer(bytes.fromhex(COLOURS[name][1:]), dtype=np.uint8)
        shown = [(each == colour).all(axis=-1).sum() for each in seen]
        assert min(shown) > 50, name
    assert seen[0].shape == (400, 680, 3) and not np.array_equal(*seen)
    assert env.metadata["render_fps"] == 50
    many = TensegrityVectorEnv(2, short, render_mode="rgb_array")
    many.reset(seed=0)
    env.reset(seed=0)
    assert np.array_equal(many.render()[0], env.render())


def test_a_copy_begins_anew(short, refused):
    for each in (TensegrityEnv(short), TensegrityVectorEnv(2, short)):
        each.reset()
        for copied in (copy.deepcopy(each), pickle.loads(pickle.dumps(each))):
            with refused("tetra_drake.gym", "step", "reset()"):
                copied.step(np.zeros(copied.action_space.shape))
            assert np.array_equal(copied.reset(seed=3)[0], each.reset(seed=3)[0])


def test_without_gymnasium_the_import_tells_what_to_install(monkeypatch, refused):
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    for name in ("gym", "lab.gym.environments"):
        monkeypatch.delitem(sys.modules, f"tetra_drake.{name}")
    with refused("tetra_drake.gym", "", "tetra_drake[gym]"):
        importlib.import_module("tetra_drake.gym")


def test_a_tree_search_branches_and_the_rewards_stay_the_fitness(short):
    one, other = TensegrityEnv(short), TensegrityEnv(short)
    one.reset(seed=3)
    actions = np.random.default_rng(1).uniform(-1, 1, (10, *one.action_space.shape))
    rewards = [one.step(action)[1] for action in actions[:4]]
    states = one.save()
    ends = []
    for env in (one, other):
        seen = env.restore(states)
        steps = [env.step(action) for action in actions[4:]]
        ends.append((seen.tobytes(), [(step[0].tobytes(), *step[1:4]) for step in steps]))
    assert ends[0] == ends[1] and ends[0][1][-1][3]
    rewards += [step[1] for step in steps]
    assert sum(rewards) == pytest.approx(other.result().fitness, rel=1e-9)
