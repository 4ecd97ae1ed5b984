"""Bodies thrown into the air, against Euler's equations, and what a robot in the air keeps."""

import dataclasses

import numpy as np
import pytest
from helpers.states import mass_matrix
from helpers.structures import driven_as_recorded, poses_of, simulated, thrown, unit_inertias
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator

from tetra_drake.robot.gait import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import Structure, node_positions
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.robot_structure import StructureFile
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.systems.diagram import MakeTensegrityDiagram

DURATION = 0.5
FLYING = {
    "simulation.duration": f"{DURATION} s",
    "simulation.steady_from": "0.25 s",
    "robot.gravity": 0.0,
}


def bent_body_and_bar() -> Scenario:
    """Two bodies, one of three different moments, and a cable that hangs loose between them."""
    make = {"diameter": 0.008, "density": 1200.0, "node_diameter": 0.016}
    kind = StructureFile(
        nodes={
            "a": [0.0, 0.0, 0.5],
            "b": [0.1, 0.0, 0.5],
            "c": [0.1, 0.06, 0.5],
            "d": [0.1, 0.06, 0.52],
            "e": [0.3, 0.0, 0.5],
            "f": [0.45, 0.05, 0.6],
        },
        struts={
            "bent": {"pairs": [["a", "b"], ["b", "c"], ["c", "d"]], **make},
            "bar": {"pairs": [["e", "f"]], **make},
        },
        cables={
            "loose": {"pairs": [["b", "e"]], "stiffness": 1.0, "damping": 0.0, "free_length": 99.0}
        },
        actuated={"one": ["loose b e"]},
        contacts=["a"],
        offsets=[[0.0, 0.0, 1.0], [0.0, 0.0, 1.0]],
    )
    flying = load_scenario("prism").with_sections(robot=kind.model_copy(update={"gravity": 0.0}))
    changes = {key: text for key, text in FLYING.items() if key.startswith("simulation")}
    return flying.with_changes(changes)


def turned_by_euler(structure: Structure, w_WB: np.ndarray, steps: int = 5_000) -> np.ndarray:
    """(bodies, 4): quaternions after DURATION by Euler's equations in the frames of the bodies,
    I w' = I w x w, by the classical Runge-Kutta method."""
    inertia = unit_inertias(structure)
    inverse = np.linalg.inv(inertia)

    def rates(state: np.ndarray) -> np.ndarray:
        q, w = state[:, :4], state[:, 4:]
        spin = np.einsum("bij,bj->bi", inertia, w)
        q_rates = np.column_stack(
            [-0.5 * (q[:, 1:] * w).sum(axis=1), 0.5 * (q[:, :1] * w + np.cross(q[:, 1:], w))]
        )
        return np.hstack([q_rates, np.einsum("bij,bj->bi", inverse, np.cross(spin, w))])

    state, h = np.hstack([structure.q_WB, w_WB]), DURATION / steps  # R_WB = 1 at t = 0
    for _ in range(steps):
        k1 = rates(state)
        k2 = rates(state + 0.5 * h * k1)
        k3 = rates(state + 0.5 * h * k2)
        k4 = rates(state + h * k3)
        state = state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return state[:, :4]


V_WB = np.array([[3.0, 7.0, -5.0, 0.1, 0.0, 0.2], [4.0, -9.0, 6.0, 0.0, -0.3, 0.1]])


@pytest.fixture(scope="module")
def flying() -> Robot:
    return thrown(Robot.of(bent_body_and_bar()), V_WB)


@pytest.fixture(scope="module")
def expected(flying) -> np.ndarray:
    """(bodies, 7): the poses after DURATION."""
    moments = np.linalg.eigvalsh(unit_inertias(flying.structure)[0])
    assert (np.diff(moments) > 0.1 * moments[0]).all(), "three different moments"
    q_WB = turned_by_euler(flying.structure, V_WB[:, :3])
    return np.hstack([q_WB, flying.structure.p_WB + DURATION * V_WB[:, 3:]])


def test_thrown_bodies_turn_by_eulers_equations_on_the_compiled_engine(flying, expected):
    fine = {"engine.tolerance": "1e-7 m/s", "engine.max_step": "1e-3 s"}
    _, motion = simulated(dataclasses.replace(flying, scenario=flying.scenario.with_changes(fine)))
    np.testing.assert_allclose(poses_of(motion.states)[-1], expected, atol=1e-6)


def test_thrown_bodies_turn_by_eulers_equations_on_the_diagram(flying, expected):
    diagram = MakeTensegrityDiagram(flying, seeded_gait(flying.scenario))
    simulator = Simulator(diagram)
    ResetIntegratorFromFlags(simulator, "runge_kutta3", 1e-3).set_target_accuracy(1e-9)
    simulator.get_mutable_context().SetContinuousState(flying.structure.initial_state)
    simulator.AdvanceTo(DURATION)
    state = diagram.GetOutputPort("state").Eval(simulator.get_context())
    np.testing.assert_allclose(poses_of(state[np.newaxis])[0], expected, atol=1e-9)


def test_the_spin_of_a_bar_about_its_axis_hardly_shortens_steps():
    # It exerts no torque. It turns with the axis, so it does add to the error of a long step.
    times = {"simulation.duration": "2 s", "simulation.steady_from": "1 s", "cpg.start_up": "0.5 s"}
    prism = load_scenario("prism").with_sections(robot=driven_as_recorded("prism"))
    robot = Robot.of(prism.with_changes(times))
    structure = robot.structure
    a, b = structure.struts.T
    axes = structure.p_BN[b] - structure.p_BN[a]
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    (still, motion), (spinning, spun) = (
        simulated(thrown(robot, np.hstack([spin * axes, np.zeros((3, 3))])))
        for spin in (0.0, 10.0)  # rad/s
    )
    assert spinning.integrator.steps < 1.25 * still.integrator.steps
    poses, others = poses_of(motion.states), poses_of(spun.states)
    np.testing.assert_allclose(others[..., 4:], poses[..., 4:], atol=5e-4)
    assert np.ptp(poses[..., 4:], axis=0).max() > 5e-3, "it walks"


@pytest.mark.parametrize(
    "name",  # the engine would be compiled for the six-bar alone
    ["prism", pytest.param("six_bar", marks=pytest.mark.slow)],
)
def test_a_structure_in_the_air_keeps_its_energy_and_momentum(name):
    scenario = load_scenario(name)
    loose = {f"robot.cables.{group}.damping": 0.0 for group in scenario.robot.cables}
    fine = {"engine.tolerance": "1e-7 m/s", "cpg.gain": 0.0}
    scenario = scenario.with_changes(FLYING | loose | fine)
    lifted = [[0.0, 0.0, 1.0]] * scenario.robot.body_count
    scenario = scenario.with_sections(robot=scenario.robot.model_copy(update={"offsets": lifted}))
    robot = Robot.of(scenario)
    moving = np.random.default_rng(0).normal(size=(len(robot.structure.bodies), 6))
    moving *= [2.0, 2.0, 2.0, 0.2, 0.2, 0.2]  # rad/s, m/s
    states = simulated(thrown(robot, moving))[1].states
    energy, momenta = zip(*(energy_and_momenta(robot, state) for state in states), strict=True)
    assert np.abs(poses_of(states)[-1] - poses_of(states)[0]).max() > 0.05, "it moves"
    np.testing.assert_allclose(energy, energy[0], rtol=1e-8)
    np.testing.assert_allclose(
        momenta, np.tile(momenta[0], (len(momenta), 1, 1)), atol=1e-8 * np.abs(momenta).max()
    )


def energy_and_momenta(robot: Robot, state: np.ndarray) -> tuple[float, np.ndarray]:
    """Energy of bodies and springs without gravity; momentum, and angular momentum about the
    origin."""
    structure, poses = robot.structure, poses_of(state[np.newaxis])[0]
    velocities, cables = state[poses.size :], structure.cables
    wrench = (mass_matrix(robot.model, state) @ velocities).reshape(-1, 6)
    p_WN = node_positions(structure, state)
    lengths = np.linalg.norm(p_WN[cables["node_b"]] - p_WN[cables["node_a"]], axis=1)
    stretch = np.maximum(lengths - cables["free_length"], 0.0)
    elastic = 0.5 * (cables["stiffness"] * stretch**2).sum()
    angular = (wrench[:, :3] + np.cross(poses[:, 4:], wrench[:, 3:])).sum(axis=0)
    kinetic = 0.5 * velocities @ wrench.ravel()
    return kinetic + elastic, np.array([wrench[:, 3:].sum(axis=0), angular])
