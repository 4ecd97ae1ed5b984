"""The Matsuoka network (Eq. 7-9): 2n neurons, of which neurons 2k and 2k + 1 (counting from
0) are the extensor and the flexor of oscillator k."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tetra_drake.physics.compiling import compiled

Array = np.ndarray


class Network(NamedTuple):
    """The constants of a network of n oscillators."""

    inhibition: Array
    """(2n, 2n): see inhibition_matrix."""
    tau_a: float
    tau_b: float
    """In s."""
    self_inhibition_weight: float
    external_input: float


def inhibition_matrix(weights: Array, *, oscillators: int, partner_weight: float) -> Array:
    """The (2n, 2n) matrix W of inhibition: W[i, j] of neuron i by neuron j.

    `weights`, 2 n (n - 1) of them, come in the listing's order (B.2): onto each neuron in
    turn, from the neurons of its own kind in turn. Partners inhibit each other by
    `partner_weight`.
    """
    neurons = 2 * oscillators
    matrix = np.zeros((neurons, neurons))
    remaining = iter(np.asarray(weights, dtype=float))
    for i in range(neurons):
        matrix[i, i ^ 1] = partner_weight
        for j in range(i % 2, neurons, 2):
            if j != i:
                matrix[i, j] = next(remaining)
    return matrix


@compiled
def neuron_rates(
    network: Network, u: Array, v: Array, feedback: Array, u_rate: Array, v_rate: Array
) -> None:
    """Rates of the inner states u and the self-inhibitions v (Eq. 7; -u as in listing B.2).

    All arrays (2n,); `u_rate` and `v_rate` are written, in 1/s.
    """
    neurons = u.size
    for i in range(neurons):
        total = network.external_input + feedback[i] - u[i] - network.self_inhibition_weight * v[i]
        for j in range(neurons):
            total -= network.inhibition[i, j] * max(0.0, u[j])
        u_rate[i] = total / network.tau_a
        v_rate[i] = (max(0.0, u[i]) - v[i]) / network.tau_b


@compiled
def oscillator_output(u: Array, output: Array) -> None:
    """y_extensor - y_flexor (n,) of each oscillator, y = max(0, u) (Eq. 8 and 9)."""
    for k in range(output.size):
        output[k] = max(0.0, u[2 * k]) - max(0.0, u[2 * k + 1])


@compiled
def listing_output(network: Network, u: Array, v: Array, step: float, output: Array) -> None:
    """Writes `output`, (steps, n), as listing B.1 does: forward Euler from u and v (2n,).

    Row i is the state after i + 1 steps (s); the listing stamps it with i steps. `u` and `v` end
    as the last state.
    """
    u_rate, v_rate, feedback = np.empty_like(u), np.empty_like(v), np.zeros_like(u)
    for i in range(output.shape[0]):
        neuron_rates(network, u, v, feedback, u_rate, v_rate)
        u += u_rate * step
        v += v_rate * step
        oscillator_output(u, output[i])


@compiled
def network_output(network: Network, u: Array, v: Array, step: float, output: Array) -> None:
    """As `listing_output` by the classical Runge-Kutta method of order 4; row i after i steps."""
    neurons = u.size
    weights = (1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0)
    reaches = (0.0, 0.5, 0.5, 1.0)
    feedback = np.zeros(neurons)
    u_rate, v_rate = np.zeros(neurons), np.zeros(neurons)
    for i in range(output.shape[0]):
        oscillator_output(u, output[i])
        u_sum, v_sum = np.zeros(neurons), np.zeros(neurons)
        for stage in range(4):
            reach = reaches[stage] * step
            neuron_rates(network, u + reach * u_rate, v + reach * v_rate, feedback, u_rate, v_rate)
            u_sum += weights[stage] * u_rate
            v_sum += weights[stage] * v_rate
        u += step * u_sum
        v += step * v_sum
