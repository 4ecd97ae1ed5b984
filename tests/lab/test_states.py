"""States that are saved, written and restored, and damage while a robot moves, in lanes."""

import pickle

import numpy as np
import pytest
from helpers.actuations import WINCH
from helpers.converged import shortly

from tetra_drake.errors import Diverged
from tetra_drake.lab.stepping.simulation import Simulation
from tetra_drake.lab.stepping.states import States
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.scenario import Scenario

PERIODS, SAVED, CUT = 10, 6, "T1-T2 outer bottom_left"
PUSH = {"at": "0.05 s", "push": {"impulse": ["0 N*s", "0 N*s", "2 mN*s"], "on": "T1"}}


@pytest.fixture
def walk() -> Scenario:
    """0.2 s of two disturbed tetrahedra with winches; one is pushed, and the front loses its
    load."""
    changes = {"robot.tetrahedra": 2, "friction.stiffness": "0 N/m"}
    changes |= {"robot.payload": ["0 g", "3 g"], "events": [PUSH, {"at": "0.11 s", "lose": ["T2"]}]}
    changes |= WINCH | {"disturbances": {"draws": 1, "start": 0.01}}
    return shortly(load_scenario("coulomb"), 0.2, **changes)


def go(simulation: Simulation, periods: range, *, seed: int = 0) -> np.ndarray:
    """The nodes after some control periods, with drawn actions that are the same for all robots."""
    drawn = np.random.default_rng(seed).uniform(-0.004, 0.004, (PERIODS, simulation.rest.shape[1]))
    for period in periods:
        readings = simulation.step(simulation.rest[:1] + drawn[period] + 0.0 * simulation.rest)
    return readings.p_WN


@pytest.mark.parametrize("saved", [4, SAVED])  # before the event and after it
def test_a_restored_robot_goes_on_in_any_place_as_if_it_had_not_stopped(walk, saved):
    one, other = (Simulation(walk, count=n, record=True, workers=1) for n in (1, 3))
    one.reset(seed=[7])
    go(one, range(saved))
    states, early = one.save(history=True), one.save()
    expected, result = go(one, range(saved, PERIODS)), one.result()
    other.restore(states, [2])
    assert other.save([2], history=True) == states
    other.restore(early, [0, 1])
    assert (other.state.p_WN == states.tables["readings.p_WN"]).all()
    found = go(other, range(saved, PERIODS))
    assert (found == expected).all(), "bit for bit"
    again = other.result(2)
    assert again.metrics == result.metrics and again.trajectory.equals(result.trajectory)


def test_a_robot_branches_and_a_copy_replays_it(walk):
    robots = Simulation(walk, count=2, workers=1)
    robots.reset(seed=1)
    go(robots, range(SAVED))
    robots.copy(1, to=[0], history=True)
    branch = robots.save()
    left = go(robots, range(SAVED, PERIODS), seed=1)
    robots.restore(branch)
    right = go(robots, range(SAVED, PERIODS), seed=2)
    robots.restore(branch[[1, 0]])
    replayed = go(robots, range(SAVED, PERIODS), seed=1)
    assert (replayed == left).all()
    assert np.abs(left - right).max() > 1e-3
    robots.reset(seed=1)
    assert np.abs(np.subtract(*go(robots, range(SAVED)))).max() > 1e-4


def test_damage_is_an_events_cut_at_the_same_time_and_goes_with_the_state(walk):
    cut = {"at": f"{SAVED * walk.simulation.control_period} s", "cut": [CUT]}
    told = walk.with_changes({"events": [PUSH]})
    planned = told.with_changes({"events": [PUSH, cut]})
    expected = Simulation(planned, record=True)
    free = Simulation(told, count=2, record=True)
    go(expected, range(SAVED))
    go(free, range(SAVED))
    free.damage(1, cables=[CUT])
    free.restore(free.save([1], history=True), [0])
    nodes, found = (go(each, range(SAVED, PERIODS)) for each in (expected, free))
    assert (found == nodes).all()
    assert (free.state.tensions[:, 0] == 0.0).all()
    for place in (0, 1):
        tension = free.result(place).trajectory.tension - expected.result().trajectory.tension
        assert np.abs(tension).max() < 1e-12
    free.reset()
    assert go(free, range(2)) is not None and (free.state.tensions[:, 0] > 0.0).all()


@pytest.fixture
def short() -> Scenario:
    return shortly(load_scenario("quick"), 0.2, engine="!Compiled")


def test_states_are_values_and_a_damaged_file_is_refused(short, tmp_path, refused):
    simulation, path, pages = Simulation(short, count=3), tmp_path / "states.npz", 0
    go(simulation, range(2))
    states = simulation.save(history=True)
    assert states == simulation.save(history=True) == pickle.loads(pickle.dumps(states))
    assert states[[0, 2]] == simulation.save([0, 2], history=True) != states
    assert simulation.save() != states and states.time.tolist() == [0.04] * 3
    states[:1].save_npz(path)
    assert States.load(path) == states[0]
    content, generator = path.read_bytes(), np.random.default_rng(0)
    for _ in range(150):
        damaged = bytearray(content)
        damaged[generator.integers(len(content))] ^= 1 << generator.integers(8)
        path.write_bytes(damaged)
        try:
            assert States.load(path) == states[0]
        except ValueError as error:
            assert str(error).startswith(f"{path}: ") and "\n" not in str(error)
            pages += 1
    assert pages > 100
    states[0].save_npz(path)
    with np.load(path) as file:
        tables = dict(file)
    np.savez(path, **tables | {"held": tables["held"] + 1.0})
    with refused(path, "", "digest"):
        States.load(path)


def test_a_failed_robot_keeps_its_failure_and_the_others_go_on(short, tmp_path):
    one, other = (Simulation(short, count=2, workers=1) for _ in range(2))
    actions = one.rest.copy()
    actions[1] = 1e9
    seen = [one.step(actions) for _ in range(4)][-1]
    assert isinstance(one.failures[1], Diverged) and one.failures[0] is None
    one.save().save_npz(tmp_path / "states.npz")
    states = States.load(tmp_path / "states.npz")
    assert (other.restore(states).p_WN == seen.p_WN).all()
    assert repr(other.failures) == repr(one.failures) and other.ended.tolist() == [False, True]
    expected, found = one.step(one.rest), other.step(one.rest)
    assert (found.p_WN == expected.p_WN).all()
    assert (found.p_WN[1] == seen.p_WN[1]).all()
    other.restore(states[0], [1])
    assert other.failures == [None, None]
    assert (other.step(one.rest).p_WN[1] == found.p_WN[0]).all()
