"""Constants of cables and ground as parameters of a context: one diagram for many robots."""

import numpy as np
import pytest
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, InitializeAutoDiff

from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import load_scenario
from tetra_drake.systems.diagram import MakeTensegrityDiagram

SOFTER = {
    "robot.cables.outer_stiffness": "17 N/m",
    "robot.cables.damping": "3 N s/m",
    "ground.stiffness": "3000 N/m",
    "friction.kinetic": 0.1,
}


@pytest.fixture(scope="module")
def robots():
    scenario = load_scenario("coulomb")
    return Robot.of(scenario), Robot.of(scenario.with_changes(SOFTER))


def diagram_of(robot, **settings):
    return MakeTensegrityDiagram(robot, seeded_gait(robot.scenario, 3), **settings)


def put(diagram, context, robot):
    """Writes a robot's constants to a context."""
    cables, ground = (diagram.GetSubsystemByName(name) for name in ("cables", "ground"))
    cables.SetLaw(cables.GetMyMutableContextFromRoot(context), robot.model.cables.law)
    ground.SetGround(ground.GetMyMutableContextFromRoot(context), robot.ground)


def moving(diagram):
    """A context where bodies move on and in the ground, some of them slipping."""
    context, random = diagram.CreateDefaultContext(), np.random.default_rng(7)
    state = context.get_continuous_state_vector().CopyToVector()
    state[6:35:7] -= 1e-3
    state[35:] = random.uniform(-0.3, 0.3, state[35:].size)
    context.SetContinuousState(state)
    ground = diagram.GetSubsystemByName("ground")
    own = ground.GetMyMutableContextFromRoot(context)
    modes = own.get_mutable_discrete_state_vector().get_mutable_value().reshape(-1, 12)
    modes[:, :3] = np.column_stack([np.ones((len(modes), 2)), np.zeros(len(modes))])
    return context


def rates(diagram, context):
    return diagram.EvalTimeDerivatives(context).CopyToVector()


def test_contexts_of_one_diagram_are_different_robots(robots):
    """In turns, so that no context sees the constants of the other."""
    diagram = diagram_of(robots[0], parameters=True)
    contexts, expected = [moving(diagram) for _ in robots], []
    for own in map(diagram_of, robots):
        context = moving(own)
        context.SetContinuousState(contexts[0].get_continuous_state_vector().CopyToVector())
        expected.append(rates(own, context))
    assert np.abs(expected[0] - expected[1]).max() > 1.0
    for context, robot in zip(contexts, robots, strict=True):
        put(diagram, context, robot)
    for _ in range(2):
        for context, wanted in zip(contexts, expected, strict=True):
            np.testing.assert_array_equal(rates(diagram, context), wanted)
            state = context.get_continuous_state_vector().CopyToVector()
            context.SetContinuousState(state)  # nothing stays cached
    copy = contexts[1].Clone()
    put(diagram, contexts[1], robots[0])
    np.testing.assert_array_equal(rates(diagram, copy), expected[1])
    np.testing.assert_array_equal(rates(diagram, contexts[1]), expected[0])


def test_tensions_have_derivatives_by_the_constants(robots):
    """dT/dk of a cable at rest is its stretch; this robot's cables also push."""
    structure, law = robots[0].structure, robots[0].model.cables.law
    twin = diagram_of(robots[0], parameters=True).GetSubsystemByName("cables").ToAutoDiffXd()
    context = twin.CreateDefaultContext()
    for place, given in enumerate((structure.initial_state, np.zeros(structure.signals))):
        port = twin.get_input_port(place)
        port.FixValue(context, np.array([AutoDiffXd(number) for number in given]))
    parameters = context.get_mutable_parameters().get_mutable_numeric_parameter(0)
    parameters.SetFromVector(InitializeAutoDiff(np.concatenate(law[:-1])).ravel())
    ports = map(twin.get_output_port, range(twin.num_output_ports()))
    [tensions] = [port for port in ports if port.get_name().endswith("tensions")]
    slopes = ExtractGradient(tensions.Eval(context))
    stretch = structure.initial_lengths - law.free_length
    assert stretch.any()
    np.testing.assert_allclose(slopes[:, :24], np.diag(stretch), atol=1e-8)
