"""One neural oscillator: what the weight between its two neurons (thesis Fig. 10) and the
ratio of its time constants (Fig. 9) make of its signal.

Writes the block diagram and the figure, and prints the frequency beside the thesis's.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput

from tetra_drake import thesis
from tetra_drake.errors import InputError
from tetra_drake.figures.block_diagram import save_block_diagram
from tetra_drake.files import whole_file
from tetra_drake.gait import Gait
from tetra_drake.scenario import Scenario, load_scenario
from tetra_drake.simulation import MakeSimulator
from tetra_drake.systems import MatsuokaCpg
from tetra_drake.units import POUND_FORCE

TAU_A = 0.3
"""s, as in the thesis's figures."""

WEIGHTS = (1.5, 2.0)
"""Of the inhibition between extensor and flexor (Fig. 10), with tau_B = 2 tau_A."""

FACTORS = (1.5, 2.0, 3.0)
"""tau_B / tau_A (Fig. 9), with a weight of 1.5."""

DURATION = 15.0  # s
TRANSIENT = 5.0  # s; what comes before does not count as the oscillation's shape


@dataclass(frozen=True)
class Oscillation:
    """A recorded signal: times (samples,) in s and signal (samples,) in N."""

    times: np.ndarray
    signal: np.ndarray


def MakeOscillatorDiagram(
    scenario: Scenario, *, partner_weight: float, tau_a: float, tau_b: float
) -> Diagram:
    """A network of one oscillator, and a log of its signal.

    Subsystems: cpg, signals_log. Time constants in s.
    """
    builder = DiagramBuilder()
    cpg = dataclasses.replace(scenario.cpg, partner_weight=partner_weight)
    gait = Gait(name="single oscillator", weights=(), tau_a=tau_a, tau_b=tau_b)
    oscillator = builder.AddNamedSystem("cpg", MatsuokaCpg(cpg, gait, oscillators=1))
    LogVectorOutput(oscillator.GetOutputPort("signals"), builder).set_name("signals_log")
    diagram = builder.Build()
    diagram.set_name("single_oscillator")
    return diagram


def simulate(
    scenario: Scenario,
    *,
    partner_weight: float,
    tau_a: float,
    tau_b: float,
    duration: float = DURATION,
) -> Oscillation:
    """The signal of one oscillator from rest; times in s."""
    diagram = MakeOscillatorDiagram(
        scenario, partner_weight=partner_weight, tau_a=tau_a, tau_b=tau_b
    )
    settings = dataclasses.replace(
        scenario.simulation,
        scheme="runge_kutta3",
        accuracy=1e-6,
        max_step=0.01,
        mode_changes="step_end",
    )
    simulator = MakeSimulator(diagram, settings)
    simulator.AdvanceTo(duration)
    log = diagram.GetSubsystemByName("signals_log").FindLog(simulator.get_context())
    return Oscillation(times=log.sample_times(), signal=log.data()[0])


def frequency(oscillation: Oscillation) -> float:
    """In Hz, from the upward zero crossings after the transient; nan if there are not two."""
    late = oscillation.times >= TRANSIENT
    t, y = oscillation.times[late], oscillation.signal[late]
    i = np.flatnonzero((y[:-1] < 0.0) & (y[1:] >= 0.0))
    crossings = t[i] - y[i] * (t[i + 1] - t[i]) / (y[i + 1] - y[i])
    return float(1.0 / np.diff(crossings).mean()) if crossings.size > 1 else math.nan


def peak_to_peak(oscillation: Oscillation) -> float:
    """In N, over the last TRANSIENT seconds: what the oscillation has come to."""
    late = oscillation.times >= oscillation.times[-1] - TRANSIENT
    return float(np.ptp(oscillation.signal[late]))


def linear_frequency(
    scenario: Scenario, *, partner_weight: float, tau_a: float, tau_b: float
) -> float:
    """In Hz, of Eq. 7 while both neurons fire, when the equations are linear.

    The differences d of the two u and e of the two v then follow
    tau_A d' = (w - 1) d - beta e and tau_B e' = d - e. That is an undamped oscillation where
    tau_B / tau_A = 1 / (w - 1), which is the thesis's choice of 2 with w = 1.5; a
    smaller ratio damps it, a greater one lets it grow until neurons fall silent.
    """
    squared = (scenario.cpg.self_inhibition_weight + 1.0 - partner_weight) / (tau_a * tau_b)
    damping = (1.0 / tau_b - (partner_weight - 1.0) / tau_a) / 2.0
    return math.sqrt(squared - damping**2) / (2.0 * math.pi)


def draw(by_weight: dict[float, Oscillation], by_factor: dict[float, Oscillation]) -> Figure:
    """One panel an oscillation: Fig. 10 on the left, Fig. 9 on the right."""
    with style.context("tableau-colorblind10"):
        figure = Figure(figsize=(10, 5.5), layout="constrained")
        left, right = figure.subfigures(1, 2, squeeze=False)[0]
        left.suptitle(rf"Weight (Fig. 10; $\tau_A = {TAU_A:g}$ s, $\tau_B = {2 * TAU_A:g}$ s)")
        _draw_column(left, {f"$w = {w:g}$": signal for w, signal in by_weight.items()})
        right.suptitle(rf"Time constants (Fig. 9; $\tau_A = {TAU_A:g}$ s, $w = 1.5$)")
        _draw_column(right, {rf"$\tau_B = {f:g}\,\tau_A$": s for f, s in by_factor.items()})
    return figure


def _draw_column(figure: SubFigure, oscillations: dict[str, Oscillation]) -> None:
    panels = figure.subplots(len(oscillations), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    for panel, (label, oscillation) in zip(panels, oscillations.items(), strict=True):
        _draw_signal(panel, oscillation, label=label)
    panels[-1].set_xlabel("time (s)")


def _draw_signal(panel: Axes, oscillation: Oscillation, *, label: str) -> None:
    panel.plot(oscillation.times, oscillation.signal / POUND_FORCE)
    panel.set_title(
        f"{label}: {frequency(oscillation):.2f} Hz, "
        f"{peak_to_peak(oscillation) / POUND_FORCE:.2f} lbf peak to peak at the end",
        fontsize="medium",
    )
    panel.set_ylabel("signal (lbf)")
    panel.margins(x=0)
    panel.grid(alpha=0.4)


def report(oscillation: Oscillation, scenario: Scenario) -> str:
    """The thesis's choice in numbers, the thesis's beside ours."""
    hertz = thesis.OSCILLATOR_FREQUENCY_HZ
    ours = frequency(oscillation)
    linear = linear_frequency(scenario, partner_weight=1.5, tau_a=TAU_A, tau_b=2 * TAU_A)
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
    by_weight = {
        w: simulate(scenario, partner_weight=w, tau_a=TAU_A, tau_b=2 * TAU_A) for w in WEIGHTS
    }
    by_factor = {
        f: simulate(scenario, partner_weight=1.5, tau_a=TAU_A, tau_b=f * TAU_A) for f in FACTORS
    }
    diagram = MakeOscillatorDiagram(scenario, partner_weight=1.5, tau_a=TAU_A, tau_b=2 * TAU_A)
    try:
        save_block_diagram(diagram, options.out / "single_oscillator.svg")
        with whole_file(options.out / "single_oscillator.png") as file:
            draw(by_weight, by_factor).savefig(file, dpi=90)
    except InputError as error:
        parser.error(str(error))
    print(report(by_weight[1.5], scenario))
    return 0


if __name__ == "__main__":
    sys.exit(main())
