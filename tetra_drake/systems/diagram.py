"""The wiring: the robot as one Drake diagram, after the thesis's Simulink model (appendix C)."""

from __future__ import annotations

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Diagram, DiagramBuilder, System
from pydrake.systems.primitives import Adder, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from tetra_drake.robot.bodies import AddTetrahedra
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.signals import signal_samples
from tetra_drake.robot.structure import MakeStructure
from tetra_drake.scenario.schema import Scenario
from tetra_drake.systems import CableNetwork, GroundContact, MatsuokaCpg, StartUpGate


def MakeTensegrityDiagram(scenario: Scenario, gait: Gait) -> Diagram:
    """The robot walking by a gait; its default context is the scenario's start.

        cpg ──→ start_up ──→ cables ──┬──→ forces ──→ plant ──┬──→ state
                               ↑      │                       │
                               │    ground                    │
                               │      ↑                       │
                               └──────┴───────────────────────┘

    Output ports: state (plant), signals (start_up), tensions and lengths (cables), normal_forces,
    friction_forces and modes (ground); the systems' docstrings give shapes and units. There is
    no SceneGraph: pictures are made from trajectories.
    """
    structure = MakeStructure(scenario)
    builder = DiagramBuilder()

    plant = builder.AddNamedSystem("plant", MultibodyPlant(time_step=0.0))
    AddTetrahedra(plant, structure)
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -scenario.robot.gravity])
    plant.Finalize()
    plant.SetDefaultPositions(structure.initial_state[: plant.num_positions()])

    cpg = builder.AddNamedSystem("cpg", _make_cpg(scenario, gait))
    gate = StartUpGate(scenario.oscillators, start_up=scenario.cpg.start_up)
    start_up = builder.AddNamedSystem("start_up", gate)
    cables = builder.AddNamedSystem("cables", CableNetwork(structure, slack=scenario.cables.slack))
    witness = scenario.simulation.mode_changes == "witness"
    contact = GroundContact(structure, scenario, witness=witness)
    ground = builder.AddNamedSystem("ground", contact)
    forces = builder.AddNamedSystem("forces", Adder(2, 6 * len(structure.bodies)))

    state, signals = plant.get_state_output_port(), start_up.GetOutputPort("signals")
    builder.Connect(cpg.get_output_port(0), start_up.GetInputPort("ungated"))
    builder.Connect(signals, cables.GetInputPort("signals"))
    builder.Connect(state, cables.GetInputPort("state"))
    builder.Connect(state, ground.GetInputPort("state"))
    builder.Connect(cables.GetOutputPort("generalized_force"), forces.get_input_port(0))
    builder.Connect(ground.GetOutputPort("generalized_force"), forces.get_input_port(1))
    builder.Connect(forces.get_output_port(), plant.get_applied_generalized_force_input_port())

    builder.ExportOutput(state, "state")
    builder.ExportOutput(signals, "signals")
    for name in ("tensions", "lengths"):
        builder.ExportOutput(cables.GetOutputPort(name), name)
    for name in ("normal_forces", "friction_forces", "modes"):
        builder.ExportOutput(ground.GetOutputPort(name), name)
    diagram = builder.Build()
    diagram.set_name("tensegrity_robot")
    return diagram


def _make_cpg(scenario: Scenario, gait: Gait) -> System:
    """The oscillator network itself if `cpg.signals` is `live`, else its precomputed signals."""
    if scenario.cpg.signals == "live":
        return MatsuokaCpg(scenario.cpg, gait, oscillators=scenario.oscillators)
    samples = signal_samples(scenario, gait)
    times = scenario.cpg.listing_step * np.arange(len(samples))
    return TrajectorySource(PiecewisePolynomial.FirstOrderHold(times, samples.T))
