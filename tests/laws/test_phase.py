"""Phase oscillators: locking, frequency, amplitudes and entrainment in closed form."""

import math

import numpy as np
import pytest

from tetra_drake.kernels.lanes import sine
from tetra_drake.kernels.packed import Packed
from tetra_drake.laws.oscillator import Oscillators, make_states, write_outputs
from tetra_drake.laws.phase import PhaseConstants, PhaseOscillators
from tetra_drake.robot.parameter_space import ParameterSpace, seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.signals import DrivenRobot

OMEGA, STEP = math.tau * 0.8, 1e-3


def motion(states, *, lag=(0.0, 0.0), coupling=0.0, amplitude=1.0, settling=20.0, inputs=None):
    """Phases, and amplitudes with their rates, (times, oscillators) each, from initial states."""
    count = len(states) // 3
    law = PhaseConstants(
        frequency=np.full(count, OMEGA),
        amplitude=np.full(count, amplitude),
        lag=np.array(lag[:count]),
        coupling=np.array([0.0, coupling])[:count],
        settling=np.full(count, settling),
    )
    start = np.array(states, dtype=float)
    oscillators = Oscillators(PhaseOscillators.own, law, start, gains=np.zeros(3))
    table = make_states(oscillators)
    parts, found = Packed((oscillators, table)), [start]
    for row in np.ones((2000, 2 * count)) if inputs is None else inputs:
        write_outputs(parts, row[np.newaxis], STEP, False, np.empty((1, count)))
        found.append(table[:, 0].copy())
    return np.split(np.array(found), 3, axis=1)


TIMES = STEP * np.arange(2001)


def test_phases_lock_to_the_lag():
    """With equal frequencies and amplitudes r the difference d from the lag has the rate
    -2 w r sin d, so tan(d / 2) decays with exp(-2 w r t)."""
    lag, w, r, start = 0.7, 3.0, 0.6, 2.0
    phases, *_ = motion([lag + start, 0.0, r, r, 0.0, 0.0], lag=(0.0, lag), coupling=w, amplitude=r)
    expected = 2.0 * np.arctan(math.tan(0.5 * start) * np.exp(-2.0 * w * r * TIMES))
    np.testing.assert_allclose(phases[:, 0] - phases[:, 1] - lag, expected, atol=1e-9)
    # Neither pulls more than the other, so together they keep their frequency.
    np.testing.assert_allclose(phases.sum(axis=1), 2.0 * OMEGA * TIMES + lag + start, atol=1e-9)


@pytest.mark.parametrize("settling", [5.0, 40.0])
def test_amplitudes_settle_as_a_critically_damped_spring(settling):
    _, r, rate = motion([0.0, 0.0, 0.0], amplitude=0.8, settling=settling)
    x = 0.5 * settling * TIMES
    np.testing.assert_allclose(r[:, 0], 0.8 * (1.0 - (1.0 + x) * np.exp(-x)), atol=1e-8)
    np.testing.assert_allclose(rate[:, 0], 0.4 * settling * x * np.exp(-x), atol=1e-6)


def test_excitation_scales_the_amplitude_and_leaves_the_frequency():
    phases, r, _ = motion([0.0, 1.0, 0.0], inputs=np.tile([1.3, 1.3], (2000, 1)))
    assert r[-1, 0] == pytest.approx(1.3, rel=1e-6)
    np.testing.assert_allclose(phases[:, 0], OMEGA * TIMES, atol=1e-9)


PUSH = 0.1


def pushed(detuning: float) -> np.ndarray:
    """Phase behind a push of 10 % whose frequency is lower by a share `detuning`."""
    times = STEP * np.arange(60_000)
    push = PUSH * np.cos(OMEGA * (1.0 - detuning) * times)
    phases, *_ = motion([0.0, 1.0, 0.0], inputs=1.0 + np.outer(push, [1.0, -1.0]))
    return phases[:-1, 0] - OMEGA * (1.0 - detuning) * times


@pytest.mark.parametrize("detuning", [-0.03, 0.0, 0.03])
def test_a_push_entrains_frequencies_within_half_its_size(detuning):
    """Averaged over a period, the phase psi ahead of the push has the rate
    omega (detuning - push / 2 sin psi) (Adler's equation)."""
    late = pushed(detuning)[-20_000:]
    assert late.mean() == pytest.approx(math.asin(2.0 * detuning / PUSH), abs=0.02)
    assert np.ptp(late) < 0.12, "it only trembles"


def test_a_push_beats_with_frequencies_beyond():
    """The phase slips at the mean rate omega sqrt(detuning^2 - (push / 2)^2)."""
    psi = pushed(0.1)
    rate = (psi[-1] - psi[20_000]) / (STEP * (len(psi) - 1 - 20_000))
    assert rate == pytest.approx(OMEGA * math.sqrt(0.1**2 - 0.05**2), rel=0.06)


def test_the_sine_is_exact_for_numbers_of_any_size():
    x = np.random.default_rng(0).uniform(-1e4, 1e4, 1000)
    np.testing.assert_allclose([sine(each) for each in x.tolist()], np.sin(x), atol=1e-15)


SINE = "!Phase {gain: 2 N, amplitude: [1, 1], coupling: [5 1/s, 5 1/s], common: [lag]}"


ERRORS = {"live": 2e-5, "listing": 5e-3}
"""Errors (N) of interpolation, and of the listing's Euler steps."""


@pytest.mark.parametrize("signals", ERRORS)
def test_with_common_lags_a_gait_is_a_travelling_sine_of_two_numbers(scenario, signals):
    changes = {"cpg": SINE, "cpg.signals": signals, "simulation.duration": "6 s"}
    scenario = scenario.with_changes(changes)
    space = ParameterSpace.of(scenario)
    free = [name for name, row in zip(space.names, space.low < space.high, strict=True) if row]
    assert free == ["frequency", "lag 1->2"]
    gait = seeded_gait(scenario, 3)
    f, lag = gait.parameters["frequency"], gait.parameters["lag 1->2"]
    assert {gait.parameters[f"lag {k}->{k + 1}"] for k in (1, 2, 3)} == {lag}
    times = np.arange(3.0, 5.99, 0.01)
    phases = math.tau * f * (times[:, np.newaxis] - 1.25) - lag * np.arange(4)
    found = DrivenRobot.of(Robot.of(scenario), gait).signals_at(times)
    np.testing.assert_allclose(found, 2.0 * np.sin(phases), atol=ERRORS[signals])
