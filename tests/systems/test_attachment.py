"""Cables, ground and actuators on bodies of plants with joints, against Drake and closed forms."""

from __future__ import annotations

import dataclasses
import math
import warnings
from collections.abc import Callable

import numpy as np
import pytest
from helpers.springs import with_springs
from pydrake.geometry import Meshcat, SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import Frame, RevoluteJoint, SpatialInertia
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource
from pydrake.visualization import VisualizationConfig
from scipy.integrate import solve_ivp

from tetra_drake.errors import SimulationFailure
from tetra_drake.laws.actuator import Force, Winch
from tetra_drake.laws.cable import CableLaw
from tetra_drake.laws.contact import GroundSection, NormalForce
from tetra_drake.laws.friction import Coulomb
from tetra_drake.laws.terrain import Flat
from tetra_drake.robot.ground import make_surface
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import load_scenario
from tetra_drake.systems import AddCables, AddFrame, AddGroundContact, Cable
from tetra_drake.systems.diagram import MakeTensegrityDiagram

MASS, LENGTH, GRAVITY = 0.5, 0.4, 9.81  # of a uniform rod on a hinge at the origin
LAW = CableLaw(stiffness=60.0, damping=8.0, free_length=0.0)
WINCH = Winch(max_force=1e6, max_speed=1e3, time_constant=0.05)
LEFT, RIGHT = np.array([-0.2, 0.0, 0.5]), np.array([0.6, 0.0, 0.3])  # anchors of two tendons


Arm = tuple[DiagramBuilder, MultibodyPlant, Frame, list[Cable]]


def rod_with_tendons(**constants: object) -> Arm:
    """A rod along x that turns about y, its free end, and two tendons to it from the world, by a
    law with other constants."""
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", MultibodyPlant(time_step=0.0))
    inertia = SpatialInertia.ThinRodWithMassAboutEnd(MASS, LENGTH, [1.0, 0.0, 0.0])
    rod = plant.AddRigidBody("rod", inertia)
    hinge = RevoluteJoint("hinge", plant.world_frame(), rod.body_frame(), [0.0, -1.0, 0.0])
    plant.AddJoint(hinge)
    tip = AddFrame(plant, "tip", rod.body_frame(), [LENGTH, 0.0, 0.0])
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -GRAVITY])
    places, law = {"left": LEFT, "right": RIGHT}, LAW._replace(**constants)
    anchors = [AddFrame(plant, name, plant.world_frame(), place) for name, place in places.items()]
    cables = [Cable(anchor.name(), anchor, tip, law) for anchor in anchors]
    plant.Finalize()
    return builder, plant, tip, cables


def simulated(diagram: Diagram, time: float, *, accuracy: float = 1e-6) -> Simulator:
    simulator = Simulator(diagram)
    ResetIntegratorFromFlags(simulator, "runge_kutta3", 0.05).set_target_accuracy(accuracy)
    simulator.AdvanceTo(time)
    return simulator


def state_at(diagram: Diagram, time: float, *, accuracy: float = 1e-6) -> np.ndarray:
    plant = diagram.GetSubsystemByName("plant")
    root = simulated(diagram, time, accuracy=accuracy).get_context()
    return plant.GetPositionsAndVelocities(plant.GetMyContextFromRoot(root))


def test_an_arm_comes_to_rest_where_two_tendons_balance_its_weight():
    # Tendons without free length: the energy is -u . (k L (a + b) - m g L / 2 z), up to a
    # constant, for the direction u of the rod and the anchors a and b.
    builder, plant, _, cables = rod_with_tendons()
    AddCables(builder, plant, cables=cables)
    angle, rate = state_at(builder.Build(), 4.0)
    pull = LAW.stiffness * (LEFT + RIGHT) - 0.5 * MASS * GRAVITY * np.array([0.0, 0.0, 1.0])
    assert angle == pytest.approx(math.atan2(pull[2], pull[0]), abs=1e-6)
    assert rate == pytest.approx(0.0, abs=1e-6)


def test_an_arm_swings_on_a_cable_over_a_ring_at_its_tip_as_its_energy_says():
    builder, plant, tip, (left, right) = rod_with_tendons()
    law = LAW._replace(damping=0.0)
    AddCables(builder, plant, cables=[Cable("rope", left.frame_a, right.frame_a, law, (tip,))])

    def energy(angle: float) -> float:
        place = LENGTH * np.array([math.cos(angle), 0.0, math.sin(angle)])
        length = np.linalg.norm(place - LEFT) + np.linalg.norm(place - RIGHT)
        return float(0.5 * law.stiffness * length**2 + 0.5 * MASS * GRAVITY * place[2])

    def rate(_: float, y: np.ndarray) -> list[float]:
        torque = (energy(y[0] - 1e-5) - energy(y[0] + 1e-5)) / 2e-5
        return [y[1], torque / (MASS * LENGTH**2 / 3.0)]

    expected = solve_ivp(rate, (0.0, 0.5), [0.0, 0.0], rtol=1e-9, atol=1e-11).y[:, -1]
    assert np.abs(expected).min() > 0.1
    found = state_at(builder.Build(), 0.5, accuracy=1e-5)
    np.testing.assert_allclose(found, expected, rtol=1e-4)


@pytest.mark.parametrize("actuation", [Force(), Winch(max_force=50.0, max_speed=1.0)])
def test_a_force_on_a_slack_cable_is_told_once(actuation):
    builder, plant, _, (left, right) = rod_with_tendons()
    loose = dataclasses.replace(left, law=LAW._replace(free_length=2.0))
    cables, driven = [loose, right], {"motor": [loose.name]}
    system = AddCables(builder, plant, cables=cables, actuated=driven, actuation=actuation)
    context = builder.Build().CreateDefaultContext()
    own = system.GetMyMutableContextFromRoot(context)
    signal = system.GetInputPort("signals")
    signal.FixValue(own, [0.0])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        system.GetOutputPort("tensions").Eval(own)
    signal.FixValue(own, [3.0])
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        for _ in range(2):
            signal.FixValue(own, [3.0])
            tension = system.GetOutputPort("tensions").Eval(own)[0]
    if isinstance(actuation, Winch):
        assert (tension, told) == (0.0, [])
        return
    assert tension == 3.0
    (only,) = told
    assert f"'{loose.name}' is slack, and its signal pulls it with 3 N" in str(only.message)
    assert only.category is RuntimeWarning


def test_tendons_of_an_arm_of_drakes_are_its_linear_spring_dampers():
    def moved(attach: Callable[..., None], state: list[float]) -> np.ndarray:
        builder = DiagramBuilder()
        plant = builder.AddNamedSystem("plant", MultibodyPlant(time_step=0.0))
        Parser(plant).AddModelsFromUrl("package://drake/examples/acrobot/Acrobot.urdf")
        ends = [
            (plant.world_frame(), [0.3, 0.1, 0.0]),
            (plant.GetFrameByName("upper_link"), [0.0, 0.02, -0.7]),
            (plant.GetFrameByName("lower_link"), [0.0, 0.0, -1.0]),
        ]
        frames = [AddFrame(plant, f"end {i}", *end) for i, end in enumerate(ends)]
        law = CableLaw(stiffness=40.0, damping=1.5, free_length=0.1)
        pairs = {"upper": frames[:2], "lower": frames[1:], "both": [frames[0], frames[2]]}
        attach(builder, plant, [Cable(name, a, b, law) for name, (a, b) in pairs.items()])
        diagram = builder.Build()
        plant.SetDefaultPositions(state)
        return state_at(diagram, 0.5)

    def with_cables(builder: DiagramBuilder, plant: MultibodyPlant, cables: list[Cable]) -> None:
        plant.Finalize()
        AddCables(builder, plant, cables=cables, slack=False)

    expected = moved(with_springs, [0.7, -1.1])
    assert np.abs(expected[2:]).min() > 0.1  # it swings
    np.testing.assert_allclose(moved(with_cables, [0.7, -1.1]), expected, atol=1e-6)


def test_a_hinged_rod_sinks_into_the_ground_by_half_its_weight_over_the_stiffness():
    builder, plant, tip, _ = rod_with_tendons()
    law = GroundSection(stiffness=2e3, damping=2e4)
    ground = make_surface(law, Coulomb(), Flat())
    contact = AddGroundContact(builder, plant, frames=[tip], ground=ground)
    builder.ExportOutput(contact.GetOutputPort("normal_forces"), "normal_forces")
    diagram = builder.Build()
    simulator = simulated(diagram, 3.0)
    (load,) = diagram.GetOutputPort("normal_forces").Eval(simulator.get_context())
    assert load == pytest.approx(0.5 * MASS * GRAVITY, rel=1e-5)
    context = plant.GetMyContextFromRoot(simulator.get_context())
    depth = -tip.CalcPoseInWorld(context).translation()[2]
    assert depth == pytest.approx(0.5 * MASS * GRAVITY / law.stiffness, rel=1e-5)


def test_a_winch_without_limits_pulls_an_arm_as_a_force_does():
    def angle(actuation: Winch | None) -> float:
        builder, plant, _, cables = rod_with_tendons(free_length=0.15)
        actuated = {"pull": ["right"]}
        network = AddCables(builder, plant, cables=cables, actuated=actuated, actuation=actuation)
        signal = builder.AddSystem(ConstantVectorSource([6.0]))
        builder.Connect(signal.get_output_port(), network.GetInputPort("signals"))
        return float(state_at(builder.Build(), 4.0)[0])

    assert angle(WINCH) == pytest.approx(angle(None), abs=1e-6)


BAD = [({"actuated": {"pull": ["rigth"]}}, "actuated.pull", "'right'")]
BAD += [({"actuated": {"a": ["left"], "b": ["left"]}}, "actuated.b", "'left'")]
BAD += [({"actuation": 3}, "actuation", "3"), ({"drives": [0.1]}, "drives", "0.1")]
BAD += [({"actuated": {"a": ["left"]}, "actuation": WINCH, "drives": [1, 2]}, "drives", "1")]
BAD += [({"scene_graph": SceneGraph()}, "scene_graph", "builder")]
BAD += [({"name": "plant"}, "name", "plant"), ({"plant": MultibodyPlant(0.0)}, "plant", "builder")]


@pytest.mark.parametrize(("given", "key", "fact"), BAD)
def test_arguments_that_do_not_fit_are_refused(given, key, fact, refused):
    builder, plant, _, cables = rod_with_tendons()
    with refused("AddCables", key, fact):
        AddCables(builder, **{"plant": plant, "cables": cables} | given)


def test_cables_between_wrong_places_are_refused_by_name(refused):
    builder, plant, tip, (left, _) = rod_with_tendons()
    _, other, far, _ = rod_with_tendons()
    elsewhere = Cable("a", tip, other.world_frame(), LAW)
    cases = [
        ("cables.left", "twice", [left, left]),
        ("cables.a", "length of 0 m", [Cable("a", tip, tip, LAW)]),
        ("cables.a.frame_a", "'tip' of another plant", [Cable("a", far, tip, LAW)]),
        ("cables.a.frame_b", "'world' of another plant", [elsewhere]),
    ]
    for constant in ({"stiffness": -1.0}, {"free_length": math.nan}, {"damping": "8 N"}):
        wrong = Cable("a", left.frame_a, tip, LAW._replace(**constant))
        cases += [(f"cables.a.{name}", f"{value}", [wrong]) for name, value in constant.items()]
    for key, fact, cables in cases:
        with refused("AddCables", key, fact):
            AddCables(builder, plant, cables=cables)


def test_a_plant_that_cannot_move_is_refused(refused):
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(0.0))
    plant.AddRigidBody("ghost", SpatialInertia.Zero())
    with refused("AddCables", "plant", "finalized"):
        AddCables(builder, plant, cables=[])
    plant.Finalize()
    with refused("AddCables", "plant", "ghost"):
        AddCables(builder, plant, cables=[])


def test_a_cable_whose_ends_meet_is_named():
    builder, plant, tip, _ = rod_with_tendons()
    network = AddCables(builder, plant, cables=[Cable("loop", plant.world_frame(), tip, LAW)])
    context = network.CreateDefaultContext()
    place = [1.0, 0.0, 0.0, 0.0, -LENGTH, *np.zeros(8)]  # the rod's end at the origin
    network.GetInputPort("state").FixValue(context, place)
    with pytest.raises(SimulationFailure, match="'loop'"):
        network.GetOutputPort("tensions").Eval(context)


def test_ground_that_cannot_be_is_refused(refused):
    builder, plant, tip, cables = rod_with_tendons()
    ground = make_surface(GroundSection(stiffness=1e3, damping=0.0), Coulomb(), Flat())
    wrong = ground._replace(normal=np.array(NormalForce(1e3, math.nan)))
    frames = {"frames[0]": [cables[0].frame_a], "frames[1]": [tip, tip]}
    cases = [(key, {"frames": given}) for key, given in frames.items()]
    cases += [("frames[0]", {"frames": [rod_with_tendons()[2]]})]
    cases += [("ground", {"ground": 3}), ("ground.damping", {"ground": wrong})]
    cases += [("radius", {"radius": radius}) for radius in (-0.1, [0.1, 0.1], math.inf, "1 m")]
    for key, given in cases:
        with refused("AddGroundContact", key, ""):
            AddGroundContact(builder, plant, **{"frames": [tip], "ground": ground} | given)


def test_forces_add_to_what_is_connected_to_the_plant():
    def acceleration(moment: float) -> float:
        """Of the level rod at rest, in rad/s²."""
        builder, plant, _, cables = rod_with_tendons()
        motor = builder.AddSystem(ConstantVectorSource([moment]))
        port = plant.get_applied_generalized_force_input_port()
        builder.Connect(motor.get_output_port(), port)
        AddCables(builder, plant, cables=cables)
        diagram = builder.Build()
        derivatives = diagram.EvalTimeDerivatives(diagram.CreateDefaultContext())
        return float(derivatives.get_generalized_velocity().CopyToVector()[0])

    pull = LAW.stiffness * (LEFT + RIGHT)[2] - 0.5 * MASS * GRAVITY  # at the tip, upward
    for moment in (0.0, 3.0):
        expected = (moment + LENGTH * pull) / (MASS * LENGTH**2 / 3.0)
        assert acceleration(moment) == pytest.approx(expected, rel=1e-12)


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


def test_a_robot_is_shown_in_meshcat_with_struts_nodes_and_cables():
    robot, meshcat = Robot.of(load_scenario("thesis")), Meshcat()
    diagram = MakeTensegrityDiagram(robot, seeded_gait(robot.scenario), meshcat=meshcat)
    inspector = diagram.GetSubsystemByName("scene_graph").model_inspector()
    assert inspector.num_geometries() == 5 * (6 + 4) + 24 * 4
    diagram.ForcedPublish(diagram.CreateDefaultContext())
    for path in ("T1", "T1-T2 outer top 0"):
        assert meshcat.HasPath(f"/drake/illustration/{path}")
    can_be_dragged = hasattr(VisualizationConfig, "mouse_interaction_stiffness")
    assert diagram.HasSubsystemNamed("meshcat_mouse_spring") == can_be_dragged
