"""The wiring: the diagram that mirrors the thesis's Simulink model (appendix C)."""

from __future__ import annotations

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Diagram, DiagramBuilder, System
from pydrake.systems.primitives import Adder, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from tetra_drake.robot.bodies import AddTetrahedra
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.signals import signal_samples
from tetra_drake.robot.structure import MakeStructure, Structure
from tetra_drake.scenario.schema import Scenario
from tetra_drake.systems import CableNetwork, GroundContact, MatsuokaCpg, StartUpGate


def MakeTensegrityDiagram(scenario: Scenario, gait: Gait) -> Diagram:
    """The robot walking by one gait, with its default context at the scenario's start.

        cpg -> start_up -> cables -> forces -> plant -> state -> (cables, ground)
                           ground -> forces

    Subsystems: cpg, start_up, cables, ground, forces, plant. There is no SceneGraph: pictures
    are made from trajectories (see scene.py).
    Output ports: state, signals, tensions, lengths, normal_forces, friction_forces, modes.
    Shapes and units are those of the systems the ports come from.
    """
    structure = MakeStructure(scenario.robot, scenario.cables)
    builder = DiagramBuilder()
    plant = AddPlant(builder, scenario, structure)
    cpg = AddCpg(builder, scenario, gait)
    gate = builder.AddNamedSystem(
        "start_up", StartUpGate(scenario.oscillators, start_up=scenario.cpg.start_up)
    )
    cables = builder.AddNamedSystem("cables", CableNetwork(structure, slack=scenario.cables.slack))
    ground = AddGround(builder, scenario, structure)
    forces = builder.AddNamedSystem("forces", Adder(2, 6 * len(structure.bodies)))

    state, signals = plant.get_state_output_port(), gate.GetOutputPort("signals")
    builder.Connect(cpg.get_output_port(0), gate.GetInputPort("ungated"))
    builder.Connect(signals, cables.GetInputPort("signals"))
    builder.Connect(state, cables.GetInputPort("state"))
    builder.Connect(state, ground.GetInputPort("state"))
    builder.Connect(cables.GetOutputPort("generalized_force"), forces.get_input_port(0))
    builder.Connect(ground.GetOutputPort("generalized_force"), forces.get_input_port(1))
    builder.Connect(forces.get_output_port(), plant.get_applied_generalized_force_input_port())

    builder.ExportOutput(state, "state")
    builder.ExportOutput(signals, "signals")
    for system, port in (
        (cables, "tensions"),
        (cables, "lengths"),
        (ground, "normal_forces"),
        (ground, "friction_forces"),
        (ground, "modes"),
    ):
        builder.ExportOutput(system.GetOutputPort(port), port)
    diagram = builder.Build()
    diagram.set_name("tensegrity_robot")
    return diagram


def AddPlant(builder: DiagramBuilder, scenario: Scenario, structure: Structure) -> MultibodyPlant:
    """Adds the continuous-time plant "plant" with the tetrahedra at their start."""
    plant = builder.AddNamedSystem("plant", MultibodyPlant(time_step=0.0))
    AddTetrahedra(plant, structure)
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -scenario.robot.gravity])
    plant.Finalize()
    plant.SetDefaultPositions(structure.initial_state[: plant.num_positions()])
    return plant


def AddCpg(builder: DiagramBuilder, scenario: Scenario, gait: Gait) -> System:
    """Adds "cpg", whose output port 0 gives the signals: the network itself if the scenario
    asks for it live, else a recording of it."""
    oscillators = scenario.oscillators
    if scenario.cpg.signals == "live":
        cpg: System = MatsuokaCpg(scenario.cpg, gait, oscillators=oscillators)
    else:
        samples = signal_samples(scenario, gait)
        times = scenario.cpg.listing_step * np.arange(len(samples))
        cpg = TrajectorySource(PiecewisePolynomial.FirstOrderHold(times, samples.T))
    return builder.AddNamedSystem("cpg", cpg)


def AddGround(builder: DiagramBuilder, scenario: Scenario, structure: Structure) -> GroundContact:
    """Adds the ground under the contact nodes as "ground"."""
    witness = scenario.simulation.mode_changes == "witness"
    ground = GroundContact(structure, scenario.ground, scenario.friction, witness=witness)
    return builder.AddNamedSystem("ground", ground)
