"""The central pattern generator as a system."""

from pathlib import Path

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from tetra_drake.physics.oscillator import neuron_rates
from tetra_drake.robot.gait import Gait, load_gait
from tetra_drake.robot.model import make_network
from tetra_drake.scenario.schema import Scenario
from tetra_drake.systems import MatsuokaCpg


@pytest.fixture
def gait(scenario: Scenario, data: Path) -> Gait:
    return load_gait(data / "gait_b.json", scenario)


def test_starts_at_the_values_of_table_4(scenario, gait):
    cpg = MatsuokaCpg(scenario.cpg, gait, oscillators=4)
    context = cpg.CreateDefaultContext()
    state = context.get_continuous_state_vector().CopyToVector()
    np.testing.assert_array_equal(state[:8], 0.3)
    np.testing.assert_array_equal(state[8:], np.tile([0.1, 0.5], 4))
    # Both neurons of each oscillator start alike, so its signal starts at zero.
    np.testing.assert_array_equal(cpg.GetOutputPort("signals").Eval(context), np.zeros(4))


def test_unconnected_feedback_is_zero_feedback(scenario, gait):
    cpg = MatsuokaCpg(scenario.cpg, gait, oscillators=4)
    free, fixed = cpg.CreateDefaultContext(), cpg.CreateDefaultContext()
    cpg.GetInputPort("feedback").FixValue(fixed, np.zeros(8))
    np.testing.assert_array_equal(
        cpg.EvalTimeDerivatives(free).CopyToVector(), cpg.EvalTimeDerivatives(fixed).CopyToVector()
    )


def test_feedback_adds_to_the_external_input(scenario, gait):
    # Eq. 7: tau_A du/dt = ... + f, so f changes du/dt by f / tau_A and dv/dt not at all.
    cpg = MatsuokaCpg(scenario.cpg, gait, oscillators=4)
    context = cpg.CreateDefaultContext()
    before = cpg.EvalTimeDerivatives(context).CopyToVector()
    feedback = np.linspace(-1.0, 1.0, 8)
    cpg.GetInputPort("feedback").FixValue(context, feedback)
    change = cpg.EvalTimeDerivatives(context).CopyToVector() - before
    np.testing.assert_allclose(change[:8], feedback / gait.tau_a, rtol=1e-12)
    np.testing.assert_array_equal(change[8:], 0.0)


def test_derivatives_are_the_laws(scenario, gait):
    cpg = MatsuokaCpg(scenario.cpg, gait, oscillators=4)
    context = cpg.CreateDefaultContext()
    state = np.random.default_rng(5).normal(size=16)
    context.SetContinuousState(state)
    expected = np.empty(16)
    network = make_network(scenario.cpg, gait, oscillators=4)
    neuron_rates(network, state[:8], state[8:], np.zeros(8), expected[:8], expected[8:])
    np.testing.assert_array_equal(cpg.EvalTimeDerivatives(context).CopyToVector(), expected)


def test_signals_are_gain_times_extensor_less_flexor(scenario, gait):
    cpg = MatsuokaCpg(scenario.cpg, gait, oscillators=4)
    context = cpg.CreateDefaultContext()
    u = np.array([0.4, -0.1, -0.2, 0.3, 0.2, 0.1, -0.3, -0.4])
    context.SetContinuousState(np.concatenate([u, np.zeros(8)]))
    y = cpg.GetOutputPort("neurons").Eval(context)
    np.testing.assert_array_equal(y, np.maximum(u, 0.0))
    two_pounds = 2.0 * 4.4482216152605
    np.testing.assert_allclose(
        cpg.GetOutputPort("signals").Eval(context), two_pounds * (y[0::2] - y[1::2]), rtol=1e-15
    )


@pytest.mark.parametrize("oscillators", [1, 2, 7])
def test_takes_any_number_of_oscillators(scenario, oscillators):
    weights = tuple(np.full(2 * oscillators * (oscillators - 1), 1.5))
    gait = Gait(name="equal", weights=weights, tau_a=0.3, tau_b=0.6)
    simulator = Simulator(MatsuokaCpg(scenario.cpg, gait, oscillators=oscillators))
    simulator.AdvanceTo(1.0)
    signals = simulator.get_system().GetOutputPort("signals").Eval(simulator.get_context())
    assert signals.shape == (oscillators,)
    np.testing.assert_allclose(signals, signals[0], rtol=1e-6, err_msg="all alike, all in phase")
