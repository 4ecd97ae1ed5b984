"""One Matsuoka oscillator: its signal for several weights and ratios of time constants.

    python diagrams/single_oscillator.py [--tau "0.2 s"] [--weights 1.2 1.5] [--live]

An oscillator is a pair of neurons, extensor and flexor. They inhibit each other with the weight w
(thesis Eq. 7). While both fire, their equations are linear. The differences d of the two u, and e
of the two v, follow

    tau_A d' = (w - 1) d - beta e,    tau_B e' = d - e.

This oscillates at sqrt((beta + 1 - w) / (tau_A tau_B) - D^2) rad/s with the damping
D = (1 / tau_B - (w - 1) / tau_A) / 2. With the thesis's choice, w = 1.5 and tau_B = 2 tau_A, D is
zero: the signal is a sine of frequency 1 / (2 pi tau_A). A smaller ratio tau_B / tau_A damps it
(thesis Figure 9). With a greater ratio or weight it grows until neurons fall silent (Figure 10).
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from block_diagram import OUT, save_block_diagram
from live import SignalCurves, open_meshcat
from matplotlib.figure import Figure
from pydrake.geometry import Meshcat
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput

from tetra_drake.figures.style import common_style, make_figure, save_figure
from tetra_drake.laws.matsuoka import Matsuoka, Network
from tetra_drake.options import quantity
from tetra_drake.robot.measures import dominant_frequency
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.settings.units import POUND_FORCE
from tetra_drake.systems import MatsuokaCpg

TAU_A = 0.3  # s, as in the thesis's figures
WEIGHT, RATIO = 1.5, 2.0  # w and tau_B / tau_A, the thesis's choice
WEIGHTS, RATIOS = (WEIGHT, 2.0), (1.5, RATIO, 3.0)  # the thesis's other values
THESIS_FREQUENCY = 0.7  # Hz
TRANSIENT = 5.0  # s


def make_diagram(
    scenario: Scenario,
    *,
    weight: float = WEIGHT,
    tau_a: float = TAU_A,
    ratio: float = RATIO,
    meshcat: Meshcat | None = None,
) -> Diagram:
    """Diagram of a network with one oscillator, and a log of its signal. With `meshcat` it shows
    the signal."""
    cpg = scenario.cpg
    assert isinstance(cpg, Matsuoka)
    network = Network.of(
        [[0.0, weight], [weight, 0.0]],
        tau_a=tau_a,
        tau_b=ratio * tau_a,
        self_inhibition_weight=cpg.self_inhibition_weight,
    )
    neurons = MatsuokaCpg(
        network,
        tonic=cpg.external_input,
        initial_state=np.repeat(cpg.initial_state, [2, 1, 1]),
        gain=cpg.gain,
    )
    builder = DiagramBuilder()
    oscillator = builder.AddNamedSystem("oscillator", neurons)
    LogVectorOutput(oscillator.GetOutputPort("signals"), builder).set_name("log")
    if meshcat:
        curves = SignalCurves(meshcat, count=1, window=10.0, scale=0.05)
        builder.AddNamedSystem("curves", curves)
        builder.Connect(oscillator.GetOutputPort("signals"), curves.GetInputPort("signals"))
    diagram = builder.Build()
    diagram.set_name("single_oscillator")
    return diagram


def simulate(
    diagram: Diagram, duration: float = 15.0, *, rate: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Simulated signal: times (samples,) in s and signal (samples,) in N. A `rate` above 0 is the
    greatest speed, as a multiple of real time."""
    simulator = Simulator(diagram)
    simulator.set_target_realtime_rate(rate)
    ResetIntegratorFromFlags(simulator, "runge_kutta3", 0.01).set_target_accuracy(1e-6)
    simulator.AdvanceTo(duration)
    log = diagram.GetSubsystemByName("log").FindLog(simulator.get_context())
    return log.sample_times(), log.data()[0]


def linear_frequency(
    scenario: Scenario, *, weight: float = WEIGHT, tau_a: float = TAU_A, ratio: float = RATIO
) -> float:
    """Theoretical frequency in Hz while both neurons fire."""
    tau_b = ratio * tau_a
    damping = (1.0 / tau_b - (weight - 1.0) / tau_a) / 2.0
    assert isinstance(scenario.cpg, Matsuoka)
    stiffness = (scenario.cpg.self_inhibition_weight + 1.0 - weight) / (tau_a * tau_b)
    return math.sqrt(stiffness - damping**2) / (2.0 * math.pi)


def frequency_and_swing(times: np.ndarray, signal: np.ndarray) -> tuple[float, float]:
    """Frequency (Hz) after the transient, and swing (lbf) at the end."""
    late, end = times > TRANSIENT, times > times[-1] - TRANSIENT
    frequency = dominant_frequency(times[late], signal[late])
    return frequency, float(np.ptp(signal[end])) / POUND_FORCE


@common_style()
def draw(diagrams: dict[str, Diagram], title: str) -> Figure:
    """Draws a panel for the signal of each diagram."""
    rows = len(diagrams)
    height = 0.8 + 1.5 * rows
    figure, axes = make_figure(width_in=7, height_in=height, rows=rows, sharex=True, sharey=True)
    for panel, (label, diagram) in zip(axes[:, 0], diagrams.items(), strict=True):
        times, signal = simulate(diagram)
        frequency, swing = frequency_and_swing(times, signal)
        panel.plot(times, signal / POUND_FORCE)
        panel.set_title(f"{label}: {frequency:.2f} Hz, in the end {swing:.2f} lbf peak to peak")
        panel.set_ylabel("signal (lbf)")
    axes[-1, 0].set_xlabel("time (s)")
    figure.suptitle(title)
    return figure


def main(
    out: Path = OUT,
    *,
    tau: float = TAU_A,
    weights: Sequence[float] = WEIGHTS,
    ratios: Sequence[float] = RATIOS,
    live: bool = False,
) -> None:
    """Simulates the oscillators and writes the pictures. `tau` is tau_A in s. With `live`, Meshcat
    shows the first of `weights`."""
    scenario = load_scenario("thesis")
    if live:
        shown = make_diagram(scenario, weight=weights[0], tau_a=tau, meshcat=open_meshcat())
        simulate(shown, 60.0, rate=1.0)
    save_block_diagram(make_diagram(scenario), out / "single_oscillator.svg")

    diagrams = {f"$w = {w:g}$": make_diagram(scenario, weight=w, tau_a=tau) for w in weights}
    figure = draw(diagrams, "Weight between the neurons of an oscillator (thesis Fig. 10)")
    save_figure(figure, out, "single_oscillator_weights", kinds=["svg"])

    diagrams = {
        rf"$\tau_B = {r:g}\,\tau_A$": make_diagram(scenario, ratio=r, tau_a=tau) for r in ratios
    }
    figure = draw(diagrams, "Time constants of an oscillator (thesis Fig. 9)")
    save_figure(figure, out, "single_oscillator_time_constants", kinds=["svg"])

    ours = linear_frequency(scenario, tau_a=tau)
    print(f"tau_A = {tau:g} s gives {ours:.3f} Hz; the thesis's {THESIS_FREQUENCY:g} Hz needs")
    print(f"tau_A = {tau * ours / THESIS_FREQUENCY:.3f} s")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    tau = quantity("s", "0.2 s", least="1 ms", most="100 s")
    parser.add_argument("--tau", type=tau, default=TAU_A, help="such as '0.2 s'")
    weights, ratios = "weights of mutual inhibition", "ratios of the two time constants"
    parser.add_argument("--weights", type=float, nargs="+", default=WEIGHTS, help=weights)
    parser.add_argument("--ratios", type=float, nargs="+", default=RATIOS, help=ratios)
    parser.add_argument("--live", action="store_true", help="show the signals in Meshcat")
    parser.add_argument("--out", type=Path, default=OUT, help="folder for the figures")
    try:
        main(**vars(parser.parse_args()))
    except ValueError as error:
        sys.exit(f"single_oscillator.py: {error}")
