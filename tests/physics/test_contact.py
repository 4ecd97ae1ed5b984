"""Normal force, friction and stiction of single nodes, against their equations."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pydrake.geometry import AddContactMaterial, HalfSpace, ProximityProperties, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, ContactModel, CoulombFriction
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.framework import DiagramBuilder

from tetra_drake.physics.contact import (
    CONTACT,
    MODE,
    MODE_COLUMNS,
    STICK_POINT,
    first_zero,
    ground_forces,
    mode_margin,
    normal_force,
    time_to_mode_change,
    update_modes,
)
from tetra_drake.physics.friction import STICK, friction_force, next_friction_mode
from tetra_drake.physics.kinematics import node_motion
from tetra_drake.robot.model import ground_law
from tetra_drake.robot.structure import MakeStructure, Structure
from tetra_drake.scenario.schema import Scenario

P0, SIGMA_1, A_C, SIGMA_0 = 1e-4, 70.0, 0.7, 2000.0
FRICTION = (P0, SIGMA_1, A_C, SIGMA_0)


def test_the_ground_neither_reaches_up_nor_pulls() -> None:
    assert normal_force(-1e-6, 1.0, 4000.0, 2e5) == 0.0
    assert normal_force(0.0, 1.0, 4000.0, 2e5) == 0.0
    # k d + lambda d dd/dt = 4000*1e-3 - 2e5*1e-3*0.03 < 0
    assert normal_force(1e-3, -0.03, 4000.0, 2e5) == 0.0


def test_normal_force_is_equation_1() -> None:
    # 4000*1e-3 + 2e5*1e-3*0.01 = 4 + 2
    assert normal_force(1e-3, 0.01, 4000.0, 2e5) == pytest.approx(6.0, rel=1e-14)


@pytest.mark.parametrize("speed_in_s", [0.03, 0.06, 0.12])
def test_a_dropped_mass_bounces_with_the_restitution_of_equation_2(
    scenario: Scenario, speed_in_s: float
) -> None:
    # Lafarge (the thesis's [18]): lambda = 3/2 alpha k gives e = 1 - alpha v for small alpha v;
    # the next term of the series is of order (alpha v)^2.
    ground = scenario.ground
    mass, speed = 5e-3, speed_in_s * 0.0254
    depth, rate, step = 0.0, speed, 1e-7
    while True:
        # Midpoint rule; gravity is left out, as in Eq. 2's derivation.
        mid_depth = depth + 0.5 * step * rate
        mid_rate = (
            rate - 0.5 * step * normal_force(depth, rate, ground.stiffness, ground.damping) / mass
        )
        force = normal_force(mid_depth, mid_rate, ground.stiffness, ground.damping)
        depth += step * mid_rate
        rate -= step * force / mass
        if depth <= 0.0 and rate < 0.0:
            break
    alpha_v = ground.velocity_correction * speed
    assert -rate / speed == pytest.approx(1.0 - alpha_v, abs=alpha_v**2)


@pytest.mark.parametrize("velocity", [-0.02, 0.02])
@pytest.mark.parametrize("mode", [-1.0, 1.0])
def test_slipping_friction_opposes_the_slip_and_grows_with_its_speed(
    velocity: float, mode: float
) -> None:
    # Slip: F = -s0 abs(v) x with x held at +-p0.
    force = friction_force(velocity, 12.3, mode, *FRICTION)
    assert force == pytest.approx(-mode * SIGMA_0 * abs(velocity) * P0, rel=1e-14)


@pytest.mark.parametrize("velocity", [-0.02, 0.02])
def test_sticking_friction_is_equation_5_with_the_absolute_speed(velocity: float) -> None:
    # Stick: F = -(s0 abs(v) (1 + a) x + s1 v); at x = 0.5 p0.
    x = 0.5 * P0
    expected = -(SIGMA_0 * 0.02 * 1.7 * x + SIGMA_1 * velocity)
    assert friction_force(velocity, x, STICK, *FRICTION) == pytest.approx(expected, rel=1e-14)


def test_friction_never_feeds_energy_in_once_the_node_slips_or_moves_outward() -> None:
    for velocity in (-0.05, 0.05):
        outward = math.copysign(0.9 * P0, velocity)
        slipping = math.copysign(1.0, velocity)
        assert friction_force(velocity, outward, STICK, *FRICTION) * velocity < 0.0
        assert friction_force(velocity, 0.0, slipping, *FRICTION) * velocity < 0.0


@pytest.mark.parametrize(
    ("velocity", "deflection", "mode", "after"),
    [
        (0.01, 0.99 * P0, STICK, STICK),
        (0.01, P0, STICK, 1.0),
        (-0.01, P0, STICK, STICK),  # beyond the range, but moving inward
        (-0.01, -P0, STICK, -1.0),
        (0.01, -P0, STICK, STICK),
        (0.01, 5.0, 1.0, 1.0),
        (0.0, 5.0, 1.0, STICK),
        (-0.01, 5.0, 1.0, STICK),
        (-0.01, -5.0, -1.0, -1.0),
        (0.01, -5.0, -1.0, STICK),
    ],
)
def test_breaks_free_outward_at_the_range_and_sticks_when_the_velocity_changes_sign(
    velocity: float, deflection: float, mode: float, after: float
) -> None:
    assert next_friction_mode(velocity, deflection, mode, P0) == after


@pytest.fixture
def structure(scenario: Scenario) -> Structure:
    return MakeStructure(scenario.robot, scenario.cables)


@pytest.fixture
def law(scenario: Scenario) -> np.ndarray:
    return ground_law(scenario.ground, scenario.friction)


def shifted(
    structure: Structure, *, x: float = 0.0, z: float = 0.0, v_x: float = 0.0
) -> np.ndarray:
    """The start with all bodies shifted by x and z (m) and moving along x (m/s)."""
    state = structure.initial_state
    bodies = len(structure.bodies)
    state[: 7 * bodies].reshape(bodies, 7)[:, 4] += x
    state[: 7 * bodies].reshape(bodies, 7)[:, 6] += z
    state[7 * bodies :].reshape(bodies, 6)[:, 3] = v_x
    return state


def moved(structure: Structure, **change: float) -> np.ndarray:
    """The `motion` of the nodes of `shifted`."""
    return node_motion(shifted(structure, **change), structure.p_BN)


def test_a_node_that_lands_sticks_where_it_lands(structure: Structure, law: np.ndarray) -> None:
    modes = np.zeros((len(structure.contacts), MODE_COLUMNS))
    update_modes(moved(structure, z=1e-3), structure.contacts, law, modes)
    assert not modes[:, CONTACT].any()
    landed = moved(structure, x=0.02, z=-1e-5, v_x=0.1)
    update_modes(landed, structure.contacts, law, modes)
    assert modes[:-1, CONTACT].all()
    assert modes[-1, CONTACT] == 0.0, "the tip of the lead tetrahedron is off the ground"
    assert (modes[:, MODE : MODE + 2] == STICK).all()
    assert modes[0, STICK_POINT] == pytest.approx(0.02, abs=1e-15)


def test_a_node_that_sticks_again_does_so_where_it_is(
    structure: Structure, law: np.ndarray
) -> None:
    modes = np.zeros((len(structure.contacts), MODE_COLUMNS))
    stations = [
        (0.0, 0.1, STICK, 0.0),  # lands
        (1e-3, 0.1, 1.0, 0.0),  # has gone ten stiction ranges: broken free
        (5e-3, 0.1, 1.0, 0.0),  # slips on
        (6e-3, -0.1, STICK, 6e-3),  # the reset: deflection 0 here
    ]
    for x, v_x, mode, stick_point in stations:
        motion = moved(structure, x=x, z=-1e-5, v_x=v_x)
        update_modes(motion, structure.contacts, law, modes)
        assert modes[0, MODE] == mode
        assert modes[0, STICK_POINT] == pytest.approx(stick_point, abs=1e-15)
        assert modes[0, MODE + 1] == STICK, "the sideways axis is on its own"


def test_a_node_in_the_air_has_no_friction_and_forgets_its_mode(
    structure: Structure, law: np.ndarray
) -> None:
    count = len(structure.contacts)
    modes = np.zeros((count, MODE_COLUMNS))
    modes[:, CONTACT], modes[:, MODE] = 1.0, 1.0
    flying = shifted(structure, z=1e-3, v_x=0.1)
    update_modes(node_motion(flying, structure.p_BN), structure.contacts, law, modes)
    assert not modes[:, : MODE + 2].any()
    force, normal, friction = np.empty(30), np.empty(count), np.empty((count, 2))
    ground_forces(flying, modes, structure.p_BN, structure.contacts, law, force, normal, friction)
    assert not force.any() and not normal.any() and not friction.any()


def test_the_margin_is_positive_between_mode_changes_and_crosses_zero_at_one(
    structure: Structure, law: np.ndarray
) -> None:
    args = (structure.contacts, law)
    p0 = law[0]["stiction_range"]
    modes = np.zeros((len(structure.contacts), MODE_COLUMNS))
    update_modes(moved(structure, z=-1e-4), *args, modes)

    def margin(**change: float) -> float:
        return mode_margin(moved(structure, **{"z": -1e-4, **change}), modes, *args)

    assert margin(x=0.9 * p0) > 0.0 > margin(x=1.1 * p0)
    assert margin(z=-1e-6) > 0.0 > margin(z=1e-6)


@pytest.mark.parametrize(
    ("value", "rate", "rate_rate", "expected"),
    [
        (1.0, -2.0, 0.0, 0.5),  # 1 - 2 t
        (1.0, 0.0, -2.0, 1.0),  # 1 - t^2
        (1.0, -3.0, 4.0, 0.5),  # 1 - 3 t + 2 t^2 = (1 - t)(1 - 2 t)
        (1.0, 1.0, 1.0, 9.0),  # never falls to zero
        (1.0, 3.0, 4.0, 9.0),  # both roots in the past
        (1.0, -1.0, 4.0, 9.0),  # turns before zero
        (0.0, -1.0, 0.0, 9.0),  # is there already: the mode changes now, not later
        (1.0, 0.0, 0.0, 9.0),
        (1.0, -0.01, 0.0, 9.0),  # beyond the horizon
    ],
)
def test_first_zero_of_a_quadratic(
    value: float, rate: float, rate_rate: float, expected: float
) -> None:
    assert first_zero(value, rate, rate_rate, 9.0) == pytest.approx(expected, rel=1e-14)


def test_a_mode_change_is_foreseen_when_it_comes(structure: Structure, law: np.ndarray) -> None:
    # All nodes in contact move at 0.05 m/s from their stick points: free at p0 / v. Without
    # acceleration and vertical motion nothing else is due.
    modes = np.zeros((len(structure.contacts), MODE_COLUMNS))
    update_modes(moved(structure, z=-1e-4), structure.contacts, law, modes)

    def time(state: np.ndarray, acceleration: np.ndarray) -> float:
        motion = node_motion(state, structure.p_BN)
        args = (structure.contacts, law, 1.0)
        return time_to_mode_change(state, acceleration, motion, modes, *args)

    moving = shifted(structure, z=-1e-4, v_x=0.05)
    expected = law[0]["stiction_range"] / 0.05
    assert time(moving, np.zeros(30)) == pytest.approx(expected, rel=1e-9)
    # An upward acceleration of 2 m/s^2 lifts nodes 1e-4 m deep after sqrt(2 * 1e-4 / 2) s.
    lifting = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 2.0], 5)
    resting = shifted(structure, z=-1e-4)
    assert time(resting, lifting) == pytest.approx(0.01, rel=1e-9)


@pytest.mark.parametrize("depth", [-1e-4, 1e-4, 5e-4])
@pytest.mark.parametrize("rate", [-0.03, 0.0, 0.02])
def test_normal_force_is_drakes_hunt_crossley_point_contact(
    scenario: Scenario, depth: float, rate: float
) -> None:
    # Drake: f = k d (1 + dissipation dd/dt), never negative; two equal stiffnesses 2 k act in
    # series as k, and their dissipation, weighted by stiffness, stays what both have.
    ground, radius, mass = scenario.ground, 0.02, 0.05
    properties = ProximityProperties()
    AddContactMaterial(
        dissipation=ground.damping / ground.stiffness,
        point_stiffness=2.0 * ground.stiffness,
        friction=CoulombFriction(0.0, 0.0),
        properties=properties,
    )
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, time_step=0.0)
    ball = plant.AddRigidBody("ball", SpatialInertia.SolidSphereWithMass(mass, radius))
    plant.RegisterCollisionGeometry(ball, RigidTransform(), Sphere(radius), "ball", properties)
    plant.RegisterCollisionGeometry(
        plant.world_body(), RigidTransform(), HalfSpace(), "floor", properties
    )
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, 0.0])
    plant.set_contact_model(ContactModel.kPoint)
    plant.Finalize()
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    state = np.array([1.0, 0, 0, 0, 0, 0, radius - depth, 0, 0, 0, 0, 0, -rate])
    plant.GetMyMutableContextFromRoot(context).SetContinuousState(state)
    force = mass * diagram.EvalTimeDerivatives(context).CopyToVector()[12]
    expected = normal_force(depth, rate, ground.stiffness, ground.damping)
    assert force == pytest.approx(expected, rel=1e-9, abs=1e-12)
