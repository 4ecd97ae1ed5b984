"""The systems of the diagram and their wiring; their laws are tested in tests/laws.

A lone tetrahedron settles and slides on the ground in tests/diagrams/test_one_tetrahedron.py.
"""

import math
from pathlib import Path

import numpy as np
import pytest
from helpers.controllers import OwnGround
from one_tetrahedron import make_diagram, make_standing_tetrahedron
from pydrake.systems.analysis import Simulator

from tetra_drake.laws.contact import CONTACT, MODE, MODE_COLUMNS
from tetra_drake.laws.friction import STICK
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.gait_file import load_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import node_positions
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.systems import Steering
from tetra_drake.systems.diagram import MakeTensegrityDiagram


@pytest.fixture
def gait(scenario: Scenario, data: Path) -> Gait:
    return load_gait(data / "gait_b.json", scenario)


def test_exports_what_a_user_plots(robot, gait):
    diagram = MakeTensegrityDiagram(robot, gait)
    context = diagram.CreateDefaultContext()
    ports = [diagram.get_output_port(i) for i in range(diagram.num_output_ports())]
    sizes = {"state": 65, "signals": 4, "tensions": 24, "lengths": 24}
    sizes |= {"normal_forces": 11, "friction_forces": 22, "contact_forces": 33, "modes": 33}
    assert {port.get_name(): len(port.Eval(context)) for port in ports} == sizes


@pytest.mark.parametrize(("height", "touches"), [(-1e-5, True), (1e-5, False)])
def test_initialize_takes_contact_and_stick_points_from_the_pose(scenario, height, touches):
    structure = make_standing_tetrahedron(scenario).structure
    simulator, state = Simulator(make_diagram(scenario)), structure.initial_state
    state[6] += height
    simulator.get_mutable_context().SetContinuousState(state)
    simulator.Initialize()
    ground = simulator.get_system().GetSubsystemByName("ground")
    context = ground.GetMyContextFromRoot(simulator.get_context())
    modes = context.get_discrete_state_vector().value().reshape(3, MODE_COLUMNS)
    assert (modes[:, CONTACT] == touches).all()
    assert (modes[:, MODE : MODE + 2] == STICK).all()
    if touches:
        p_WN = node_positions(structure, state)
        np.testing.assert_allclose(modes[:, 3:5], p_WN[:3, :2], atol=1e-15)


def doubled(turn: np.ndarray) -> np.ndarray:
    return np.array([2.0 * turn, 0.0])


@pytest.mark.parametrize("turn", [5.0, -1.1, math.nan])
def test_a_turn_beyond_its_limits_is_refused_on_the_port_as_by_a_function(turn, refused):
    for given, port in ((0.0, turn), (lambda time: turn, None)):
        steering = Steering(doubled, turn=given)
        context = steering.CreateDefaultContext()
        context.SetTime(3.0)
        if port is not None:
            steering.GetInputPort("turn").FixValue(context, [port])
        with refused("steering", "at 3 s", str(turn)):
            steering.get_output_port().Eval(context)


def test_a_ground_of_ones_own_acts_in_place_of_ours(robot, gait):
    ground = OwnGround(5)
    diagram = MakeTensegrityDiagram(robot, gait, ground=ground)
    assert diagram.GetSubsystemByName("ground") is ground
    names = {diagram.get_output_port(i).get_name() for i in range(diagram.num_output_ports())}
    assert "normal_forces" in names and not {"modes", "contact_forces"} & names
    plant, context = diagram.GetSubsystemByName("plant"), diagram.CreateDefaultContext()

    def forces_at(height: float) -> np.ndarray:
        """Mass times acceleration of the bodies when they are all at a height (m)."""
        state = robot.structure.initial_state
        state[6:35:7] = height
        plant.SetPositionsAndVelocities(plant.GetMyMutableContextFromRoot(context), state)
        rates = diagram.EvalTimeDerivatives(context).get_generalized_velocity().CopyToVector()
        return rates.reshape(5, 6) * robot.structure.mass[:, np.newaxis]

    pushed = forces_at(-0.01) - forces_at(1.0)
    np.testing.assert_allclose(pushed, [[0.0, 0.0, 0.0, 0.0, 0.0, 1.0]] * 5, atol=1e-9)


@pytest.mark.parametrize("terrain", ["!Flat", "!Incline {slope: 20 deg}"])
def test_contact_forces_are_the_forces_on_the_bodies_in_the_world(scenario, gait, terrain):
    robot = Robot.of(scenario.with_changes({"terrain": terrain, "robot.contacts": "all"}))
    diagram = MakeTensegrityDiagram(robot, gait)
    simulator = Simulator(diagram)
    simulator.AdvanceTo(0.05)
    ground = diagram.GetSubsystemByName("ground")
    context = ground.GetMyContextFromRoot(simulator.get_context())
    forces = ground.GetOutputPort("contact_forces").Eval(context).reshape(-1, 3)
    on_bodies = ground.GetOutputPort("generalized_force").Eval(context).reshape(5, 6)[:, 3:]
    assert np.abs(forces).max() > 0.0
    np.testing.assert_allclose(forces.sum(axis=0), on_bodies.sum(axis=0), rtol=1e-12)
    upright = terrain == "!Flat"
    normal = ground.GetOutputPort("normal_forces").Eval(context)
    assert np.allclose(forces[:, 2], normal, rtol=1e-12) == upright
