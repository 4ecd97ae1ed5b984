"""One tetrahedron on its base triangle, whose three nodes the ground can touch."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.math import SpatialVelocity
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput

from tetra_drake.engines.drake import MakeSimulator
from tetra_drake.robot.bodies import tetrahedron_inertia
from tetra_drake.robot.structure import (
    BASE,
    BOTTOM_LEFT,
    MakeStructure,
    Structure,
    node_positions,
    node_velocities,
)
from tetra_drake.scenario.schema import Scenario, SimulationScenario
from tetra_drake.systems.diagram import AddGround, AddPlant

R_WB = RotationMatrix([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])
"""Turns a tetrahedron so that its tip points up and its `top` node forward."""


@dataclass(frozen=True)
class Motion:
    """A recorded motion of one tetrahedron, sampled at the end of each step, in SI units.

    Contact nodes are those of the base triangle, in the order of `robot.BASE`.
    """

    times: np.ndarray
    """(samples,)."""
    p_WN: np.ndarray
    """(samples, 4, 3): positions of the nodes."""
    v_WN: np.ndarray
    """(samples, 4, 3): velocities of the nodes."""
    normal_forces: np.ndarray
    """(samples, 3): by contact node."""
    friction_forces: np.ndarray
    """(samples, 3, 2): by contact node, along x and y."""
    modes: np.ndarray
    """(samples, 3, 3): by contact node, contact and friction modes as GroundContact has them."""


def MakeTetrahedron(scenario: Scenario) -> Structure:
    """The scenario's tetrahedron alone, without cables, with its base triangle at height 0.

    It stands so when turned by R_WB.
    """
    robot = MakeStructure(scenario.robot, scenario.cables)
    base = R_WB.multiply(robot.p_BN[BOTTOM_LEFT])
    return dataclasses.replace(
        robot,
        bodies=("T1",),
        p_WB=np.array([[0.0, 0.0, -base[2]]]),
        cables=robot.cables[:0],
        cable_names=(),
        contacts=np.array(BASE),
    )


def MakeTetrahedronDiagram(scenario: Scenario) -> Diagram:
    """One tetrahedron and the ground under its base triangle.

        plant -> state -> ground -> plant

    Subsystems: plant, ground, and a log of each port that Motion holds, called after the
    port: state_log, normal_forces_log, friction_forces_log, modes_log.
    """
    tetrahedron = MakeTetrahedron(scenario)
    builder = DiagramBuilder()
    plant = AddPlant(builder, scenario, tetrahedron)
    ground = AddGround(builder, scenario, tetrahedron)
    state = plant.get_state_output_port()
    builder.Connect(state, ground.GetInputPort("state"))
    builder.Connect(
        ground.GetOutputPort("generalized_force"),
        plant.get_applied_generalized_force_input_port(),
    )
    LogVectorOutput(state, builder).set_name("state_log")
    for port in ("normal_forces", "friction_forces", "modes"):
        LogVectorOutput(ground.GetOutputPort(port), builder).set_name(f"{port}_log")
    diagram = builder.Build()
    diagram.set_name("tetrahedron_on_the_ground")
    return diagram


def weight(scenario: Scenario) -> float:
    """Of one tetrahedron, in N."""
    return tetrahedron_inertia(MakeTetrahedron(scenario)).get_mass() * scenario.robot.gravity


def let_go(
    scenario: Scenario, *, height: float, velocity: Sequence[float], duration: float
) -> Motion:
    """Lets the tetrahedron go with its base triangle at `height` (m) and `velocity` (m/s)."""
    scenario = dataclasses.replace(scenario, simulation=_fine(scenario.simulation))
    diagram = MakeTetrahedronDiagram(scenario)
    tetrahedron = MakeTetrahedron(scenario)
    simulator = MakeSimulator(diagram, scenario.simulation)
    context = simulator.get_mutable_context()

    plant = diagram.GetSubsystemByName("plant")
    plant_context = plant.GetMyMutableContextFromRoot(context)
    body = plant.GetBodyByName("T1")
    X_WB = RigidTransform(R_WB, tetrahedron.p_WB[0] + [0.0, 0.0, height])
    plant.SetFreeBodyPose(plant_context, body, X_WB)
    V_WB = SpatialVelocity(w=np.zeros(3), v=velocity)
    plant.SetFreeBodySpatialVelocity(context=plant_context, body=body, V_JpJc=V_WB)

    simulator.AdvanceTo(duration)
    return _read_logs(diagram, context, tetrahedron)


def _fine(settings: SimulationScenario) -> SimulationScenario:
    """Settings for motions that are over in some ms: modes change where witnesses say."""
    return dataclasses.replace(
        settings,
        scheme="runge_kutta3",
        accuracy=1e-4,
        max_step=1e-4,
        mode_changes="witness",
        witness_window=1e-6,
    )


def _read_logs(diagram: Diagram, context: Context, tetrahedron: Structure) -> Motion:
    logs = {
        port: diagram.GetSubsystemByName(f"{port}_log").FindLog(context)
        for port in ("state", "normal_forces", "friction_forces", "modes")
    }
    data = {port: log.data().T for port, log in logs.items()}
    contacts = len(tetrahedron.contacts)
    return Motion(
        times=logs["state"].sample_times(),
        p_WN=np.array([node_positions(tetrahedron, state) for state in data["state"]]),
        v_WN=np.array([node_velocities(tetrahedron, state) for state in data["state"]]),
        normal_forces=data["normal_forces"],
        friction_forces=data["friction_forces"].reshape(-1, contacts, 2),
        modes=data["modes"].reshape(-1, contacts, 3),
    )
