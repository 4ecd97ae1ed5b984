"""The wiring: the diagram that mirrors the thesis's Simulink model (appendix C)."""

from __future__ import annotations

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Diagram, DiagramBuilder, OutputPort, System
from pydrake.systems.primitives import Adder, ConstantVectorSource, PortSwitch, TrajectorySource

from tetra_drake.robot.bodies import AddTetrahedra
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.signals import signal_trajectory
from tetra_drake.robot.structure import MakeStructure, Structure
from tetra_drake.scenario.schema import Scenario
from tetra_drake.systems import CableNetwork, GroundContact, MatsuokaCpg, StartUpTimer


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
    signals = AddStartUp(builder, scenario, cpg.get_output_port(0))
    cables = builder.AddNamedSystem("cables", CableNetwork(structure, slack=scenario.cables.slack))
    ground = AddGround(builder, scenario, structure)
    forces = builder.AddNamedSystem("forces", Adder(2, 6 * len(structure.bodies)))

    state = plant.get_state_output_port()
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
        cpg = TrajectorySource(
            signal_trajectory(
                scenario.cpg,
                gait,
                oscillators=oscillators,
                duration=scenario.simulation.duration,
            )
        )
    return builder.AddNamedSystem("cpg", cpg)


def AddStartUp(builder: DiagramBuilder, scenario: Scenario, signals: OutputPort) -> OutputPort:
    """Adds the switch "start_up", which passes zeros on before the start-up time and the
    signals afterwards; returns its output port."""
    size = signals.size()
    switch = builder.AddNamedSystem("start_up", PortSwitch(size))
    off, on = switch.DeclareInputPort("off"), switch.DeclareInputPort("on")
    zeros = builder.AddNamedSystem("no_actuation", ConstantVectorSource(np.zeros(size)))
    timer = StartUpTimer(
        start_up=scenario.cpg.start_up, before=off.get_index(), after=on.get_index()
    )
    builder.AddNamedSystem("start_up_timer", timer)
    builder.Connect(timer.GetOutputPort("selector"), switch.get_port_selector_input_port())
    builder.Connect(zeros.get_output_port(), off)
    builder.Connect(signals, on)
    return switch.get_output_port()


def AddGround(builder: DiagramBuilder, scenario: Scenario, structure: Structure) -> GroundContact:
    """Adds the ground under the contact nodes as "ground"."""
    witness = scenario.simulation.mode_changes == "witness"
    ground = GroundContact(structure, scenario.ground, scenario.friction, witness=witness)
    return builder.AddNamedSystem("ground", ground)
