"""The actuation signals of a gait, computed before the robot is simulated.

Without feedback the network does not depend on the robot, so it can be integrated alone and
its output fed to the cables as a recording, as the thesis does.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.trajectories import PiecewisePolynomial

from tetra_drake.files import whole_file
from tetra_drake.physics.oscillator import inhibition_matrix, listing_output, network_output
from tetra_drake.robot.gait import Gait
from tetra_drake.scenario.schema import CpgScenario, Scenario
from tetra_drake.scenario.units import POUND_FORCE
from tetra_drake.systems.matsuoka_cpg import MatsuokaCpg, initial_state

_ACCURACY = 1e-7
_KNOT_SPACING = 1e-3  # s; between knots the signal deviates from its chord by about 1e-5 N


def listing_samples(
    cpg: CpgScenario, gait: Gait, *, oscillators: int, duration: float
) -> tuple[np.ndarray, np.ndarray]:
    """Times (s) and raw y_extensor - y_flexor (samples, n) as the thesis's listing B has them.

    Forward Euler; the state after i + 1 steps is stamped with the time of i steps.
    """
    count = round(duration / cpg.listing_step)
    state = initial_state(cpg, oscillators)
    output = np.empty((count, oscillators))
    listing_output(
        state[: 2 * oscillators].copy(),
        state[2 * oscillators :].copy(),
        *_network(cpg, gait, oscillators),
        output,
    )
    return np.arange(count) * cpg.listing_step, output


def _network(
    cpg: CpgScenario, gait: Gait, oscillators: int
) -> tuple[np.ndarray, float, float, float, float, float]:
    """The network's constants as the kernels that step it take them."""
    weights = np.array(gait.weights)
    matrix = inhibition_matrix(weights, oscillators=oscillators, partner_weight=cpg.partner_weight)
    beta, u0 = cpg.self_inhibition_weight, cpg.external_input
    return matrix, gait.tau_a, gait.tau_b, beta, u0, cpg.listing_step


def integrate_network(
    cpg: CpgScenario, gait: Gait, *, oscillators: int, duration: float
) -> PiecewisePolynomial:
    """The state (4n) of the network over time, integrated by Drake with error control."""
    simulator = Simulator(MatsuokaCpg(cpg, gait, oscillators=oscillators))
    integrator = ResetIntegratorFromFlags(simulator, "runge_kutta3", 0.05)
    integrator.set_target_accuracy(_ACCURACY)
    simulator.Initialize()
    integrator.StartDenseIntegration()
    simulator.AdvanceTo(duration)
    return integrator.StopDenseIntegration()


def recorded_samples(
    cpg: CpgScenario, gait: Gait, *, oscillators: int, duration: float
) -> tuple[np.ndarray, np.ndarray]:
    """Times (s) and raw y_extensor - y_flexor (samples, n) of the network integrated with
    error control: knots of a piecewise linear function, with one at every kink (a neuron's
    onset or end of firing)."""
    states = integrate_network(cpg, gait, oscillators=oscillators, duration=duration)
    neurons = 2 * oscillators
    times = np.linspace(0.0, duration, round(duration / _KNOT_SPACING) + 1)
    u = states.vector_values(times)[:neurons]
    neuron, knot = np.nonzero(u[:, :-1] * u[:, 1:] < 0.0)
    fraction = u[neuron, knot] / (u[neuron, knot] - u[neuron, knot + 1])
    kinks = times[knot] + fraction * (times[knot + 1] - times[knot])
    times = np.union1d(times, kinks)
    y = np.maximum(0.0, states.vector_values(times)[:neurons])
    return times, (y[0::2] - y[1::2]).T


def signal_trajectory(
    cpg: CpgScenario, gait: Gait, *, oscillators: int, duration: float
) -> PiecewisePolynomial:
    """The signals (n) in N over time, piecewise linear, from the source `cpg.signals` names."""
    samples = listing_samples if cpg.signals == "listing" else recorded_samples
    times, raw = samples(cpg, gait, oscillators=oscillators, duration=duration)
    if times[-1] < duration:  # the listing's last sample is stamped one step early
        times, raw = np.append(times, duration), np.vstack([raw, raw[-1:]])
    return PiecewisePolynomial.FirstOrderHold(times, cpg.gain * raw.T)


def even_samples(scenario: Scenario, gait: Gait) -> np.ndarray:
    """The signals (samples, n) in N at 0, one listing step, two ... to beyond the duration.

    Those of `cpg.signals`; for `recorded` and `live` the network is stepped by a Runge-Kutta
    method of order 4, whose error is 1e-5 of the signals.
    """
    cpg, oscillators = scenario.cpg, scenario.oscillators
    duration = scenario.simulation.duration
    if cpg.signals == "listing":
        _, raw = listing_samples(cpg, gait, oscillators=oscillators, duration=duration)
    else:
        raw = np.empty((math.ceil(duration / cpg.listing_step) + 1, oscillators))
        state = initial_state(cpg, oscillators)
        network_output(
            state[: 2 * oscillators].copy(),
            state[2 * oscillators :].copy(),
            *_network(cpg, gait, oscillators),
            raw,
        )
    return cpg.gain * np.vstack([raw, raw[-1:], raw[-1:]])


def save_signals(
    path: str | Path, scenario: Scenario, gait: Gait, *, raw: bool, listing: bool
) -> None:
    """Writes the signals of a gait as CSV: time_s, signal_1 ... signal_n, each listing step.

    In lbf, with gain and start-up applied; or `raw`, y_extensor - y_flexor without either.
    `listing` steps the network as the thesis does instead of integrating it with error control.
    """
    cpg, oscillators = scenario.cpg, scenario.oscillators
    duration = scenario.simulation.duration
    if listing:
        times, signals = listing_samples(cpg, gait, oscillators=oscillators, duration=duration)
    else:
        states = integrate_network(cpg, gait, oscillators=oscillators, duration=duration)
        times = np.arange(round(duration / cpg.listing_step) + 1) * cpg.listing_step
        y = np.maximum(0.0, states.vector_values(times)[: 2 * oscillators])
        signals = (y[0::2] - y[1::2]).T
    if not raw:
        signals = np.where(times[:, None] < cpg.start_up, 0.0, signals * cpg.gain / POUND_FORCE)
    header = ",".join(["time_s", *(f"signal_{i + 1}" for i in range(oscillators))])
    with whole_file(path) as temporary:
        rows = np.column_stack([times, signals])
        np.savetxt(temporary, rows, delimiter=",", header=header, comments="", fmt="%.12g")
