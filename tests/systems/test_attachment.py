"""Cables, ground and actuators on bodies of plants with joints, against Drake and closed forms."""

from __future__ import annotations

import dataclasses
import math
import warnings

import numpy as np
import pytest
from helpers.rod import GRAVITY, LAW, LEFT, LENGTH, MASS, RIGHT, rod_with_tendons
from pydrake.autodiffutils import ExtractValue
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import Diagram, DiagramBuilder

from tetra_drake.errors import SimulationFailure
from tetra_drake.laws.actuator import Force, Winch
from tetra_drake.laws.cable import MEETING
from tetra_drake.laws.contact import GroundSection
from tetra_drake.laws.friction import Coulomb
from tetra_drake.laws.terrain import Flat
from tetra_drake.robot.ground import make_surface
from tetra_drake.systems import AddCables, AddGroundContact, Cable


def simulated(diagram: Diagram, time: float) -> Simulator:
    simulator = Simulator(diagram)
    ResetIntegratorFromFlags(simulator, "runge_kutta3", 0.05).set_target_accuracy(1e-6)
    simulator.AdvanceTo(time)
    return simulator


def test_an_arm_comes_to_rest_where_two_tendons_balance_its_weight():
    # Tendons without free length: the energy is -u . (k L (a + b) - m g L / 2 z), up to a
    # constant, for the direction u of the rod and the anchors a and b.
    builder, plant, _, cables = rod_with_tendons()
    AddCables(builder, plant, cables=cables)
    context = plant.GetMyContextFromRoot(simulated(builder.Build(), 4.0).get_context())
    angle, rate = plant.GetPositionsAndVelocities(context)
    pull = LAW.stiffness * (LEFT + RIGHT) - 0.5 * MASS * GRAVITY * np.array([0.0, 0.0, 1.0])
    assert angle == pytest.approx(math.atan2(pull[2], pull[0]), abs=1e-6)
    assert rate == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("actuation", [Force(), Winch(max_force=50.0, max_speed=1.0)])
def test_a_force_on_a_slack_cable_is_told_once(actuation):
    builder, plant, _, (left, right) = rod_with_tendons()
    loose = dataclasses.replace(left, law=LAW._replace(free_length=2.0))
    cables, driven = [loose, right], {"motor": [loose.name]}
    system = AddCables(builder, plant, cables=cables, actuated=driven, actuation=actuation)
    context = builder.Build().CreateDefaultContext()
    own, tensions = system.GetMyMutableContextFromRoot(context), []
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        for force in (-3.0, 0.0, 3.0, 3.0):
            system.GetInputPort("signals").FixValue(own, [force])
            tensions.append(system.GetOutputPort("tensions").Eval(own)[0])
    pulls = actuation == Force()
    assert tensions == [0.0, 0.0, 3.0 * pulls, 3.0 * pulls], "it never pushes"
    assert [each.category for each in told] == [RuntimeWarning] * pulls
    problem = f"'{loose.name}' is slack, and its signal pulls with 3 N"
    assert all(problem in str(each.message) for each in told)


def test_a_hinged_rod_sinks_into_the_ground_by_half_its_weight_over_the_stiffness():
    builder, plant, tip, _ = rod_with_tendons()
    law = GroundSection(stiffness=2e3, damping=2e4)
    ground = make_surface(law, Coulomb(), Flat())
    contact = AddGroundContact(builder, plant, frames=[tip], ground=ground, radius=0.01)
    builder.ExportOutput(contact.GetOutputPort("normal_forces"), "normal_forces")
    diagram = builder.Build()
    simulator = simulated(diagram, 3.0)
    (load,) = diagram.GetOutputPort("normal_forces").Eval(simulator.get_context())
    assert load == pytest.approx(0.5 * MASS * GRAVITY, rel=1e-5)
    context = plant.GetMyContextFromRoot(simulator.get_context())
    depth = 0.01 - tip.CalcPoseInWorld(context).translation()[2]
    assert depth == pytest.approx(0.5 * MASS * GRAVITY / law.stiffness, rel=1e-5)


def test_the_force_of_a_cable_fades_where_its_ends_meet_and_one_without_end_is_named():
    builder, plant, tip, _ = rod_with_tendons()
    network = AddCables(builder, plant, cables=[Cable("loop", plant.world_frame(), tip, LAW)])
    context = network.CreateDefaultContext()
    for distance in (0.0, 0.3 * MEETING, MEETING, 1e200):
        place = [1.0, 0.0, 0.0, 0.0, distance - LENGTH, *np.zeros(8)]
        network.GetInputPort("state").FixValue(context, place)
        if distance == 1e200:
            with pytest.raises(SimulationFailure, match="'loop'"):
                network.GetOutputPort("tensions").Eval(context)
            continue
        length = (distance**2 + MEETING**2) / (2.0 * MEETING)
        assert network.GetOutputPort("tensions").Eval(context) == pytest.approx(60.0 * length)
        force = network.GetOutputPort("cable_forces").Eval(context)[:3] * 60.0 * length
        np.testing.assert_allclose(force, [60.0 * length * distance / MEETING, 0.0, 0.0])


def test_shown_pieces_cover_a_cable_of_any_length_from_end_to_end():
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, time_step=0.0)
    ball = plant.AddRigidBody("ball", SpatialInertia.SolidSphereWithMass(1.0, 0.1))
    plant.Finalize()
    plant.SetDefaultFloatingBaseBodyPose(ball, RigidTransform([0.0, 0.0, 1.0]))
    cable = Cable("cable", plant.world_frame(), ball.body_frame(), LAW)
    AddCables(builder, plant, cables=[cable], scene_graph=scene_graph)
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    for height in (0.5, 1.0, 1.5):
        place = RigidTransform([0.0, 0.0, height])
        plant.SetFreeBodyPose(plant.GetMyMutableContextFromRoot(root), ball, place)
        query = scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(root))
        inspector = query.inspector()
        pieces = inspector.GetAllGeometryIds()
        middles = np.sort([query.GetPoseInWorld(piece).translation()[2] for piece in pieces])
        (length,) = {inspector.GetShape(piece).length() for piece in pieces}
        assert middles[0] - length / 2 == pytest.approx(0.0)
        assert middles[-1] + length / 2 == pytest.approx(height)
        assert np.diff(middles).max() <= length + 1e-12, "no gap"
    twin, rates = diagram.ToAutoDiffXd(), diagram.EvalTimeDerivatives(root).CopyToVector()
    given = twin.CreateDefaultContext()
    given.SetTimeStateAndParametersFrom(root)
    found = ExtractValue(twin.EvalTimeDerivatives(given).CopyToVector()).ravel()
    np.testing.assert_allclose(found, rates, rtol=1e-9, atol=1e-9)
