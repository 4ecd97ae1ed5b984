"""Robots in control periods, Simulation(count=N), and controllers that do the same."""

import functools
import math
import multiprocessing
import signal
import threading
from concurrent.futures import ThreadPoolExecutor
from unittest.mock import Mock

import numpy as np
import pytest
from helpers.actuations import FORCE, MOTOR, WINCH

from tetra_drake.engines.lanes.batch import LaneThread, processor_lanes
from tetra_drake.engines.simulate import simulate
from tetra_drake.errors import Diverged, InputError
from tetra_drake.lab.stepping.simulation import Simulation
from tetra_drake.robot.command import Command
from tetra_drake.scenario.experiment_sections import Disturbances
from tetra_drake.scenario.scenario import Scenario

PERIOD, PERIODS, LANES = 0.02, 15, processor_lanes()
SPANS = {"!Force": 2.0, "!Winch": 0.01, "!TensionMotor": 1.0}
"""Actions differ from those at rest by up to this, in N, m and N."""


READINGS = {"length": "lengths", "normal_force": "normal_forces", "tension": "tensions"}
READINGS |= {name: name for name in ("p_WN", "v_WN", "q_WB")}
"""Of variables of a trajectory."""


@pytest.fixture
def short(scenario: Scenario) -> Scenario:
    """0.3 s on the compiled engine, with a mark within a control period, in samples of one."""
    times = {"duration": 0.3, "steady_from": 0.1125, "sample_period": PERIOD}
    changes = {f"simulation.{key}": f"{time} s" for key, time in times.items()}
    return scenario.with_changes(changes | {"engine": "!Compiled"})


def drawn_actions(simulation: Simulation, *, seed: int = 0) -> np.ndarray:
    """Random actions (periods, robots, actions) around those at rest."""
    shape = PERIODS, *simulation.rest.shape
    drawn = np.random.default_rng(seed).uniform(-1.0, 1.0, shape)
    return simulation.rest + SPANS[f"!{simulation.scenario.actuation.tag}"] * drawn


def go(simulation: Simulation, actions: np.ndarray) -> list:
    """The readings at the start and after each period."""
    return [simulation.state, *(simulation.step(each) for each in actions)]


ACTUATIONS = [(FORCE, 7), (WINCH, 12), (MOTOR, 1)]
"""Kinds of actuators, and steps of the listing in a control period."""


def brief(scenario: Scenario, actuation: dict, steps: int, *, periods: int = 6) -> Scenario:
    """A few control periods of two tetrahedra, with a sample in the middle of each."""
    period = steps * scenario.cpg.listing_step
    shares = {"duration": periods, "steady_from": 2.625, "sample_period": 0.5, "control_period": 1}
    times = {f"simulation.{key}": share * period for key, share in shares.items()}
    return scenario.with_changes(actuation | {"robot.tetrahedra": 2}).with_numbers(times)


@pytest.mark.parametrize("count", [1, LANES])
@pytest.mark.parametrize(("actuation", "steps"), ACTUATIONS)
def test_steps_and_a_controller_with_the_samples_of_a_command_give_its_motion(
    short, actuation, steps, count
):
    scenario = brief(short, actuation, steps)
    simulation = Simulation(scenario, count=count, record=True, workers=1)
    period, actions = simulation.control_period, drawn_actions(simulation)[:6]
    found = go(simulation, actions)
    for robot in (0, count - 1):
        command = Command("drawn", period, actions[:, robot])
        expected = simulate(scenario, command=command, record=True)
        controller = Mock(side_effect=[*actions[:, robot]])
        controlled = simulate(scenario, controller=controller, record=True)
        result, trajectory = simulation.result(robot), expected.trajectory
        assert controlled.trajectory.equals(trajectory) and controller.call_count == 6
        assert result.trajectory.equals(trajectory), "bit for bit"
        assert result.integrator == expected.integrator
        assert result.metrics.distance == expected.metrics.distance
        for name, readings in READINGS.items():
            read = np.array([getattr(each, readings)[robot] for each in found[1:]])
            np.testing.assert_allclose(read, trajectory[name][2::2], rtol=0, atol=1e-6)
        if actuation == FORCE:  # forces are the signals
            held = trajectory.signal[1::2]
            np.testing.assert_allclose(held, actions[:, robot], atol=1e-9)
            assert np.array_equal(trajectory.signal[0], actions[0, robot])
    assert found[-1].time.tolist() == pytest.approx([6 * period] * count)


def test_a_robot_that_diverges_says_so_and_does_not_stop_the_others(short):
    alone, simulation = (Simulation(short, count=LANES, workers=1) for _ in range(2))
    actions = drawn_actions(alone)
    bad = actions.copy()
    bad[3, 2], bad[4:, 2] = 1e9, math.nan
    expected, found = go(alone, actions)[-1], go(simulation, bad)[-1]
    assert isinstance(simulation.failures[2], Diverged)
    assert 0.06 <= simulation.failures[2].time < 0.08
    with pytest.raises(Diverged):
        simulation.result(2)
    others = np.arange(LANES) != 2
    assert [failure is None for failure in simulation.failures] == others.tolist()
    for ours, theirs in zip(found, expected, strict=True):
        assert np.array_equal(ours[others], theirs[others])
    simulation.reset(indices=[2])
    simulation.reset(indices=[0])
    simulation.step(simulation.rest, indices=[0])
    assert simulation.failures[2] is None and not simulation.ended[2]


def test_each_seed_disturbs_robots_in_its_own_way_and_none_does_not(short):
    settings = Disturbances(draws=1, spreads={"robot.spacing": 0.02}, start=0.01)
    robots = Simulation(short.with_sections(disturbances=settings), count=LANES, workers=1)
    plain = robots.state.p_WN
    starts = [robots.reset(seed=seed).p_WN for seed in (1, 1, 2, [3] * LANES)]
    assert np.array_equal(starts[0], starts[1])
    assert len({start.tobytes() for start in np.concatenate([*starts[1:], plain])}) == 2 * LANES + 2
    assert np.array_equal(robots.reset().p_WN, plain)


def test_the_last_period_ends_with_the_simulation(short):
    simulation = Simulation(short.with_changes({"simulation.duration": "0.25 s"}))
    times = [float(readings.time[0]) for readings in go(simulation, np.zeros((13, 1, 8)))]
    assert times[-2:] == [0.24, 0.25] and simulation.ended.all()


def test_after_an_interrupt_a_reset_makes_the_robots_whole(short, monkeypatch, refused):
    two = Simulation(short.with_changes({"robot.tetrahedra": 2}), count=2, workers=1)
    actions, call = drawn_actions(two)[:3], LaneThread.simulate
    expected = go(two, actions)[-1]
    two.reset()
    two.step(actions[0])
    signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in jobs of a script

    def interrupted(*arguments, **options):
        call(*arguments, **options)
        if threading.current_thread() is threading.main_thread():  # which gets all signals
            signal.raise_signal(signal.SIGINT)

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(LaneThread, "simulate", interrupted)
        two.step(actions[1])
    with refused("Simulation", "step", "reset() all robots"):
        two.step(actions[1])
    with refused("Simulation", "reset", "reset() all robots"):
        two.reset(indices=[1])
    two.reset()
    for found, wanted in zip(go(two, actions)[-1], expected, strict=True):
        assert np.array_equal(found, wanted)


def test_another_thread_is_refused_during_a_step(short, monkeypatch):
    simulation, told, call = Simulation(short), [], LaneThread.simulate
    with ThreadPoolExecutor(1) as pool, monkeypatch.context() as patch:
        step = functools.partial(pool.submit, simulation.step, simulation.rest)
        patch.setattr(
            LaneThread, "simulate", lambda *a, **o: (told.append(step().exception()), call(*a, **o))
        )
        assert simulation.step(simulation.rest).time == [PERIOD]
    assert [(type(error), error.key) for error in told] == [(InputError, "step")]


def test_robots_in_two_threads_go_on_in_a_fork(short):
    simulation = Simulation(short, count=2, workers=2)
    simulation.step(simulation.rest)
    fork = multiprocessing.get_context("fork")
    child = fork.Process(target=simulation.step, args=(simulation.rest,))
    child.start()
    child.join(60.0)
    assert child.exitcode == 0
