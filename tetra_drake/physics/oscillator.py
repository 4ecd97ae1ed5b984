"""The Matsuoka network (Eq. 7-9): 2n neurons, of which neurons 2k and 2k + 1 (counting from
0) are the extensor and the flexor of oscillator k."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tetra_drake.physics.compiling import compiled
from tetra_drake.physics.lanes import Real, Table, maximum

Array = np.ndarray

U, V, U_RATE, V_RATE, Y, U_START, V_START, U_SUM, V_SUM, NEURON_COLUMNS = range(10)
"""Columns of `neurons`, (2n, 9): inner state u, self-inhibition v, their rates in 1/s, and what the
kernels note besides; and their number."""


class Network(NamedTuple):
    """The constants of a network of n oscillators."""

    inhibition: Table
    """(2n, 2n): see inhibition_matrix."""
    tau_a: Real
    tau_b: Real
    """In s."""
    self_inhibition_weight: Real
    external_input: Real


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


def make_neurons(state: Array) -> Array:
    """The `neurons` of a state (4n,): u, then v, of all neurons."""
    neurons = np.zeros((state.size // 2, NEURON_COLUMNS))
    neurons[:, U], neurons[:, V] = state.reshape(2, -1)
    return neurons


@compiled
def neuron_rates(network: Network, feedback: Table, neurons: Table) -> None:
    """Writes the rates of u and v (Eq. 7; -u as in listing B.2); `feedback` is (2n,)."""
    count = neurons.shape[0]
    per_tau_a, per_tau_b = 1.0 / network.tau_a, 1.0 / network.tau_b
    for i in range(count):
        neurons[i, Y] = maximum(neurons[i, U], 0.0)
    for i in range(count):
        u, v, y = neurons[i, U], neurons[i, V], neurons[i, Y]
        total = network.external_input + feedback[i] - u - network.self_inhibition_weight * v
        for j in range(count):
            total -= network.inhibition[i, j] * neurons[j, Y]
        neurons[i, U_RATE] = total * per_tau_a
        neurons[i, V_RATE] = (y - v) * per_tau_b


@compiled
def oscillator_output(neurons: Table, output: Table) -> None:
    """y_extensor - y_flexor (n,) of each oscillator, y = max(0, u) (Eq. 8 and 9)."""
    for k in range(output.size):
        extensor, flexor = neurons[2 * k, U], neurons[2 * k + 1, U]
        output[k] = maximum(extensor, 0.0) - maximum(flexor, 0.0)


@compiled
def euler_step(network: Network, feedback: Table, step: Real, neurons: Table) -> None:
    """A step (s) of the forward Euler method, as in listing B.1."""
    neuron_rates(network, feedback, neurons)
    for i in range(neurons.shape[0]):
        neurons[i, U] += step * neurons[i, U_RATE]
        neurons[i, V] += step * neurons[i, V_RATE]


@compiled
def runge_kutta_step(network: Network, feedback: Table, step: Real, neurons: Table) -> None:
    """A step (s) of the classical Runge-Kutta method of order 4."""
    for i in range(neurons.shape[0]):
        neurons[i, U_START], neurons[i, V_START] = neurons[i, U], neurons[i, V]
        neurons[i, U_SUM], neurons[i, V_SUM] = 0.0, 0.0
    for stage in range(4):
        weight = (1.0 if stage == 0 or stage == 3 else 2.0) / 6.0
        reach = 1.0 if stage == 2 else 0.5  # where the next stage begins
        neuron_rates(network, feedback, neurons)
        for i in range(neurons.shape[0]):
            neurons[i, U_SUM] += weight * neurons[i, U_RATE]
            neurons[i, V_SUM] += weight * neurons[i, V_RATE]
            neurons[i, U] = neurons[i, U_START] + reach * step * neurons[i, U_RATE]
            neurons[i, V] = neurons[i, V_START] + reach * step * neurons[i, V_RATE]
    for i in range(neurons.shape[0]):
        neurons[i, U] = neurons[i, U_START] + step * neurons[i, U_SUM]
        neurons[i, V] = neurons[i, V_START] + step * neurons[i, V_SUM]


@compiled
def next_output(
    network: Network, feedback: Table, step: Real, listing: bool, neurons: Table, output: Table
) -> None:
    """The next sample of the outputs (n,), a step (s) after the last.

    With `listing`, by forward Euler and after the step: listing B.1 stamps the state after i + 1
    steps with the time of i. Otherwise by Runge-Kutta and before the step. A step of 0 changes
    nothing.
    """
    if listing:
        euler_step(network, feedback, step, neurons)
        oscillator_output(neurons, output)
    else:
        oscillator_output(neurons, output)
        runge_kutta_step(network, feedback, step, neurons)


@compiled
def network_output(
    network: Network, feedback: Array, step: float, listing: bool, neurons: Array, output: Array
) -> None:
    """Writes `output`, (samples, n), the first samples of `next_output` without lanes."""
    for i in range(output.shape[0]):
        next_output(network, feedback, step, listing, neurons, output[i])
