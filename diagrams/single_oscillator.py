"""One neural oscillator: what the weight between its two neurons (thesis Fig. 10) and the
ratio of its time constants (Fig. 9) make of its signal.

Writes the block diagram and the figures, and prints the frequency beside the thesis's.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from tetra_drake import thesis
from tetra_drake.errors import InputError
from tetra_drake.figures.block_diagram import save_block_diagram
from tetra_drake.figures.oscillators import figure_09_time_constants, figure_10_weights
from tetra_drake.figures.style import save_figure
from tetra_drake.parts.single_oscillator import (
    SINE_WEIGHT,
    TAU_A,
    MakeOscillatorDiagram,
    Oscillation,
    frequency,
    linear_frequency,
    oscillations_by_factor,
    oscillations_by_weight,
    peak_to_peak,
)
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.units import POUND_FORCE


def report(scenario: Scenario, oscillation: Oscillation) -> str:
    """The thesis's choice in numbers, the thesis's beside ours."""
    hertz = thesis.OSCILLATOR_FREQUENCY_HZ
    ours, linear = frequency(oscillation), linear_frequency(scenario)
    pounds = peak_to_peak(oscillation) / POUND_FORCE
    return (
        f"frequency at tau_A = {TAU_A:g} s: {ours:.3f} Hz (linear theory: {linear:.3f} Hz; "
        f"thesis: about {hertz:g} Hz, which needs tau_A = {TAU_A * ours / hertz:.3f} s)\n"
        f"peak to peak: {pounds:.2f} lbf (thesis: twice the external input, or one pound)"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Writes the pictures and prints the numbers."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path(__file__).parent)
    options = parser.parse_args(arguments)
    scenario = load_scenario("thesis")
    by_weight = oscillations_by_weight(scenario)
    by_factor = oscillations_by_factor(scenario)
    try:
        save_block_diagram(MakeOscillatorDiagram(scenario), options.out / "single_oscillator.svg")
        save_figure(figure_09_time_constants(by_factor), options.out, "figure_09", kinds=["svg"])
        save_figure(figure_10_weights(by_weight), options.out, "figure_10", kinds=["svg"])
    except InputError as error:
        parser.error(str(error))
    print(report(scenario, by_weight[SINE_WEIGHT]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
