"""The central pattern generator as a system."""

from pathlib import Path

import numpy as np
import pytest

from tetra_drake.physics.oscillator import (
    NEURON_COLUMNS,
    U_RATE,
    V_RATE,
    Network,
    U,
    V,
    neuron_rates,
)
from tetra_drake.robot.gait import Gait, load_gait
from tetra_drake.robot.robot import Robot, initial_neurons
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.systems import MatsuokaCpg


@pytest.fixture
def gait(scenario: Scenario, data: Path) -> Gait:
    return load_gait(data / "gait_b.json", scenario)


@pytest.fixture
def network(robot: Robot, gait: Gait) -> Network:
    return robot.network(gait)


@pytest.fixture
def cpg(scenario: Scenario, network: Network) -> MatsuokaCpg:
    law = scenario.cpg
    start = initial_neurons(law, 4)
    return MatsuokaCpg(network, tonic=law.external_input, initial_state=start, gain=law.gain)


def test_starts_at_the_values_of_table_4(cpg):
    context = cpg.CreateDefaultContext()
    state = context.get_continuous_state_vector().CopyToVector()
    np.testing.assert_array_equal(state[:8], 0.3)
    np.testing.assert_array_equal(state[8:], np.tile([0.1, 0.5], 4))
    # Both neurons of each oscillator start alike, so its signal starts at zero.
    np.testing.assert_array_equal(cpg.GetOutputPort("signals").Eval(context), np.zeros(4))


@pytest.mark.parametrize("tonic", [None, np.linspace(0.3, 0.9, 8)], ids=["0.5", "its own"])
@pytest.mark.parametrize("feedback", [None, np.linspace(-1.0, 1.0, 8)], ids=["none", "some"])
def test_derivatives_are_the_laws_with_what_is_connected(network, cpg, feedback, tonic):
    context = cpg.CreateDefaultContext()
    state, neurons = np.random.default_rng(5).normal(size=16), np.zeros((8, NEURON_COLUMNS))
    context.SetContinuousState(state)
    if feedback is not None:
        cpg.GetInputPort("feedback").FixValue(context, feedback)
    if tonic is not None:
        cpg.GetInputPort("tonic").FixValue(context, tonic)
    inputs = (0.5 if tonic is None else tonic) + (np.zeros(8) if feedback is None else feedback)
    neurons[:, U], neurons[:, V] = state[:8], state[8:]
    neuron_rates(network, inputs, neurons)
    expected = np.concatenate([neurons[:, U_RATE], neurons[:, V_RATE]])
    np.testing.assert_array_equal(cpg.EvalTimeDerivatives(context).CopyToVector(), expected)
