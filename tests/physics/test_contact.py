"""The normal force, and what a contact node remembers."""

import numpy as np
import pytest
from helpers.robot_on_ground import RobotOnGround
from pydrake.geometry import AddContactMaterial, HalfSpace, ProximityProperties, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, ContactModel, CoulombFriction
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.framework import DiagramBuilder

from tetra_drake.physics.contact import CONTACT, MODE, STICK_POINT, NormalForce, normal_force
from tetra_drake.physics.friction import STICK
from tetra_drake.physics.kinematics import FORCE
from tetra_drake.robot.ground import make_ground
from tetra_drake.scenario.scenario import Scenario

NORMAL = NormalForce(stiffness=4000.0, damping=2e5)


def test_normal_force_is_equation_1():
    # k d + lambda d dd/dt = 4000*1e-3 + 2e5*1e-3*0.01 = 4 + 2; 4 - 6 < 0: it does not pull.
    assert normal_force(1e-3, 0.01, NORMAL) == pytest.approx(6.0, rel=1e-14)
    assert normal_force(1e-3, -0.03, NORMAL) == 0.0


@pytest.fixture
def robot_on_ground(scenario: Scenario) -> RobotOnGround:
    return RobotOnGround(scenario, np.eye(3))


def test_a_node_that_sticks_again_does_so_where_it_is_and_changes_are_told(robot_on_ground):
    modes, lifted = robot_on_ground.modes, (0.0, 0.0, 1e-3)
    assert not robot_on_ground.update(p=lifted), "in the air"
    for x, v_x, mode, stick_point, changed in [
        (0.0, 0.1, STICK, 0.0, True),  # lands
        (0.0, 0.1, STICK, 0.0, False),
        (1e-3, 0.1, 1.0, 0.0, True),  # has gone ten stiction ranges: broken free
        (5e-3, 0.1, 1.0, 0.0, False),  # slips on
        (6e-3, -0.1, STICK, 6e-3, True),  # the reset: deflection 0 here
    ]:
        assert robot_on_ground.update(v=(v_x, 0.0, 0.0), p=(x, 0.0, -1e-5)) == changed
        assert modes[0, MODE] == mode
        assert modes[0, STICK_POINT] == pytest.approx(stick_point, abs=1e-15)
        assert modes[0, MODE + 1] == STICK, "the sideways axis is on its own"
    assert robot_on_ground.update(p=lifted), "leaves the ground"


def test_a_node_in_the_air_has_no_friction_and_forgets_its_mode(robot_on_ground):
    robot_on_ground.modes[:, CONTACT] = robot_on_ground.modes[:, MODE] = 1.0
    v, lifted = (0.1, 0.0, 0.0), (0.0, 0.0, 1e-3)
    robot_on_ground.update(v, lifted)
    assert not robot_on_ground.modes[:, : MODE + 2].any()
    nodes, ground_forces = robot_on_ground.forces(v, lifted)
    assert not ground_forces.any()
    assert not nodes[:, FORCE:].any()


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
