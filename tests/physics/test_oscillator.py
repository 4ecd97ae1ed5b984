"""The Matsuoka network: Eq. 7 by hand, its fixed point, and the order of its two integrators.

Its agreement with the thesis's listing is tested in tests/robot/test_signals.py.
"""

import numpy as np
import pytest

from tetra_drake.physics.oscillator import (
    U_RATE,
    V_RATE,
    Network,
    inhibition_matrix,
    make_neurons,
    network_output,
    neuron_rates,
    oscillator_output,
)


def neurons_at(u: list[float] | np.ndarray, v: list[float] | np.ndarray) -> np.ndarray:
    """The neurons with these states."""
    return make_neurons(np.concatenate([u, v]))


def test_weights_stand_in_the_listings_order():
    # B.2: sum(1) takes w(1) y(3), w(2) y(5), w(3) y(7) and the partner y(2); sum(2) takes
    # w(4) y(4) ...; sum(8) takes w(22) y(2), w(23) y(4), w(24) y(6).
    matrix = inhibition_matrix(np.arange(1.0, 25.0), oscillators=4, partner_weight=1.5)
    assert matrix[0].tolist() == [0, 1.5, 1, 0, 2, 0, 3, 0]
    assert matrix[1].tolist() == [1.5, 0, 0, 4, 0, 5, 0, 6]
    assert matrix[7].tolist() == [0, 22, 0, 23, 0, 24, 1.5, 0]


def test_rates_are_those_of_equation_7():
    # One oscillator by hand: u = (0.4, -0.2), v = (0.1, 0.3), f = (0.05, 0), w_partner = 1.5,
    # beta = 2.5, u0 = 0.5, tau_A = 0.25 s, tau_B = 0.5 s; y = (0.4, 0).
    #   du_e = (-0.4 - 1.5*0   - 2.5*0.1 + 0.5 + 0.05)/0.25 = -0.4
    #   du_f = ( 0.2 - 1.5*0.4 - 2.5*0.3 + 0.5       )/0.25 = -2.6
    #   dv_e = (0.4 - 0.1)/0.5 = 0.6,  dv_f = (0 - 0.3)/0.5 = -0.6
    network = Network(np.array([[0.0, 1.5], [1.5, 0.0]]), 0.25, 0.5, 2.5, 0.5)
    neurons = neurons_at([0.4, -0.2], [0.1, 0.3])
    neuron_rates(network, np.array([0.05, 0.0]), neurons)
    np.testing.assert_allclose(neurons[:, U_RATE], [-0.4, -2.6], rtol=1e-14)
    np.testing.assert_allclose(neurons[:, V_RATE], [0.6, -0.6], rtol=1e-14)


def test_the_network_rests_where_all_neurons_agree():
    # With u = v = y = r for all neurons, Eq. 7 and its -u term give
    # r (1 + 1.5 + 3 w + beta) = u0 for four oscillators with equal weights w.
    weight, beta, u0 = 2.0, 2.5, 0.5
    r = u0 / (1.0 + 1.5 + 3.0 * weight + beta)
    inhibition = inhibition_matrix(np.full(24, weight), oscillators=4, partner_weight=1.5)
    neurons = neurons_at(np.full(8, r), np.full(8, r))
    neuron_rates(Network(inhibition, 0.3, 0.6, beta, u0), np.zeros(8), neurons)
    np.testing.assert_allclose(neurons[:, [U_RATE, V_RATE]], 0.0, atol=2e-15)


def test_output_counts_only_firing_neurons():
    output = np.empty(2)
    oscillator_output(neurons_at([0.4, -0.3, -0.1, 0.2], np.zeros(4)), output)
    assert output.tolist() == [0.4, -0.2]


@pytest.mark.parametrize(
    ("listing", "first_row", "order"), [(True, 1, 1), (False, 0, 4)], ids=["listing", "recorded"]
)
def test_integrators_have_their_order(listing, first_row, order):
    # While both neurons of one oscillator fire, Eq. 7 is linear, without kinks. Halving the
    # step then divides the error by 2^order.
    network = Network(np.array([[0.0, 0.4], [0.4, 0.0]]), 0.3, 0.6, 2.5, 0.5)

    def output_at_the_end(steps: int) -> float:
        neurons, output = neurons_at([0.3, 0.25], [0.1, 0.12]), np.empty((steps + 1 - first_row, 1))
        network_output(network, np.zeros(2), 0.2 / steps, listing, neurons, output)
        return float(output[-1, 0])

    exact = output_at_the_end(4096)
    errors = [abs(output_at_the_end(steps) - exact) for steps in (4, 8)]
    assert errors[0] / errors[1] == pytest.approx(2.0**order, rel=0.15)
