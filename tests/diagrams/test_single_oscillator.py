"""One oscillator alone."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tetra_drake import thesis
from tetra_drake.parts.single_oscillator import (
    FACTORS,
    WEIGHTS,
    Oscillation,
    frequency,
    linear_frequency,
    oscillate,
    oscillations_by_factor,
    oscillations_by_weight,
    peak_to_peak,
)
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.units import POUND_FORCE

# With d = u1 - u2 and e = v1 - v2 while both neurons fire, Eq. 7 is
#   tau_A d' = (w - 1) d - beta e,   tau_B e' = d - e,
# whose characteristic equation is
#   tau_A tau_B s² + (tau_A - (w - 1) tau_B) s + beta + 1 - w = 0.
# w = 1.5 and tau_B = 2 tau_A cancel the damping; with beta = 2.5 that leaves omega = 1 / tau_A.


@pytest.mark.parametrize("tau_a", [0.2, 0.3, 0.5])
def test_frequency_is_that_of_the_linear_equations(scenario: Scenario, tau_a: float) -> None:
    measured = frequency(oscillate(scenario, tau_a=tau_a))
    assert measured == pytest.approx(1.0 / (2.0 * math.pi * tau_a), rel=2e-3)
    assert measured == pytest.approx(linear_frequency(scenario, tau_a=tau_a), rel=2e-3)


def test_the_thesis_frequency_lies_within_its_bounds(scenario: Scenario) -> None:
    # "approximately 0.7 Hertz" is not tau_A = 0.3 s (0.53 Hz), but a tau_A of Table 5.
    tau_a = 1.0 / (2.0 * math.pi * thesis.OSCILLATOR_FREQUENCY_HZ)
    assert scenario.gait_bounds.tau_a_min < tau_a < scenario.gait_bounds.tau_a_max
    measured = frequency(oscillate(scenario, tau_a=tau_a))
    assert measured == pytest.approx(thesis.OSCILLATOR_FREQUENCY_HZ, rel=2e-3)


def test_a_greater_weight_makes_it_slower_and_larger(scenario: Scenario) -> None:
    oscillations = oscillations_by_weight(scenario)
    assert tuple(oscillations) == WEIGHTS
    light, heavy = oscillations.values()
    assert frequency(heavy) / frequency(light) == pytest.approx(0.83, abs=0.02)
    assert peak_to_peak(heavy) > 1.2 * peak_to_peak(light)


def test_only_a_time_constant_factor_below_two_dies_out(scenario: Scenario) -> None:
    oscillations = oscillations_by_factor(scenario)
    assert tuple(oscillations) == FACTORS
    dying, sine, growing = (peak_to_peak(o) / POUND_FORCE for o in oscillations.values())
    assert dying < 0.1
    assert 0.7 < sine < growing < 1.0


def test_no_crossings_no_frequency() -> None:
    silent = Oscillation(times=np.linspace(0.0, 15.0, 100), signal=np.zeros(100))
    assert math.isnan(frequency(silent))
