"""One oscillator alone, against the linear theory of its neurons."""

import math

import pytest
from single_oscillator import (
    THESIS_FREQUENCY,
    frequency_and_swing,
    linear_frequency,
    make_diagram,
    simulate,
)


def oscillation(scenario, **parameters):
    return frequency_and_swing(*simulate(make_diagram(scenario, **parameters), duration=25.0))


@pytest.mark.parametrize("tau_a", [0.3, 1.0 / (2.0 * math.pi * THESIS_FREQUENCY)])
def test_without_damping_it_is_a_sine_of_known_frequency(scenario, tau_a):
    theory = linear_frequency(scenario, tau_a=tau_a)
    assert theory == pytest.approx(1.0 / (2.0 * math.pi * tau_a))
    frequency, swing = oscillation(scenario, tau_a=tau_a)
    assert frequency == pytest.approx(theory, rel=5e-3)
    assert swing == pytest.approx(0.727, abs=0.01)
    assert scenario.gait_bounds.tau_a_min <= tau_a <= scenario.gait_bounds.tau_a_max


def test_weight_and_ratio_decide_between_dying_and_growing(scenario):
    (f0, sine), (heavy_f, heavy) = oscillation(scenario), oscillation(scenario, weight=2.0)
    assert heavy_f / f0 == pytest.approx(0.83, abs=0.02)
    assert heavy > 1.2 * sine
    (damped_f, damped), (_, growing) = (oscillation(scenario, ratio=r) for r in (1.5, 3.0))
    assert damped < 0.1
    assert damped_f == pytest.approx(linear_frequency(scenario, ratio=1.5), rel=2e-2)
    assert 0.7 < sine < growing < 1.0
