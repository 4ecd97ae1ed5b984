"""Structures in motion: against an independent simulation, the row of tetrahedra, and each other.

In tests/data/structures.json sines pull at the cables of structures at rest; there, neither
starts 1e-7 m apart nor steps twice as long make a difference of 4e-7 m after 5 s.
"""

import dataclasses

import numpy as np
import pytest
from helpers.forces import forces_at
from helpers.steps import make_step
from helpers.structures import course_of, onto_recorded, poses_of, recorded_structure
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import Adder, Sine

from tetra_drake.engines.compiled.dynamics import Solver
from tetra_drake.engines.compiled.rosenbrock import take_step
from tetra_drake.engines.drake import MakeSimulator
from tetra_drake.engines.simulate import simulate
from tetra_drake.physics.contact import MODE_COLUMNS, modes_after_step
from tetra_drake.physics.forces import Forces
from tetra_drake.robot.bodies import AddBodies
from tetra_drake.robot.gait import seeded_gait
from tetra_drake.robot.robot import MakeStructure, Robot
from tetra_drake.robot.structure import node_positions
from tetra_drake.robot.tensegrity import MakeTensegrity
from tetra_drake.scenario.engine_kinds import Compiled, Drake
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.robot_kinds import Structure as Kind
from tetra_drake.scenario.schema import Scenario
from tetra_drake.systems import CableNetwork, GroundContact

AMPLITUDE, FREQUENCY, INTERVAL = 1.5, 2.0 * np.pi, 0.5  # N, rad/s, s between recorded centres


def compare_centres(robot: Robot, recorded: dict, centres: np.ndarray) -> None:
    """Asserts that the mean places of the bodies, (times, 3), are the recorded ones."""
    structure = robot.structure
    p_WN = node_positions(structure, structure.initial_state)
    transform = onto_recorded(recorded, structure.node_names, p_WN)
    there = centres @ transform[:, :3].T + transform[:, 3]
    expected = np.array(recorded["drive"]["centre_of_bars"])
    assert np.ptp(expected, axis=0).max() > 3e-3, "it moves"
    print(np.abs(there - expected).max())
    np.testing.assert_allclose(there, expected, atol=1e-5)


def centre_of(state: np.ndarray) -> np.ndarray:
    return poses_of(state[np.newaxis])[0, :, 4:].mean(axis=0)


@pytest.mark.parametrize("name", ["prism", "six_bar"])
def test_the_compiled_step_moves_as_the_independent_simulation(name, data):
    recorded, robot = recorded_structure(data, name), Robot.of(load_scenario(name))
    model, phase, h = robot.model, np.array(recorded["drive"]["phase"]), 1e-4
    solver, work, forces = Solver.of(model), make_step(model), Forces.of(model)
    modes = np.zeros((len(robot.structure.contacts), MODE_COLUMNS))
    points, every = (model.p_BN, model.first_node), round(INTERVAL / h)

    def signals(time: float) -> np.ndarray:
        return AMPLITUDE * np.sin(FREQUENCY * time + phase)

    work.state[:] = robot.structure.initial_state
    centres = [centre_of(work.state)]
    for i in range(10 * every):
        modes_after_step(work.state, *points, model.ground, forces.nodes, forces.frames, modes)
        forces_at(model, work.state, modes, signals(i * h), forces, work.force)
        take_step(model, solver, work, modes, forces, signals((i + 1) * h), h, False)
        work.state[:] = work.end
        if (i + 1) % every == 0:
            centres.append(centre_of(work.state))
    compare_centres(robot, recorded, np.array(centres))


@pytest.mark.parametrize("name", ["prism", "six_bar"])
def test_the_diagrams_systems_move_as_the_independent_simulation(name, data):
    recorded, robot = recorded_structure(data, name), Robot.of(load_scenario(name))
    structure, phase = robot.structure, np.array(recorded["drive"]["phase"])
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(time_step=0.0))
    AddBodies(plant, structure)
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -robot.scenario.robot.gravity])
    plant.Finalize()
    sines = builder.AddSystem(Sine(AMPLITUDE + 0.0 * phase, FREQUENCY + 0.0 * phase, phase))
    cables, ground = builder.AddSystem(CableNetwork(robot)), builder.AddSystem(GroundContact(robot))
    forces = builder.AddSystem(Adder(2, 6 * len(structure.bodies)))
    state = plant.get_state_output_port()
    builder.Connect(sines.get_output_port(0), cables.GetInputPort("signals"))
    for i, part in enumerate((cables, ground)):
        builder.Connect(state, part.GetInputPort("state"))
        builder.Connect(part.GetOutputPort("generalized_force"), forces.get_input_port(i))
    builder.Connect(forces.get_output_port(), plant.get_applied_generalized_force_input_port())
    builder.ExportOutput(state, "state")
    diagram = builder.Build()
    fine = Drake(scheme="radau3", accuracy=1e-6, max_step=1e-3)
    simulator = MakeSimulator(diagram, fine)
    simulator.get_mutable_context().SetContinuousState(structure.initial_state)
    centres = []
    for i in range(11):
        simulator.AdvanceTo(i * INTERVAL)
        context = simulator.get_context()
        centres.append(centre_of(diagram.GetOutputPort("state").Eval(context)))
    compare_centres(robot, recorded, np.array(centres))


