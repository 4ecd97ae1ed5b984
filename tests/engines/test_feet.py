"""Feet with a radius: spheres that stand, roll and slide on the ground."""

import math
from typing import Any

import numpy as np
import pytest
from helpers.converged import shortly
from helpers.states import energy_and_momenta
from helpers.structures import poses_of, simulated
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from tetra_drake.engines.simulate import simulate
from tetra_drake.kernels.packed import Packed
from tetra_drake.laws.contact import MODE_COLUMNS, GroundSection, sliding
from tetra_drake.laws.forces import Forces
from tetra_drake.laws.friction import Coulomb
from tetra_drake.laws.mode_change import modes_after_step
from tetra_drake.laws.terrain import Flat
from tetra_drake.robot.ground import foot_gaps, make_surface
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import node_positions
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.robot_structure import StructureFile
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.systems import AddGroundContact

G, RADIUS, SLOPE, DURATION = 9.80665, 0.1, math.radians(10.0), 0.5
AXLE = {"pairs": [["a", "b"]], "diameter": 0.01, "density": 1000.0, "node_diameter": 2.0 * RADIUS}
WHEELS = {"nodes": {"a": [0.0, -0.2, RADIUS], "b": [0.0, 0.2, RADIUS]}, "struts": {"axle": AXLE}}
"""Two balls of 4.2 kg on a thin axle."""


def wheels(strut: dict[str, Any] | None = None, **changes: object) -> Scenario:
    tree = WHEELS | {"struts": {"axle": AXLE | (strut or {})}}
    scenario = load_scenario("prism").with_sections(robot=StructureFile.model_validate(tree))
    sure = "!Coulomb {static: 0.9, kinetic: 0.9, stiffness: 0 N/m, damping: 2 kN*s/m}"
    return shortly(
        scenario, DURATION, **{"friction": sure, "ground.stiffness": "100 kN/m"} | changes
    )


@pytest.mark.parametrize("kind", ["balls", "cylinder"])
def test_what_is_round_rolls_down_a_slope_by_its_inertia(engine, kind):
    # s = g sin(slope) t^2 / 2 / (1 + I / (m r^2)): I = 2/5 m r^2 of a ball, 1/2 of a cylinder.
    bare = {"node_diameter": 0.0, "diameter": 2.0 * RADIUS}
    strut, share = (None, 2.0 / 5.0) if kind == "balls" else (bare, 1.0 / 2.0)
    scenario = wheels(strut, terrain="!Incline {slope: -10 deg}", engine=engine)
    centre = simulate(scenario, seeded_gait(scenario), record=True).path.centre
    way = float(np.linalg.norm(centre[-1] - centre[0]))
    assert way == pytest.approx(0.5 * G * math.sin(SLOPE) / (1.0 + share) * DURATION**2, rel=0.01)


SMOOTH = "!Coulomb {static: 1e-9, kinetic: 1e-9}"
RUGGED = {
    "steps": "!Steps {height: 20 mm, depth: 90 mm, count: 20, start: 0 mm}",
    "low steps": "!Steps {height: 5 mm, depth: 60 mm, count: 20, start: 0 mm}",
    "down": "!Steps {height: -10 mm, depth: 100 mm, count: 20, start: 0 mm}",
    "rough": "!Rough {amplitude: 10 mm, wavelength: 120 mm}",
    "obstacles": "!Obstacles {height: 15 mm, radius: 40 mm, spacing: 100 mm, start: -300 mm}",
}
"""Terrains with edges and corners that are sharper than a foot of some centimetres."""


def energies_of_a_drop(
    terrain: str, seed: int, *, damped: bool, duration: float = 0.5
) -> tuple[np.ndarray, float]:
    """Energies (samples,) in J of two balls on an axle that fall on a terrain, and how far (m) the
    balls sank in. Size, place and stiffness of the ground are random."""
    random = np.random.default_rng(seed)
    radius, stiffness = random.uniform(0.005, 0.06), 10.0 ** random.uniform(3.3, 5.3)
    x, y, z = random.uniform([-0.1, -0.1, 0.08], [0.4, 0.1, 0.15]).tolist()
    bar = {"pairs": [["a", "b"]], "diameter": 0.004, "density": 1000.0, "node_diameter": 2 * radius}
    nodes = {"a": [0.0, -0.09, radius], "b": [0.03, 0.09, radius]}
    tree = {"nodes": nodes, "struts": {"axle": bar}, "offsets": [[x, y, z + radius]]}
    scenario = load_scenario("prism").with_sections(robot=StructureFile.model_validate(tree))
    damping = 2.0 * stiffness if damped else 0.0
    ground = {"ground.stiffness": f"{stiffness} N/m", "ground.damping": f"{damping} N*s/m^2"}
    friction = "!Coulomb {static: 0.5, kinetic: 0.4}" if damped else SMOOTH
    settings = {"terrain": RUGGED[terrain], "friction": friction, **ground}
    fine = "!Compiled {tolerance: 1e-6 m/s, max_step: 1 ms}"
    given = shortly(scenario, duration, engine=fine, simulation__sample_period="5 ms", **settings)
    robot = Robot.of(given)
    states = simulated(robot)[1].states
    energy = poses_of(states)[..., 6] @ robot.structure.mass * G
    energy += [energy_and_momenta(robot, state)[0] for state in states]
    p_WN = [node_positions(robot.structure, state)[robot.structure.contacts] for state in states]
    depths = np.maximum(-np.array([foot_gaps(p, robot.ground) for p in p_WN]), 0.0)
    return energy + 0.5 * stiffness * (depths**2).sum(axis=1), depths.max()


@pytest.mark.parametrize(("terrain", "seed"), [(name, i) for i, name in enumerate(RUGGED)])
def test_edges_and_corners_neither_give_nor_take_energy(terrain, seed):
    energy, depth = energies_of_a_drop(terrain, seed, damped=False)
    assert depth > 1e-4
    assert np.abs(energy - energy[0]).max() < 0.01 * abs(energy[0])


def test_feet_that_dissipate_only_lose_energy_at_edges():
    energy, depth = energies_of_a_drop("low steps", 7, damped=True)
    assert depth > 1e-4
    assert np.diff(energy).max() < 1e-4 * (energy[0] - energy[-1])


@pytest.mark.slow
@pytest.mark.parametrize("terrain", RUGGED)
@pytest.mark.parametrize("seed", range(10, 20))
def test_any_foot_on_any_ground_keeps_its_energy_or_loses_it(terrain, seed):
    energy, _ = energies_of_a_drop(terrain, seed, damped=False, duration=2.0)
    assert np.abs(energy - energy[0]).max() < 0.01 * abs(energy[0])
    energy, _ = energies_of_a_drop(terrain, seed, damped=True, duration=2.0)
    assert np.diff(energy).max() < 1e-3 * (energy[0] - energy[-1])


def test_a_ball_stands_its_radius_above_the_ground():
    robot = Robot.of(wheels())
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


def test_a_foot_below_the_ground_that_anchors_keep_there_is_refused(refused):
    tree = WHEELS | {"nodes": {"a": [0.0, 0.0, 0.0], "b": [0.0, 0.4, 0.0]}, "anchors": {"b": "z"}}
    with refused("anchored", "robot.nodes.a", "radius"):
        Robot.of(wheels().with_sections(name="anchored", robot=StructureFile.model_validate(tree)))


def test_a_ball_with_backspin_slides_until_it_rolls():
    # Angular momentum about the point of contact is kept: v = 5/7 (v_0 - 2/5 r w_0).
    builder, mass, v_0, w_0 = DiagramBuilder(), 0.2, 1.0, 20.0
    plant = builder.AddNamedSystem("plant", MultibodyPlant(time_step=0.0))
    ball = plant.AddRigidBody("ball", SpatialInertia.SolidSphereWithMass(mass, RADIUS))
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -G])
    plant.Finalize()
    law = GroundSection(stiffness=20e3, damping=2e5)
    ground = make_surface(law, Coulomb(static=0.3, kinetic=0.3), Flat())
    AddGroundContact(builder, plant, frames=[ball.body_frame()], ground=ground, radius=RADIUS)
    builder.ExportOutput(plant.get_state_output_port(), "state")
    simulator = Simulator(builder.Build())
    context = plant.GetMyContextFromRoot(simulator.get_mutable_context())
    depth = mass * G / law.stiffness
    plant.SetPositions(context, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, RADIUS - depth])
    plant.SetVelocities(context, [0.0, -w_0, 0.0, v_0, 0.0, 0.0])
    simulator.AdvanceTo(2.0)
    v_WB = plant.GetVelocities(context)[3:]
    assert v_WB[0] == pytest.approx(5.0 / 7.0 * (v_0 - 0.4 * RADIUS * w_0), rel=0.01)
    assert plant.GetVelocities(context)[1] == pytest.approx(v_WB[0] / RADIUS, rel=1e-3)


def test_the_deflection_of_a_foot_that_rolls_and_pivots_is_how_far_it_slid():
    # With a constant w_WB and a lowest point that slides at u, the error falls with the step
    # squared.
    robot, duration = Robot.of(wheels()), 0.4
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
