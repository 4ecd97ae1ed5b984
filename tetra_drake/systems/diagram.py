"""Wiring of the robot as one Drake diagram, after the thesis's Simulink model (appendix C)."""

from __future__ import annotations

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Diagram, DiagramBuilder, System
from pydrake.systems.primitives import Adder, ConstantVectorSource, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from tetra_drake.robot.gait import Gait
from tetra_drake.robot.robot import Robot, SteeringSignal, initial_neurons
from tetra_drake.robot.signals import signal_samples
from tetra_drake.robot.structure import AddBodies
from tetra_drake.scenario.engine_kinds import Drake
from tetra_drake.systems import (
    Actuators,
    Anchors,
    CableNetwork,
    Feedback,
    GroundContact,
    Loads,
    MatsuokaCpg,
    StartUpGate,
    Steering,
    StrutContact,
)


def MakeTensegrityDiagram(
    robot: Robot, gait: Gait, *, steering: SteeringSignal | None = None
) -> Diagram:
    """Diagram of a robot that walks with a gait. Its default context is the scenario's start.

        steering ──→ cpg ──→ start_up ──→ cables ──┬──→ forces ──→ plant ──┬──→ state
                      ↑                     ↑  │   │                       │
                      │                     │  │  ground                   │
                      │                     │  ↓   │ ↑                     │
                      └───── feedback ←─────┼──────┘ │                     │
                                ↑           │        │                     │
                                └───────────┴────────┴─────────────────────┘

        actuators ←──→ cables

        anchors, loads ──→ forces

    Subsystems:

    - cpg: with `cpg.signals: live` the network, otherwise its signals, computed beforehand. A robot
      without oscillators has no cpg.
    - feedback: only if `cpg.feedback` is not empty
    - actuators: only if the kind of actuators has states, as winches have
    - strut_contact: only if struts touch
    - anchors, loads: only if nodes of bodies are held, or loaded

    `steering` replaces the gait's turn. Input port: turn (of a live network). Output ports: state
    (from plant), signals (start_up), drives (actuators), tensions and lengths (cables),
    normal_forces, friction_forces and modes (ground). For shapes and units, see the systems. There
    is no SceneGraph: pages and films are made from trajectories.
    """
    scenario, structure = robot.scenario, robot.structure
    builder = DiagramBuilder()

    plant = builder.AddNamedSystem("plant", MultibodyPlant(time_step=0.0))
    AddBodies(plant, structure)
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -scenario.robot.gravity])
    plant.Finalize()
    plant.SetDefaultPositions(structure.initial_state[: plant.num_positions()])

    start_up = _AddSignals(builder, robot, gait, steering)
    cables = builder.AddNamedSystem("cables", CableNetwork(robot))
    witness = isinstance(scenario.engine, Drake) and scenario.engine.mode_changes == "witness"
    ground = builder.AddNamedSystem("ground", GroundContact(robot, witness=witness))
    acting: list[System] = [cables, ground]
    if robot.model.strut_contact.acts:
        acting.append(builder.AddNamedSystem("strut_contact", StrutContact(robot)))
    if structure.anchors.nodes.size:
        acting.append(builder.AddNamedSystem("anchors", Anchors(robot)))
    if structure.loads.nodes.size:
        acting.append(builder.AddNamedSystem("loads", Loads(robot)))
    forces = builder.AddNamedSystem("forces", Adder(len(acting), 6 * len(structure.bodies)))

    state, signals = plant.get_state_output_port(), start_up.get_output_port()
    builder.Connect(signals, cables.GetInputPort("signals"))
    for i, system in enumerate(acting):
        builder.Connect(state, system.GetInputPort("state"))
        builder.Connect(system.GetOutputPort("generalized_force"), forces.get_input_port(i))
    builder.Connect(forces.get_output_port(), plant.get_applied_generalized_force_input_port())
    if len(robot.starting_drives()):
        actuators = builder.AddNamedSystem("actuators", Actuators(robot))
        builder.Connect(cables.GetOutputPort("drive_rates"), actuators.GetInputPort("rates"))
        builder.Connect(actuators.get_output_port(), cables.GetInputPort("drives"))
        builder.ExportOutput(actuators.get_output_port(), "drives")
    if structure.signals and scenario.cpg.feedback:
        gains = [gain for _, gain in gait.gains]
        feedback = builder.AddNamedSystem("feedback", Feedback(robot, gains=gains))
        builder.Connect(state, feedback.GetInputPort("state"))
        for source, name in ((cables, "cable_forces"), (ground, "ground_forces")):
            builder.Connect(source.GetOutputPort(name), feedback.GetInputPort(name))
        cpg = builder.GetSubsystemByName("cpg")
        builder.Connect(feedback.get_output_port(), cpg.GetInputPort("feedback"))

    builder.ExportOutput(state, "state")
    builder.ExportOutput(signals, "signals")
    for name in ("tensions", "lengths"):
        builder.ExportOutput(cables.GetOutputPort(name), name)
    for name in ("normal_forces", "friction_forces", "modes"):
        builder.ExportOutput(ground.GetOutputPort(name), name)
    diagram = builder.Build()
    diagram.set_name("tensegrity_robot")
    return diagram


def _AddSignals(
    builder: DiagramBuilder, robot: Robot, gait: Gait, steering: SteeringSignal | None
) -> System:
    """Adds `start_up` and the systems before it. Its output port has the signals of the cables."""
    size = robot.structure.signals
    if not size:
        return builder.AddNamedSystem("start_up", ConstantVectorSource(np.zeros(0)))
    cpg = _AddCpg(builder, robot, gait, steering)
    gate = StartUpGate(size, start_up=robot.scenario.cpg.start_up)
    start_up = builder.AddNamedSystem("start_up", gate)
    builder.Connect(cpg.get_output_port(0), start_up.get_input_port())
    return start_up


def _AddCpg(
    builder: DiagramBuilder, robot: Robot, gait: Gait, steering: SteeringSignal | None
) -> System:
    """Adds `cpg`: a live network with its `steering`, or a source of signals that were computed
    beforehand. Its first output port has the signals."""
    cpg = robot.scenario.cpg
    if cpg.signals != "live":
        samples = signal_samples(robot, gait, steering)
        times = cpg.listing_step * np.arange(len(samples))
        source = TrajectorySource(PiecewisePolynomial.FirstOrderHold(times, samples.T))
        return builder.AddNamedSystem("cpg", source)
    robot.turns(gait, steering)  # raises InputError for a wrong turn
    neurons = MatsuokaCpg(
        robot.network(gait),
        tonic=cpg.external_input,
        initial_state=initial_neurons(cpg, robot.structure.signals),
        gain=cpg.gain,
    )
    oscillators = builder.AddNamedSystem("cpg", neurons)
    turn = gait.turn if steering is None else steering
    steers = builder.AddNamedSystem("steering", Steering(robot.tonic_input, turn=turn))
    builder.Connect(steers.get_output_port(), oscillators.GetInputPort("tonic"))
    builder.ExportInput(steers.GetInputPort("turn"), "turn")
    return oscillators
