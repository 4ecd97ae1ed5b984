"""The thesis's Figures 9 and 10: the signal of one oscillator."""

from __future__ import annotations

import math
from collections.abc import Mapping

from matplotlib.figure import Figure

from tetra_drake import thesis
from tetra_drake.figures.style import OKABE_ITO, common_style, make_figure
from tetra_drake.parts.single_oscillator import (
    SINE_WEIGHT,
    TAU_A,
    TRANSIENT,
    Oscillation,
    frequency,
    peak_to_peak,
)
from tetra_drake.scenario.units import POUND_FORCE


def figure_09_time_constants(by_factor: Mapping[float, Oscillation]) -> Figure:
    """What the ratio of the time constants makes of an oscillator's signal.

    The thesis's Fig. 9: signal in lbf over time in s, a panel for each tau_B / tau_A.
    """
    return _draw(
        {rf"$\tau_B = {factor:g}\,\tau_A$": signal for factor, signal in by_factor.items()},
        title=rf"Time constants of an oscillator (Fig. 9; $w = {SINE_WEIGHT:g}$, "
        rf"$\tau_A = {TAU_A:g}$ s)",
        note="thesis: like a sine for a factor of 2, not above it; falls to zero below it",
    )


def figure_10_weights(by_weight: Mapping[float, Oscillation]) -> Figure:
    """What the weight between extensor and flexor makes of an oscillator's signal.

    The thesis's Fig. 10: signal in lbf over time in s, a panel for each weight.
    """
    return _draw(
        {f"$w = {weight:g}$": signal for weight, signal in by_weight.items()},
        title=rf"Weights of an oscillator (Fig. 10; $\tau_A = {TAU_A:g}$ s, "
        rf"$\tau_B = {2 * TAU_A:g}$ s)",
        note=f"thesis, for w = {SINE_WEIGHT:g}: like a sine, about "
        f"{thesis.OSCILLATOR_FREQUENCY_HZ:g} Hz, one pound peak to peak",
    )


@common_style()
def _draw(oscillations: Mapping[str, Oscillation], *, title: str, note: str) -> Figure:
    rows = len(oscillations)
    figure, panels = make_figure(
        width_in=7.0, height_in=0.8 + 1.5 * rows, rows=rows, sharex=True, sharey=True
    )
    for panel, (label, oscillation) in zip(panels[:, 0], oscillations.items(), strict=True):
        panel.plot(
            oscillation.times,
            oscillation.signal / POUND_FORCE,
            color=OKABE_ITO["blue"],
            label=label,
        )
        panel.set_title(f"{label}: {_describe(oscillation)}")
        panel.set_ylabel("signal (lbf)")
    panels[-1, 0].set_xlabel("time (s)")
    figure.suptitle(f"{title}\n{note}")
    return figure


def _describe(oscillation: Oscillation) -> str:
    hertz = frequency(oscillation)
    swing = f"{peak_to_peak(oscillation) / POUND_FORCE:.2f} lbf peak to peak"
    oscillates = "no oscillation" if math.isnan(hertz) else f"{hertz:.2f} Hz"
    return f"{oscillates}, {swing} in the last {TRANSIENT:g} s"
