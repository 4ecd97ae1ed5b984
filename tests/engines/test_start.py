"""Robots that start turned and in motion, or are pushed, on all engines."""

import numpy as np
import pytest
from helpers.anchored import TREES, scenario_of
from helpers.joined import swing

from tetra_drake.engines.drake import MakeSimulator
from tetra_drake.engines.simulate import simulate
from tetra_drake.laws.terrain import Flat, Incline
from tetra_drake.robot.command import Command
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import moved_nodes
from tetra_drake.scenario.engine_kinds import Drake
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.systems.diagram import MakeTensegrityDiagram

G = 9.80665
BALLS, ROD = TREES["balls"], TREES["rod"]
THROWN = {"rest": False, "velocity": [3.0, 0.0, 4.0]}
PUSH = {"at": "0.1 s", "push": {"impulse": ["0 N*s", "0 N*s", "0.02 N*s"], "on": "b"}}
SPIN = 3.0


def pushed_rod(times: np.ndarray) -> np.ndarray:
    """The end b of a rod that turns by J l / 2 I, and flies by J / m, after 0.1 s."""
    robot = Robot.of(scenario_of(ROD | {"start": {"rest": False}}))
    mass, square = robot.structure.mass[0], robot.structure.unit_inertia[0, 2]
    since = np.maximum(times - 0.1, 0.0) * 0.02 / mass
    angle = 0.2 * since / square
    along, up = 0.2 * np.cos(angle), 0.2 * np.sin(angle)
    return np.stack([0.2 + along, 0.0 * times, 1.0 + since + up], axis=1)


def swinging_rod(times: np.ndarray) -> np.ndarray:
    """The end b of a pendulum that starts level, downwards."""
    square = Robot.of(scenario_of(ROD | {"start": {"rest": False}})).structure.unit_inertia[0, 2]
    square = G * 0.2 / (square + 0.2**2)
    down = 0.5 * np.pi + swing(square, times, angle=-0.5 * np.pi, rate=SPIN)
    return np.stack([0.4 * np.cos(down), 0.0 * down, 1.0 - 0.4 * np.sin(down)], axis=1)


SWUNG = {"rest": False, "velocity": [0.0, 0.0, -0.2 * SPIN], "spin": [0.0, SPIN, 0.0]}
PUSHED = {"start": {"rest": False}, "gravity": 0.0}
PIVOT = {"anchors": {"a": "xyz", "c": "xyz"}, "start": SWUNG}
STARTS = {
    "a rod is pushed at its end": (ROD | PUSHED, {"events": [PUSH]}, pushed_rod, 1e-5),
    "a pendulum swings on": (TREES["held_rod"] | PIVOT, {}, swinging_rod, 1e-3),
}


@pytest.mark.parametrize(("tree", "changes", "expected", "atol"), STARTS.values(), ids=STARTS)
def test_what_spins_or_is_pushed_moves_as_analysis_says(tree, changes, expected, atol, engine):
    given = {"engine": engine, "friction.stiffness": "0 N/m", "simulation.sample_period": "0.01 s"}
    scenario = scenario_of(tree, 0.3, **given, **changes)
    found = simulate(scenario, seeded_gait(scenario), record=True).trajectory
    p_WN = expected(found.time.values)
    np.testing.assert_allclose(found.p_WN.sel(node="b"), p_WN, atol=atol)
    assert np.ptp(p_WN, axis=0).max() > 0.1


@pytest.mark.parametrize("damping", [20.0, 0.0])
def test_a_command_does_not_push_a_ball_that_falls_on_a_loose_tether(engine, damping):
    tether = TREES["tethered"]["cables"]["tether"] | {"damping": damping}
    tree = TREES["tethered"] | {"cables": {"tether": tether}, "offsets": [[0.0, 0.0, 0.5]]}
    tree["start"] = {"rest": False}
    scenario = scenario_of(tree, 0.3, **{"engine": engine, "friction.stiffness": "0 N/m"})
    push = Command("push", 1.0, np.array([[-2.0]]))
    found = simulate(scenario, command=push, record=True).trajectory
    height = found.p_WN.sel(node="ball", axis="z")
    np.testing.assert_allclose(height, height[0] - 0.5 * G * found.time**2, atol=2e-4)
    assert not found.tension.values.any()


def turned(name: str, terrain: object = Flat(), **start: object) -> Scenario:
    changes = {"robot.start": start, "terrain": terrain}
    return load_scenario(name).with_changes(changes)


def test_a_turned_robot_stands_as_deep_in_the_ground_as_before_and_keeps_its_shape():
    still = Robot.of(load_scenario("six_bar")).structure
    structure = Robot.of(turned("six_bar", turned={"pitch": "50 deg", "yaw": "1 rad"})).structure
    before, after = (moved_nodes(each, each.initial_state)[:, 3:6] for each in (still, structure))
    assert after[:, 2].min() == pytest.approx(before[:, 2].min(), abs=1e-12)
    distances = [np.linalg.norm(p[:, None] - p, axis=2) for p in (before, after)]
    np.testing.assert_allclose(distances[1], distances[0], atol=1e-12)
    top = np.linalg.norm(after - before, axis=1).max()
    assert top > 0.5 * distances[0].max()


def test_a_spin_moves_all_bodies_about_the_robots_centre_and_turns_with_the_incline():
    start = {"velocity": ["1 m/s", "0 m/s", "0 m/s"], "spin": ["0 rad/s", "0 rad/s", "2 rad/s"]}
    level, sloping = (
        Robot.of(turned("prism", each, **start)) for each in (Flat(), Incline(slope=0.3))
    )
    p_WB, v_WB = level.structure.p_WB, level.structure.v_WB
    arms = p_WB - level.structure.mass @ p_WB / level.structure.mass.sum()
    expected = np.add([1.0, 0.0, 0.0], np.cross([0.0, 0.0, 2.0], arms))
    np.testing.assert_allclose(v_WB[:, 3:], expected, atol=1e-14)
    np.testing.assert_allclose(v_WB[:, :3], [[0.0, 0.0, 2.0]] * 3, atol=1e-15)
    up = [-np.sin(0.3), 0.0, np.cos(0.3)]
    np.testing.assert_allclose(sloping.structure.v_WB[:, :3], [2.0 * np.array(up)] * 3, atol=1e-14)
    assert np.abs(sloping.structure.v_WB[:, 3:] @ up).max() < 1e-14


def test_the_diagrams_default_context_and_its_simulator_have_the_velocities_of_the_start():
    robot = Robot.of(scenario_of(BALLS | {"start": THROWN}, engine="!Drake"))
    diagram = MakeTensegrityDiagram(robot)
    simulator = MakeSimulator(diagram, robot, Drake())
    for context in (diagram.CreateDefaultContext(), simulator.get_context()):
        found = context.get_continuous_state().get_generalized_velocity().CopyToVector()
        np.testing.assert_array_equal(found, [0.0, 0.0, 0.0, 3.0, 0.0, 4.0] * 2)


@pytest.mark.parametrize("name", ["held_rod", "joined_rod"])
def test_what_is_held_along_other_axes_may_start_in_motion(name):
    start = {"rest": False, "velocity": [0.0, 1.0, 0.0]}
    robot = Robot.of(scenario_of(TREES[name] | {"start": start}))
    np.testing.assert_array_equal(robot.structure.v_WB[0], [0.0, 0.0, 0.0, 0.0, 1.0, 0.0])
