"""The robot: build its diagram, simulate one gait, write a page on which it walks.

    python diagrams/robot.py [GAIT.json]

    cpg ──→ start_up ──→ cables ──┬──→ forces ──→ plant ──┬──→ state
                           ↑      │                       │
                           │    ground                    │
                           │      ↑                       │
                           └──────┴───────────────────────┘

cpg       the signals of the central pattern generator, computed beforehand (it has no feedback)
start_up  zeros until 1.25 s, then the signals
cables    the tension of 24 cables, from their length, its rate, and the signals
ground    normal force and friction at 11 nodes; contact and stiction are discrete state
plant     five tetrahedra, free bodies without joints and without contact geometry

Writes robot.svg, the block diagram, and robot.html, the page. `tetra-drake simulate` wires the same
systems (tetra_drake/systems/diagram.py) and takes longer steps, which it lets end where a node is
predicted to touch the ground or to break free.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import Adder, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from tetra_drake.engines.sampler import Sampler, make_dataset
from tetra_drake.figures.block_diagram import save_block_diagram
from tetra_drake.results.measures import distance_walked
from tetra_drake.results.trajectory import sample_times
from tetra_drake.robot.bodies import AddTetrahedra
from tetra_drake.robot.gait import Gait, load_gait
from tetra_drake.robot.signals import signal_samples
from tetra_drake.robot.structure import MakeStructure
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.units import INCH
from tetra_drake.systems import CableNetwork, GroundContact, StartUpGate
from tetra_drake.visualization.replay import save_replay

DIAGRAMS = Path(__file__).parent
BEST_GAIT = DIAGRAMS.parent / "runs" / "thesis" / "trial_05" / "best_gait.json"


def make_diagram(scenario: Scenario, gait: Gait) -> Diagram:
    """The robot, at rest where the scenario places it."""
    structure = MakeStructure(scenario)
    builder = DiagramBuilder()

    plant = builder.AddNamedSystem("plant", MultibodyPlant(time_step=0.0))
    AddTetrahedra(plant, structure)
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -scenario.robot.gravity])
    plant.Finalize()
    plant.SetDefaultPositions(structure.initial_state[: plant.num_positions()])

    signals = signal_samples(scenario, gait)
    times = scenario.cpg.listing_step * np.arange(len(signals))
    source = TrajectorySource(PiecewisePolynomial.FirstOrderHold(times, signals.T))
    cpg = builder.AddNamedSystem("cpg", source)
    gate = StartUpGate(scenario.oscillators, start_up=scenario.cpg.start_up)
    start_up = builder.AddNamedSystem("start_up", gate)
    cables = builder.AddNamedSystem("cables", CableNetwork(structure, slack=scenario.cables.slack))
    contact = GroundContact(structure, scenario)
    ground = builder.AddNamedSystem("ground", contact)
    forces = builder.AddNamedSystem("forces", Adder(2, 6 * len(structure.bodies)))

    state = plant.get_state_output_port()
    builder.Connect(cpg.get_output_port(0), start_up.GetInputPort("ungated"))
    builder.Connect(start_up.GetOutputPort("signals"), cables.GetInputPort("signals"))
    builder.Connect(state, cables.GetInputPort("state"))
    builder.Connect(state, ground.GetInputPort("state"))
    builder.Connect(cables.GetOutputPort("generalized_force"), forces.get_input_port(0))
    builder.Connect(ground.GetOutputPort("generalized_force"), forces.get_input_port(1))
    builder.Connect(forces.get_output_port(), plant.get_applied_generalized_force_input_port())

    builder.ExportOutput(state, "state")
    for system, ports in (
        (start_up, ["signals"]),
        (cables, ["tensions", "lengths"]),
        (ground, ["normal_forces", "friction_forces", "modes"]),
    ):
        for port in ports:
            builder.ExportOutput(system.GetOutputPort(port), port)
    diagram = builder.Build()
    diagram.set_name("tensegrity_robot")
    return diagram


def main(gait_file: Path = BEST_GAIT, *, duration: float = 15.0, out: Path = DIAGRAMS) -> None:
    """Simulates the beginning of a gait and writes the pictures."""
    scenario = load_scenario("thesis")
    gait = load_gait(gait_file, scenario)
    diagram = make_diagram(scenario, gait)
    save_block_diagram(diagram, out / "robot.svg")

    # Contact and stiction change where a step ends, so no step may be long.
    simulator = Simulator(diagram)
    ResetIntegratorFromFlags(simulator, "runge_kutta3", 0.001)
    structure = MakeStructure(scenario)
    sampler = Sampler(structure, sample_times(duration, 0.01))
    simulator.set_monitor(sampler.after_step)
    simulator.AdvanceTo(duration)

    trajectory = make_dataset(diagram, structure, sampler.samples)
    inches = float(distance_walked(trajectory)[-1]) / INCH
    title = f"{gait.name}: {inches:.2f} inches in {duration:g} s"
    save_replay(out / "robot.html", scenario=scenario, trajectory=trajectory, title=title)
    print(title)
    print(f"open {out / 'robot.html'} in a browser to see it walk")


if __name__ == "__main__":
    main(*[Path(name) for name in sys.argv[1:2]])
