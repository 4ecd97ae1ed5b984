"""Structures that hang, stand on supports, carry loads or float, against what is known of them."""

import dataclasses

import numpy as np
import pytest
from helpers.anchored import HUNG, SWINGING, floating_prism, scenario_of, supported_prism
from helpers.converged import CONVERGED
from helpers.structures import poses_of, simulated, thrown

from tetra_drake.engines.gait_simulation import GaitSimulation
from tetra_drake.engines.interface import engine_of
from tetra_drake.engines.mujoco import installed
from tetra_drake.engines.simulate import simulate, simulate_many
from tetra_drake.report.run_figures import draw_trajectory
from tetra_drake.robot.gait import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.systems.diagram import MakeTensegrityDiagram

ENGINES = ["compiled", "drake"]
G = 9.80665


def moved(scenario: Scenario, engine: str) -> np.ndarray:
    """Positions p_WN (times, nodes, 3) by an engine that has converged."""
    converged = scenario.with_sections(engine=CONVERGED[engine])
    result = simulate(converged, seeded_gait(converged, 3), record=True)
    p_WN: np.ndarray = result.trajectory.p_WN.values
    return p_WN


@pytest.mark.parametrize("engine", CONVERGED)
def test_a_mass_on_a_cable_bounces_as_on_a_spring(engine):
    amplitude, k = 0.01, HUNG["cables"]["line"]["stiffness"]
    scenario = scenario_of(HUNG | {"offsets": [[0.0, 0.0, -amplitude]]})
    mass = Robot.of(scenario).structure.mass.sum()
    z = moved(scenario, engine)[:, 0, 2]
    times = np.linspace(0.0, 2.0, len(z))
    at_rest = 1.0 - 0.4 - mass * G / k
    expected = at_rest - amplitude * np.cos(np.sqrt(k / mass) * times)
    np.testing.assert_allclose(z, expected, atol=1e-6)


def swings(robot: Robot, angle: float, times: np.ndarray) -> np.ndarray:
    """Angles of a rigid pendulum that is let go at an angle: Runge-Kutta's method."""
    structure = robot.structure
    mass, xx = structure.mass[0], structure.mass[0] * structure.unit_inertia[0, 0]
    lever = np.linalg.norm(structure.p_BN[0])
    square = mass * G * lever / (xx + mass * lever**2)

    def rates(y: np.ndarray) -> np.ndarray:
        return np.array([y[1], -square * np.sin(y[0])])

    y, angles = np.array([angle, 0.0]), [angle]
    for step in np.diff(times):
        k1 = rates(y)
        k2 = rates(y + 0.5 * step * k1)
        k3 = rates(y + 0.5 * step * k2)
        k4 = rates(y + step * k3)
        y = y + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        angles.append(y[0])
    return np.array(angles)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_bar_held_at_one_end_swings_as_a_physical_pendulum(engine):
    angle = 0.5
    scenario = scenario_of(SWINGING).with_sections(engine=CONVERGED[engine])
    robot = Robot.of(scenario)
    c, s = np.cos(angle), np.sin(angle)
    about_y = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    turned = dataclasses.replace(
        robot.structure,
        p_WB=robot.structure.p_WB @ about_y.T,
        q_WB=np.array([[np.cos(0.5 * angle), 0.0, np.sin(0.5 * angle), 0.0]]),
    )
    robot = dataclasses.replace(robot, structure=turned)
    simulation = GaitSimulation(robot, seeded_gait(scenario), record=True)
    result = engine_of(scenario).simulate(simulation)
    p_WN, times = result.trajectory.p_WN.values, result.trajectory.time.values
    expected = swings(robot, angle, times)
    place = 0.4 * np.stack([-np.sin(expected), 0.0 * expected, -np.cos(expected)], axis=1)
    # The anchor gives way by m g / k, 0.7 um, and by some more as the bar speeds up.
    np.testing.assert_allclose(p_WN[:, 1], place, atol=1e-5)
    assert np.abs(p_WN[:, 0]).max() < 2e-6


def test_engines_agree_on_a_driven_prism_on_supports_with_loads():
    compiled, diagram = (moved(supported_prism(), engine) for engine in CONVERGED)
    assert np.ptp(compiled, axis=0).max() > 1e-3, "it moves"
    np.testing.assert_allclose(diagram, compiled, atol=1e-6)


def test_engines_agree_with_the_settings_of_every_day():
    for scenario in (supported_prism(), scenario_of(HUNG | {"offsets": [[0.01, 0.0, -0.01]]})):
        exact = moved(scenario, "compiled")
        for engine in ("!Compiled", "!Drake"):
            usual = scenario.with_changes({"engine": engine})
            result = simulate(usual, seeded_gait(usual, 3), record=True)
            np.testing.assert_allclose(result.trajectory.p_WN, exact, atol=1e-4)


@pytest.mark.skipif(not installed(), reason="needs mujoco")
@pytest.mark.parametrize("name", ["supported", "hung", "floating"])
def test_mujoco_moves_as_the_compiled_engine(name):
    scenarios = {
        "supported": supported_prism(),
        "hung": scenario_of(HUNG | {"offsets": [[0.0, 0.0, -0.01]]}),
        "floating": floating_prism(),
    }
    exact = moved(scenarios[name], "compiled")
    scenario = scenarios[name].with_changes({"engine": "!Mujoco", "friction.stiffness": "0 N/m"})
    result = simulate(scenario, seeded_gait(scenario, 3), record=True)
    np.testing.assert_allclose(result.trajectory.p_WN, exact, atol=1e-4)


def test_a_floating_prism_keeps_its_momentum():
    scenario = floating_prism(duration=1.0)
    robot = Robot.of(scenario)
    v_WB = np.zeros((3, 6))
    v_WB[:, 3:] = [0.3, -0.2, 0.1]
    v_WB[0, :3], v_WB[1, 3] = [1.0, 2.0, 0.0], 0.5
    _, motion = simulated(thrown(robot, v_WB))
    poses, velocities = poses_of(motion.states), motion.states[:, 21:].reshape(-1, 3, 6)
    mass = robot.structure.mass
    momentum = np.einsum("b,tbi->ti", mass, velocities[..., 3:])
    at_start = mass @ v_WB[:, 3:]
    np.testing.assert_allclose(momentum - at_start, 0.0, atol=1e-12)
    centre = np.einsum("b,tbi->ti", mass, poses[..., 4:]) / mass.sum()
    way = np.outer(motion.times, at_start / mass.sum())
    np.testing.assert_allclose(centre - centre[0], way, atol=1e-9)
    assert motion.modes.shape[1] == 0, "nothing touches"
    assert np.ptp(velocities[:, 0, :3], axis=0).max() > 0.1


def test_draws_with_other_loads_and_places_move_side_by_side_as_each_alone():
    loaded = HUNG | {"loads": {"b": [0.1, 0.0, 0.0]}}
    scenarios = [
        scenario_of(loaded, **{"robot.loads.b[0]": f"{force} N", "robot.nodes.top[0]": f"{x} m"})
        for force, x in ((0.1, 0.0), (0.2, 0.001), (0.3, 0.002))
    ]
    gaits = [seeded_gait(scenario, 3) for scenario in scenarios]
    together = simulate_many(scenario=scenarios, gaits=gaits, workers=1)
    for scenario, gait, result in zip(scenarios, gaits, together, strict=True):
        assert repr(result.metrics) == repr(simulate(scenario, gait).metrics)
    assert len({result.metrics.distance for result in together}) == 3


def test_a_stiff_anchor_takes_no_shorter_steps():
    def steps(stiffness: float) -> int:
        scenario = supported_prism(**{"robot.anchor_stiffness": f"{stiffness} N/m"})
        return simulate(scenario, seeded_gait(scenario, 3)).integrator.steps

    assert steps(1e9) < 2.0 * steps(1e5)


def test_a_diagram_has_state_forces_only_where_the_robot_has_anchors_or_loads():
    def systems(scenario: Scenario) -> set[str]:
        diagram = MakeTensegrityDiagram(Robot.of(scenario), seeded_gait(scenario))
        names = {system.get_name() for system in diagram.GetSystems()}
        return {name for name in names if not name.startswith("forces")}

    both, neither = systems(supported_prism()), systems(floating_prism())
    assert both - neither == {"state_forces"}
    assert systems(scenario_of(SWINGING)) - neither == {"state_forces"}
    assert "state_forces" not in systems(scenario_of(HUNG))


def test_pictures_of_a_floating_prism_leave_out_the_ground(tmp_path):
    scenario = floating_prism()
    result = simulate(scenario, seeded_gait(scenario, 3), record=True)
    assert result.trajectory.sizes["contact"] == 0
    assert result.metrics.lifted == 1.0
    captions = draw_trajectory(result, tmp_path)
    assert "ground_forces" not in captions
    assert {f"{name}.svg" for name in captions} <= {file.name for file in tmp_path.iterdir()}


def test_an_offset_moves_a_body_only_along_its_free_axes():
    offsets = [["0.01 m", "0.02 m", "0.03 m"]] * 3
    start = Robot.of(supported_prism()).structure.p_WB
    moves = Robot.of(supported_prism(**{"robot.offsets": offsets})).structure.p_WB - start
    by_bar = {"n0": [0.0, 0.0, 0.0], "n1": [0.01, 0.0, 0.0], "n2": [0.01, 0.02, 0.0]}
    structure = Robot.of(supported_prism()).structure
    for node, expected in by_bar.items():
        bar = structure.carriers[structure.node_names.index(node)]
        np.testing.assert_allclose(moves[bar], expected, atol=1e-15)
