"""The Matsuoka network against the thesis's listing and against its own fixed point."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tetra_drake.physics.oscillator import inhibition_matrix, neuron_rates, oscillator_output
from tetra_drake.robot.gait import load_gait
from tetra_drake.robot.signals import listing_samples
from tetra_drake.scenario.schema import Scenario


@pytest.mark.parametrize("name", ["gait_a", "gait_b", "single_oscillators"])
def test_stepped_as_the_listing_steps_it_gives_the_listings_output(
    scenario: Scenario, data: Path, name: str
) -> None:
    reference = np.loadtxt(data / f"cpg_{name}.csv", delimiter=",", skiprows=1)
    gait = load_gait(data / f"{name}.json", oscillators=4)
    times, output = listing_samples(scenario.cpg, gait, oscillators=4, duration=15.0)
    rows = np.round(reference[:, 0] / scenario.cpg.listing_step).astype(int)
    np.testing.assert_allclose(times[rows], reference[:, 0], atol=1e-12)
    np.testing.assert_allclose(output[rows], reference[:, 1:], rtol=0, atol=1e-9)


def test_weights_stand_in_the_listings_order() -> None:
    # B.2: sum(1) takes w(1) y(3), w(2) y(5), w(3) y(7) and the partner y(2); sum(2) takes
    # w(4) y(4) ...; sum(8) takes w(22) y(2), w(23) y(4), w(24) y(6).
    matrix = inhibition_matrix(np.arange(1.0, 25.0), oscillators=4, partner_weight=1.5)
    assert matrix[0].tolist() == [0, 1.5, 1, 0, 2, 0, 3, 0]
    assert matrix[1].tolist() == [1.5, 0, 0, 4, 0, 5, 0, 6]
    assert matrix[7].tolist() == [0, 22, 0, 23, 0, 24, 1.5, 0]


def test_rates_are_those_of_equation_7() -> None:
    # One oscillator by hand: u = (0.4, -0.2), v = (0.1, 0.3), f = (0.05, 0), w_partner = 1.5,
    # beta = 2.5, u0 = 0.5, tau_A = 0.25 s, tau_B = 0.5 s; y = (0.4, 0).
    #   du_e = (-0.4 - 1.5*0   - 2.5*0.1 + 0.5 + 0.05)/0.25 = -0.4
    #   du_f = ( 0.2 - 1.5*0.4 - 2.5*0.3 + 0.5       )/0.25 = -2.6
    #   dv_e = (0.4 - 0.1)/0.5 = 0.6,  dv_f = (0 - 0.3)/0.5 = -0.6
    u_rate, v_rate = np.empty(2), np.empty(2)
    neuron_rates(
        np.array([0.4, -0.2]),
        np.array([0.1, 0.3]),
        np.array([0.05, 0.0]),
        np.array([[0.0, 1.5], [1.5, 0.0]]),
        0.25,
        0.5,
        2.5,
        0.5,
        u_rate,
        v_rate,
    )
    np.testing.assert_allclose(u_rate, [-0.4, -2.6], rtol=1e-14)
    np.testing.assert_allclose(v_rate, [0.6, -0.6], rtol=1e-14)


def test_the_network_rests_where_all_neurons_agree() -> None:
    # With u = v = y = r for all neurons, Eq. 7 and its -u term give
    # r (1 + 1.5 + 3 w + beta) = u0 for four oscillators with equal weights w.
    weight, beta, u0 = 2.0, 2.5, 0.5
    r = u0 / (1.0 + 1.5 + 3.0 * weight + beta)
    inhibition = inhibition_matrix(np.full(24, weight), oscillators=4, partner_weight=1.5)
    u_rate, v_rate = np.empty(8), np.empty(8)
    u = np.full(8, r)
    neuron_rates(u, u, np.zeros(8), inhibition, 0.3, 0.6, beta, u0, u_rate, v_rate)
    np.testing.assert_allclose([u_rate, v_rate], 0.0, atol=1e-15)


def test_output_counts_only_firing_neurons() -> None:
    output = np.empty(2)
    oscillator_output(np.array([0.4, -0.3, -0.1, 0.2]), output)
    assert output.tolist() == [0.4, -0.2]
