"""Normal force, friction and stiction of single nodes, against their equations."""

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
    NormalForce,
    add_ground_forces,
    normal_force,
    update_modes,
)
from tetra_drake.physics.friction import (
    STICK,
    ResetConstants,
    TangentSlide,
    first_zero,
    next_tangent_mode,
    tangent_force,
)
from tetra_drake.physics.kinematics import FORCE, NODE_COLUMNS
from tetra_drake.physics.mode_change import mode_margin, time_to_mode_change
from tetra_drake.physics.terrain import FRAME_COLUMNS
from tetra_drake.robot.ground import make_ground
from tetra_drake.robot.structure import Structure, moved_nodes
from tetra_drake.scenario.schema import Scenario

P0, SIGMA_1, A_C, SIGMA_0 = 1e-4, 70.0, 0.7, 2000.0
LAW = ResetConstants(P0, SIGMA_1, A_C, SIGMA_0)
NORMAL = NormalForce(stiffness=4000.0, damping=2e5)


def test_normal_force_is_equation_1():
    # k d + lambda d dd/dt = 4000*1e-3 + 2e5*1e-3*0.01 = 4 + 2; 4 - 6 < 0: it does not pull.
    assert normal_force(1e-3, 0.01, NORMAL) == pytest.approx(6.0, rel=1e-14)
    assert normal_force(1e-3, -0.03, NORMAL) == 0.0


@pytest.mark.parametrize("velocity", [-0.02, 0.02])
@pytest.mark.parametrize("mode", [-1.0, 1.0])
def test_slipping_friction_is_s0_times_the_speed_at_the_range(velocity, mode):
    # F = -s0 abs(v) x with x held at +-p0: it opposes a slip in the direction of `mode`.
    force = tangent_force(TangentSlide(velocity, 12.3, mode), LAW)
    assert force == pytest.approx(-mode * SIGMA_0 * 0.02 * P0, rel=1e-14)


@pytest.mark.parametrize("velocity", [-0.02, 0.02])
@pytest.mark.parametrize("x", [0.5 * P0, -0.9 * P0])
def test_sticking_friction_is_equation_5_with_the_absolute_speed(velocity, x):
    expected = -(SIGMA_0 * 0.02 * (1.0 + A_C) * x + SIGMA_1 * velocity)
    force = tangent_force(TangentSlide(velocity, x, STICK), LAW)
    assert force == pytest.approx(expected, rel=1e-14)


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
def test_breaks_free_at_the_range_and_sticks_at_a_reversal(velocity, deflection, mode, after):
    assert next_tangent_mode(TangentSlide(velocity, deflection, mode), LAW) == after


class RobotOnGround:
    """The robot over the ground, and the modes of its contact nodes, at first in the air."""

    def __init__(self, structure: Structure, scenario: Scenario) -> None:
        self.structure = structure
        self.ground = make_ground(scenario, structure)
        self.frames = np.full((len(structure.contacts), FRAME_COLUMNS), np.nan)  # not used
        self.args = (self.ground, self.frames)
        self.modes = np.zeros((len(structure.contacts), MODE_COLUMNS))

    def state(self, *, x: float = 0.0, z: float = 0.0, v_x: float = 0.0) -> np.ndarray:
        """The start with all bodies shifted by x and z (m) and moving along x (m/s)."""
        state = self.structure.initial_state
        state[4:35:7] += x
        state[6:35:7] += z
        state[38::6] = v_x
        return state

    def nodes(self, **change: float) -> np.ndarray:
        """The nodes in that state."""
        return moved_nodes(self.structure, self.state(**change))

    def update(self, **change: float) -> bool:
        """Brings the modes up to date with that state; whether they changed."""
        return update_modes(self.state(**change), self.nodes(**change), *self.args, self.modes)

    def margin(self, state: np.ndarray) -> float:
        """Until the next mode change."""
        nodes, p_BN = np.empty((20, NODE_COLUMNS)), self.structure.p_BN
        return mode_margin(state, self.modes, p_BN, self.ground, nodes, self.frames)


@pytest.fixture
def ground(structure: Structure, scenario: Scenario) -> RobotOnGround:
    return RobotOnGround(structure, scenario)


def test_a_node_that_lands_sticks_where_it_lands(ground):
    ground.update(z=1e-3)
    modes = ground.modes
    assert not modes[:, CONTACT].any()
    ground.update(x=0.02, z=-1e-5, v_x=0.1)
    assert modes[:-1, CONTACT].all()
    assert modes[-1, CONTACT] == 0.0, "the tip of the lead tetrahedron is off the ground"
    assert (modes[:, MODE : MODE + 2] == STICK).all()
    assert modes[0, STICK_POINT] == pytest.approx(0.02, abs=1e-15)


def test_a_node_that_sticks_again_does_so_where_it_is_and_changes_are_told(ground):
    assert not ground.update(z=1e-3), "in the air"
    for x, v_x, mode, stick_point, changed in [
        (0.0, 0.1, STICK, 0.0, True),  # lands
        (0.0, 0.1, STICK, 0.0, False),
        (1e-3, 0.1, 1.0, 0.0, True),  # has gone ten stiction ranges: broken free
        (5e-3, 0.1, 1.0, 0.0, False),  # slips on
        (6e-3, -0.1, STICK, 6e-3, True),  # the reset: deflection 0 here
    ]:
        assert ground.update(x=x, z=-1e-5, v_x=v_x) == changed
        assert ground.modes[0, MODE] == mode
        assert ground.modes[0, STICK_POINT] == pytest.approx(stick_point, abs=1e-15)
        assert ground.modes[0, MODE + 1] == STICK, "the sideways axis is on its own"
    assert ground.update(z=1e-3), "leaves the ground"


def test_a_node_in_the_air_has_no_friction_and_forgets_its_mode(ground):
    ground.modes[:, CONTACT] = ground.modes[:, MODE] = 1.0
    ground.update(z=1e-3, v_x=0.1)
    modes = ground.modes
    assert not modes[:, : MODE + 2].any()
    nodes, pushes = ground.nodes(z=1e-3, v_x=0.1), np.full((len(modes), 3), np.nan)
    add_ground_forces(nodes, modes, *ground.args, True, pushes)
    assert not pushes.any()
    assert not nodes[:, FORCE:].any()


def test_the_margin_crosses_zero_at_a_mode_change(ground):
    p0 = ResetConstants(*ground.ground.friction.constants).stiction_range
    ground.update(z=-1e-4)

    def margin(x: float = 0.0, z: float = -1e-4) -> float:
        return ground.margin(ground.state(x=x, z=z))

    assert margin(x=0.9 * p0) > 0.0 > margin(x=1.1 * p0)
    assert margin(z=-1e-6) > 0.0 > margin(z=1e-6)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("mode", [-1.0, 1.0])
def test_the_margin_of_a_slipping_node_is_its_speed_that_way(ground, axis, mode):
    ground.update(z=-1e-4)
    ground.modes[2, MODE + axis] = mode  # of T2's bottom left
    for speed in (3e-6, -3e-6):  # the least of all margins; the others are 1e-4 m
        state = ground.state(z=-1e-4)
        state[35 + 6 + 3 + axis] = mode * speed
        assert ground.margin(state) == pytest.approx(speed, rel=1e-12)


@pytest.mark.parametrize(
    ("value", "rate", "rate_rate", "expected"),
    [
        (1.0, -2.0, 0.0, 0.5),  # 1 - 2 t
        (1.0, 0.0, -2.0, 1.0),  # 1 - t^2
        (1.0, 0.0, -50.0, 0.2),  # 1 - 25 t^2
        (1.0, -3.0, 4.0, 0.5),  # 1 - 3 t + 2 t^2 = (1 - t)(1 - 2 t)
        (1.0, 1.0, 1.0, 9.0),  # never falls to zero
        (1.0, 3.0, 4.0, 9.0),  # both roots in the past
        (1.0, -1.0, 4.0, 9.0),  # turns before zero
        (0.0, -1.0, 0.0, 9.0),  # is there already: the mode changes now, not later
        (1.0, 0.0, 0.0, 9.0),
        (1.0, -0.01, 0.0, 9.0),  # beyond the horizon
    ],
)
def test_first_zero_of_a_quadratic(value, rate, rate_rate, expected):
    assert first_zero(value, rate, rate_rate, 9.0) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize(
    ("v_x", "upward", "expected"),
    [
        (0.05, 0.0, 0.004 * 0.0254 / 0.05),  # free at p0 / v
        (0.0, 2.0, 0.01),  # 2 m/s^2 lift nodes 1e-4 m deep after sqrt(2 * 1e-4 / 2) s
    ],
)
def test_a_mode_change_is_foreseen_when_it_comes(ground, v_x, upward, expected):
    ground.update(z=-1e-4)
    modes = ground.modes
    state, nodes = ground.state(z=-1e-4, v_x=v_x), ground.nodes(z=-1e-4, v_x=v_x)
    acceleration = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, upward], 5)
    time = time_to_mode_change(state, acceleration, nodes, modes, *ground.args, 1.0)
    assert time == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("depth", [-1e-4, 0.0, 1e-4, 5e-4])
@pytest.mark.parametrize("rate", [-0.03, 0.0, 0.02])
def test_normal_force_is_drakes_hunt_crossley_point_contact(scenario, structure, depth, rate):
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
    for body, shape in ((ball, Sphere(radius)), (plant.world_body(), HalfSpace())):
        plant.RegisterCollisionGeometry(body, RigidTransform(), shape, body.name(), properties)
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, 0.0])
    plant.set_contact_model(ContactModel.kPoint)
    plant.Finalize()
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    state = np.array([1.0, 0, 0, 0, 0, 0, radius - depth, 0, 0, 0, 0, 0, -rate])
    plant.GetMyMutableContextFromRoot(context).SetContinuousState(state)
    force = mass * diagram.EvalTimeDerivatives(context).CopyToVector()[12]
    law = NormalForce(*make_ground(scenario, structure).normal)
    expected = normal_force(depth, rate, law)
    assert force == pytest.approx(expected, rel=1e-9, abs=1e-12)
