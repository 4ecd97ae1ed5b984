"""Figures 9 and 10."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from tetra_drake.figures.oscillators import figure_09_time_constants, figure_10_weights
from tetra_drake.parts.single_oscillator import Oscillation
from tetra_drake.scenario.units import POUND_FORCE

TIMES = np.linspace(0.0, 15.0, 1501)


def oscillation(*, hertz: float, pounds: float) -> Oscillation:
    """A sine of so many lbf from peak to peak."""
    signal = pounds * POUND_FORCE / 2.0 * np.sin(2.0 * np.pi * hertz * TIMES)
    return Oscillation(times=TIMES, signal=signal)


def check(panel: Axes, shown: Oscillation) -> None:
    [line] = panel.lines
    np.testing.assert_allclose(line.get_xdata(), shown.times)
    np.testing.assert_allclose(line.get_ydata(), shown.signal / POUND_FORCE)
    assert panel.get_ylabel() == "signal (lbf)"


def test_figure_9_has_a_panel_for_each_factor() -> None:
    by_factor = {1.5: oscillation(hertz=1.0, pounds=0.1), 3.0: oscillation(hertz=0.5, pounds=0.9)}
    figure = figure_09_time_constants(by_factor)
    for panel, shown in zip(figure.axes, by_factor.values(), strict=True):
        check(panel, shown)
    titles = [panel.get_title() for panel in figure.axes]
    assert "1.5" in titles[0] and "1.00 Hz, 0.10 lbf peak to peak" in titles[0]
    assert "3" in titles[1] and "0.50 Hz, 0.90 lbf peak to peak" in titles[1]
    assert figure.axes[-1].get_xlabel() == "time (s)"
    assert figure.axes[0].get_ylim() == figure.axes[1].get_ylim()


def test_figure_10_has_a_panel_for_each_weight_and_the_thesis_beside_ours() -> None:
    by_weight = {1.5: oscillation(hertz=0.5, pounds=0.7), 2.0: oscillation(hertz=0.4, pounds=0.9)}
    figure = figure_10_weights(by_weight)
    for panel, shown, weight in zip(figure.axes, by_weight.values(), ("1.5", "2"), strict=True):
        check(panel, shown)
        assert panel.get_title().startswith(f"$w = {weight}$")
    title = figure.get_suptitle()
    assert "about 0.7 Hz" in title and "one pound" in title


def test_a_silent_oscillator_has_no_frequency() -> None:
    [panel] = figure_10_weights({2.0: oscillation(hertz=1.0, pounds=0.0)}).axes
    assert "no oscillation, 0.00 lbf" in panel.get_title()
