"""Feet with a radius: spheres that stand, roll and slide on the ground."""

import math

import numpy as np
import pytest
from helpers.anchored import scenario_of
from helpers.converged import CONVERGED, shortly
from helpers.laws import COULOMB, FIRM, RESET
from helpers.states import energy_and_momenta
from helpers.structures import poses_of, simulated
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RotationMatrix

from tetra_drake.kernels.packed import Packed
from tetra_drake.laws.contact import MODE_COLUMNS, sliding
from tetra_drake.laws.forces import Forces
from tetra_drake.laws.mode_change import modes_after_step
from tetra_drake.laws.terrain import Rough
from tetra_drake.robot.ground import foot_gaps
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import node_positions
from tetra_drake.scenario.robot_structure import StructureFile
from tetra_drake.scenario.scenario import Scenario

G, RADIUS = 9.80665, 0.1
AXLE = {"pairs": [["a", "b"]], "diameter": 0.01, "density": 1000.0, "node_diameter": 2.0 * RADIUS}
WHEELS = {"nodes": {"a": [0.0, -0.2, RADIUS], "b": [0.0, 0.2, RADIUS]}, "struts": {"axle": AXLE}}
"""Two balls of 4.2 kg on a thin axle."""
SURE = "!Coulomb {static: 0.9, kinetic: 0.9, stiffness: 0 N/m, damping: 2 kN*s/m}"


def wheels() -> Robot:
    stiff = {"ground.stiffness": "100 kN/m", "friction": SURE}
    return Robot.of(scenario_of(WHEELS, 0.5, terrain="!Flat", **stiff))


SMOOTH = "!Coulomb {static: 1e-9, kinetic: 1e-9}"
RUGGED = {
    "steps": "!Steps {height: 20 mm, depth: 90 mm, count: 20, start: 0 mm}",
    "low steps": "!Steps {height: 5 mm, depth: 60 mm, count: 20, start: 0 mm}",
    "down": "!Steps {height: -10 mm, depth: 100 mm, count: 20, start: 0 mm}",
    "rough": "!Rough {amplitude: 10 mm, wavelength: 120 mm}",
    "obstacles": "!Obstacles {height: 15 mm, radius: 40 mm, spacing: 100 mm, start: -300 mm}",
}
"""Terrains with edges and corners that are sharper than a foot of some centimetres."""


def energies_of(scenario: Scenario, *, seed: int = 1) -> tuple[np.ndarray, float]:
    """Energies (samples,) in J of a robot that falls on its ground, of its bodies, cables and feet,
    and how far (m) its feet sank in."""
    robot = Robot.of(scenario)
    states = simulated(robot, seed=seed)[1].states
    energy = poses_of(states)[..., 6] @ robot.structure.mass * G
    energy += [energy_and_momenta(robot, state)[0] for state in states]
    p_WN = [node_positions(robot.structure, state)[robot.structure.contacts] for state in states]
    depths = np.maximum(-np.array([foot_gaps(p, robot.ground) for p in p_WN]), 0.0)
    return energy + 0.5 * scenario.ground.stiffness * (depths**2).sum(axis=1), depths.max()


def dropped(terrain: str, seed: int, *, damped: bool, duration: float) -> Scenario:
    """Two balls on an axle over a terrain. Size, place and stiffness of the ground are random."""
    random = np.random.default_rng(seed)
    radius, stiffness = random.uniform(0.005, 0.06), 10.0 ** random.uniform(3.3, 5.3)
    x, y, z = random.uniform([-0.1, -0.1, 0.08], [0.4, 0.1, 0.15]).tolist()
    bar = {"pairs": [["a", "b"]], "diameter": 0.004, "density": 1000.0, "node_diameter": 2 * radius}
    nodes = {"a": [0.0, -0.09, radius], "b": [0.03, 0.09, radius]}
    tree = {"nodes": nodes, "struts": {"axle": bar}, "offsets": [[x, y, z + radius]]}
    damping = 2.0 * stiffness if damped else 0.0
    changes = {"ground.stiffness": f"{stiffness} N/m", "ground.damping": f"{damping} N*s/m^2"}
    changes["friction"] = "!Coulomb {static: 0.5, kinetic: 0.4}" if damped else SMOOTH
    changes["simulation.sample_period"] = "1 ms"  # an impact takes some 3 ms
    fine = "!Compiled {tolerance: 1e-6 m/s, max_step: 1 ms}"
    return scenario_of(tree, duration, engine=fine, terrain=RUGGED[terrain], **changes)


DROPS = [(name, i, 0.5) for i, name in enumerate(RUGGED)]
ANY = [pytest.param(name, i, 2.0, marks=pytest.mark.slow) for name in RUGGED for i in range(10, 20)]


@pytest.mark.parametrize("damped", [False, True])
@pytest.mark.parametrize(("terrain", "seed", "duration"), DROPS + ANY)
def test_edges_and_corners_give_no_energy_and_take_it_by_damping_alone(
    terrain, seed, duration, damped
):
    energy, depth = energies_of(dropped(terrain, seed, damped=damped, duration=duration))
    assert depth > 1e-4
    if damped:
        assert np.diff(energy).max() < 1e-3 * (energy[0] - energy[-1])
    else:
        assert np.abs(energy - energy[0]).max() < 0.01 * abs(energy[0])


@pytest.mark.parametrize("friction", [RESET["reset"], COULOMB, FIRM])
def test_friction_never_gives_energy(scenario, friction):
    # A bristle's spring can only hold what it has taken.
    changes = {"robot.offsets": [[0.0, 0.0, "5 mm"]] * 5, "robot.contacts": "all", "cpg.gain": 0.0}
    changes |= {"terrain": Rough(amplitude=6e-3, wavelength=0.1, seed=5), "friction": friction}
    changes |= {"simulation.sample_period": "4 ms", "engine": CONVERGED["compiled"]}
    falling = shortly(scenario, 0.4).with_changes(changes)
    energy, _ = energies_of(falling, seed=2)
    lost = energy[0] - energy[-1]
    assert np.diff(energy).max() < 1e-4 * lost
    assert lost > 0.5 * Robot.of(falling).weight * 0.005


def test_a_ball_stands_its_radius_above_the_ground():
    robot = wheels()
    heights = node_positions(robot.structure, robot.equilibrium.state)[:, 2]
    np.testing.assert_allclose(heights, RADIUS - robot.weight / 2.0 / 1e5, atol=1e-9)


def test_a_foot_is_as_thick_as_its_sphere_else_as_its_strut_unless_the_file_says_so():
    def radius(strut: dict[str, float], **parts: object) -> float:
        tree = WHEELS | {"struts": {"axle": AXLE | strut}} | parts
        return float(StructureFile.model_validate(tree).blueprint().contact_radius[0])

    assert radius({}) == RADIUS
    assert radius({"node_diameter": 0.0}) == 0.005
    assert radius({"contact_radius": 0.02}) == 0.02
    assert radius({}, anchors={"a": "z"}) == 0.0  # its support holds it
    ball = {"nodes": ["a"], "diameter": 0.06, "density": 1000.0}
    assert radius({}, spheres={"ball": ball}) == 0.03


def test_the_deflection_of_a_foot_that_rolls_and_pivots_is_how_far_it_slid():
    # With a constant w_WB and a lowest point that slides at u, the error falls with the step
    # squared.
    robot, duration = wheels(), 0.4
    w_WB, u, up = np.array([3.0, 1.0, 2.0]), np.array([0.02, -0.01, 0.0]), np.array([0, 0, RADIUS])
    start = robot.structure.initial_state
    place, p_BN = start[4:7] + robot.structure.p_BN[0], robot.structure.p_BN[0]

    def state_at(time: float) -> np.ndarray:
        state, half = start.copy(), 0.5 * time * np.linalg.norm(w_WB)
        state[:4] = np.append(math.cos(half), math.sin(half) * w_WB / np.linalg.norm(w_WB))
        p_BN_W = RotationMatrix(Quaternion(state[:4])).matrix() @ p_BN
        state[4:7] = place + (np.cross(w_WB, up) + u) * time - p_BN_W
        return state

    def error(steps: int) -> float:
        modes, forces = np.zeros((2, MODE_COLUMNS)), Forces.of(robot.model)
        parts = Packed((robot.model, forces))
        for k in range(steps + 1):
            state = state_at(k * duration / steps)
            modes_after_step(parts, state, modes)
        slide, _ = sliding(state, forces.nodes, modes, robot.ground, forces.frames, 0)
        slid = np.array([slide.t1.deflection, slide.t2.deflection])
        return float(np.linalg.norm(slid - u[:2] * duration))

    assert error(40) < 1e-4
    assert error(40) / error(80) == pytest.approx(4.0, rel=0.1)
