"""Systems for AutoDiffXd and clones: derivatives against Drake's elements and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.rod import unfinished_rod
from helpers.springs import with_springs
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator, Simulator_
from pydrake.systems.framework import Diagram, DiagramBuilder, System

from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import load_scenario
from tetra_drake.systems import AddCables, Cable, Steering
from tetra_drake.systems.diagram import MakeTensegrityDiagram


def with_cables(builder: DiagramBuilder, plant: MultibodyPlant, cables: list[Cable]) -> None:
    plant.Finalize()
    AddCables(builder, plant, cables=cables, slack=False)


def rates_and_gradient(diagram: System, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rates of the state of a system for AutoDiffXd, and their derivatives by the state."""
    context = diagram.CreateDefaultContext()
    context.SetContinuousState(InitializeAutoDiff(state).ravel())
    rates = diagram.EvalTimeDerivatives(context).CopyToVector()
    return ExtractValue(rates).ravel(), ExtractGradient(rates)


def test_cables_have_the_rates_and_derivatives_of_drakes_linear_spring_dampers():
    diagrams = []
    for attach in (with_cables, with_springs):
        builder, plant, _, cables = unfinished_rod(free_length=0.2)
        attach(builder, plant, cables)
        diagrams.append(builder.Build())
    ours, drakes = (each.ToAutoDiffXd() for each in diagrams)
    plain = diagrams[0].CreateDefaultContext()
    for state in np.random.default_rng(1).uniform(-2.0, 2.0, (100, 2)):
        rates, gradient = rates_and_gradient(ours, state)
        expected = rates_and_gradient(drakes, state)
        np.testing.assert_allclose(rates, expected[0], rtol=1e-9, atol=1e-9)
        scale = np.abs(expected[1]).max()
        np.testing.assert_allclose(gradient, expected[1], rtol=0.0, atol=1e-6 * scale)
        plain.SetContinuousState(state)
        found = diagrams[0].EvalTimeDerivatives(plain).CopyToVector()
        np.testing.assert_allclose(found, rates, rtol=1e-9, atol=1e-9)


def doubled(turn: np.ndarray) -> np.ndarray:
    return np.array([2.0 * turn, 0.0])


@pytest.mark.parametrize("turn", [-1.0, 0.3, 1.0])
def test_steering_has_derivatives_up_to_the_limits_of_the_turn(turn):
    steering = Steering(doubled, turn=0.0).ToAutoDiffXd()
    context = steering.CreateDefaultContext()
    steering.get_input_port().FixValue(context, InitializeAutoDiff(np.array([turn])).ravel())
    tonic = steering.get_output_port().Eval(context)
    np.testing.assert_allclose(ExtractGradient(tonic), [[2.0], [0.0]], atol=1e-9)


def walking(changes: dict[str, object]) -> tuple[Diagram, Simulator]:
    """Diagram of a robot on the ground, and its simulator after a fifth of a second."""
    scenario = load_scenario("thesis").with_changes(changes)
    diagram = MakeTensegrityDiagram(Robot.of(scenario), seeded_gait(scenario, 1))
    simulator = Simulator(diagram)
    simulator.AdvanceTo(0.2)
    return diagram, simulator


LIVE = {"cpg.signals": "live", "cpg.feedback": ["length"]}


@pytest.mark.parametrize("changes", [{}, LIVE], ids=["listing", "live"])
def test_a_robot_converts_with_its_ground_in_the_modes_of_the_state(changes):
    diagram, simulator = walking(changes)
    context, converted = simulator.get_context(), diagram.ToAutoDiffXd()
    state = context.get_continuous_state_vector().CopyToVector()
    given, size = converted.CreateDefaultContext(), state.size
    given.SetTimeStateAndParametersFrom(context)
    directions = np.random.default_rng(3).normal(size=(size, 2))
    given.SetContinuousState(InitializeAutoDiff(state, directions).ravel())
    rates = converted.EvalTimeDerivatives(given).CopyToVector()
    expected = diagram.EvalTimeDerivatives(context).CopyToVector()
    np.testing.assert_allclose(ExtractValue(rates).ravel(), expected, rtol=1e-9, atol=1e-9)
    moved, step = context.Clone(), 1e-7
    for column, direction in enumerate(directions.T):
        sides = []
        for side in (-step, step):
            moved.SetContinuousState(state + side * direction)
            sides.append(diagram.EvalTimeDerivatives(moved).CopyToVector())
        slope, found = (sides[1] - sides[0]) / (2.0 * step), ExtractGradient(rates)[:, column]
        np.testing.assert_allclose(found, slope, atol=1e-5 * np.abs(slope).max())


@pytest.mark.parametrize("changes", [{}, LIVE], ids=["listing", "live"])
def test_a_clone_moves_as_its_original_and_apart_from_it(changes):
    diagram, simulator = walking(changes)
    clone = diagram.Clone()
    other = Simulator(clone)  # a clone of Drake's plant loses default poses of free bodies
    start = diagram.CreateDefaultContext()
    other.get_mutable_context().SetTimeStateAndParametersFrom(start)
    other.AdvanceTo(0.2)
    ends = [
        each.get_context().get_continuous_state_vector().CopyToVector()
        for each in (simulator, other)
    ]
    np.testing.assert_array_equal(ends[0], ends[1])


def test_a_robot_for_autodiff_is_not_simulated_because_its_modes_would_stay(refused):
    diagram, _ = walking({})
    simulator = Simulator_[AutoDiffXd](diagram.ToAutoDiffXd())
    with refused("AutoDiffXd", "timer", "discrete state"):
        simulator.Initialize()


def test_inputs_with_unequal_numbers_of_derivatives_are_refused(refused):
    builder = DiagramBuilder()
    steering = builder.AddNamedSystem("steers", Steering(doubled, turn=0.0))
    builder.ExportInput(steering.get_input_port())
    builder.ExportOutput(steering.get_output_port())
    diagram = builder.Build().ToAutoDiffXd()
    context = diagram.CreateDefaultContext()
    context.SetTime(AutoDiffXd(0.0, [1.0, 0.0]))
    diagram.get_input_port().FixValue(context, InitializeAutoDiff(np.zeros(1)).ravel())
    with refused("AutoDiffXd", "steers", "[1, 2] derivatives"):
        diagram.get_output_port().Eval(context)
