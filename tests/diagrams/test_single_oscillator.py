"""One oscillator alone, against the linear theory of its neurons."""

from __future__ import annotations

import math

import numpy as np
import pytest
from single_oscillator import (
    THESIS_FREQUENCY,
    TRANSIENT,
    draw,
    linear_frequency,
    make_diagram,
    simulate,
)

from tetra_drake.results.measures import dominant_frequency
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.units import POUND_FORCE


def oscillation(scenario: Scenario, **parameters: float) -> tuple[float, float]:
    """Frequency in Hz and swing in lbf, after the transient."""
    times, signal = simulate(make_diagram(scenario, **parameters), duration=25.0)
    late = times > TRANSIENT
    end = times > times[-1] - TRANSIENT
    return dominant_frequency(times[late], signal[late]), float(np.ptp(signal[end])) / POUND_FORCE


@pytest.mark.parametrize("tau_a", [0.2, 0.3, 0.5])
def test_the_undamped_oscillator_is_a_sine_of_known_frequency(
    scenario: Scenario, tau_a: float
) -> None:
    assert linear_frequency(scenario, tau_a=tau_a) == pytest.approx(1 / (2 * math.pi * tau_a))
    frequency, swing = oscillation(scenario, tau_a=tau_a)
    assert frequency == pytest.approx(linear_frequency(scenario, tau_a=tau_a), rel=5e-3)
    assert swing == pytest.approx(0.727, abs=0.01)  # whatever the time constant


def test_the_thesis_frequency_is_that_of_a_time_constant_within_its_bounds(
    scenario: Scenario,
) -> None:
    tau_a = 1.0 / (2.0 * math.pi * THESIS_FREQUENCY)  # not the 0.3 s of its figures
    assert scenario.gait_bounds.tau_a_min < tau_a < scenario.gait_bounds.tau_a_max
    assert oscillation(scenario, tau_a=tau_a)[0] == pytest.approx(THESIS_FREQUENCY, rel=5e-3)


def test_weight_and_ratio_decide_between_dying_and_growing(scenario: Scenario) -> None:
    (f0, sine), (heavy_f, heavy) = oscillation(scenario), oscillation(scenario, weight=2.0)
    assert heavy_f / f0 == pytest.approx(0.83, abs=0.02)
    assert heavy > 1.2 * sine
    (damped_f, damped), (_, growing) = (oscillation(scenario, ratio=r) for r in (1.5, 3.0))
    assert damped < 0.1
    assert damped_f == pytest.approx(linear_frequency(scenario, ratio=1.5), rel=2e-2)
    assert 0.7 < sine < growing < 1.0


def test_a_panel_per_signal() -> None:
    times = np.linspace(0.0, 15.0, 1501)
    signals = {
        label: (times, hertz * np.sin(2 * np.pi * hertz * times))
        for label, hertz in (("a", 1.0), ("b", 0.5))
    }
    figure = draw(signals, "title")
    for panel, (label, (_, signal)) in zip(figure.axes, signals.items(), strict=True):
        np.testing.assert_allclose(panel.lines[0].get_ydata(), signal / POUND_FORCE)
        assert panel.get_title().startswith(label)
    assert "1.00 Hz" in figure.axes[0].get_title()
