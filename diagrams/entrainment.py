"""Entrainment: a Matsuoka oscillator drives a mass on a spring and senses it. Which sets the pace?

    python diagrams/entrainment.py

The oscillator pushes the mass with its signal. The mass's displacement x excites the extensor by
g x and the flexor by -g x. The theory is harmonic balance (K. Matsuoka, Analysis of a neural
oscillator, Biological Cybernetics 104, 2011): taking the positive part of a neuron's state
multiplies its swing by a factor 0 < K < 1. Let d and e be the differences of the two u and of the
two v, w the inhibition between the neurons, and h = 2 g gain / stiffness. A swing exp(i omega t)
then needs

    (1 + i omega tau_A) d = w K d - beta e + h P K d,    (1 + i omega tau_B) e = K d,

where P = 1 / (1 - r^2 + 2 i zeta r), r = omega / omega_0, is the response of the mass to a force.
So 1 / K is

    R(omega) = (w - beta / (1 + i omega tau_B) + h P) / (1 + i omega tau_A),

which must be real and greater than 1. Without feedback this gives the oscillator's own frequency,
omega = sqrt(((tau_A + tau_B) beta - tau_A w) / (tau_A w)) / tau_B. With feedback there can be
several solutions, and the start decides. Near resonance P lags by 90 degrees, and so does h P for
g > 0, which slows the oscillator down: it can follow a mass slower than itself. For g < 0, h P
leads, and it can follow a faster one.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np
from block_diagram import OUT, save_block_diagram
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import LinearSystem, LogVectorOutput, MatrixGain

from tetra_drake.figures.style import common_style, make_figure, save_figure
from tetra_drake.laws.matsuoka import Network
from tetra_drake.robot.measures import dominant_frequency
from tetra_drake.systems import MatsuokaCpg

TAU_A, TAU_B = 0.3, 0.6  # s
WEIGHT, BETA, TONIC = 2.0, 2.5, 0.5
GAIN, STIFFNESS, DAMPING_RATIO = 10.0, 1000.0, 0.07  # N, N/m
FEEDBACK = 10.0  # 1/m, of either sign
RATIOS = np.geomspace(0.4, 2.5, 14)  # of the mass's resonance to the oscillator's own frequency
DURATION, TRANSIENT = 80.0, 50.0  # s
STARTS = {"at rest": 0.0, "20 mm off": 0.02}  # of the mass, m


def own_frequency() -> float:
    """Frequency in Hz of the oscillator alone, by harmonic balance."""
    square = ((TAU_A + TAU_B) * BETA - TAU_A * WEIGHT) / (TAU_A * WEIGHT)
    return math.sqrt(square) / (2.0 * math.pi * TAU_B)


def make_diagram(*, ratio: float, feedback: float) -> Diagram:
    """Diagram of the oscillator and the mass. `ratio` is the mass's resonance divided by the
    oscillator's own frequency; `feedback` is in 1/m."""
    network = Network.of(
        [[0.0, WEIGHT], [WEIGHT, 0.0]], tau_a=TAU_A, tau_b=TAU_B, self_inhibition_weight=BETA
    )
    neurons = MatsuokaCpg(network, tonic=TONIC, initial_state=[0.3, 0.3, 0.1, 0.5], gain=GAIN)
    omega = 2.0 * math.pi * (ratio * own_frequency())
    motion = np.array([[0.0, 1.0], [-(omega**2), -2.0 * DAMPING_RATIO * omega]])
    force = np.array([[0.0], [omega**2 / STIFFNESS]])
    spring = LinearSystem(A=motion, B=force, C=np.array([[1.0, 0.0]]), D=np.zeros((1, 1)))

    builder = DiagramBuilder()
    oscillator = builder.AddNamedSystem("oscillator", neurons)
    mass = builder.AddNamedSystem("mass on a spring", spring)
    sense = builder.AddNamedSystem("feedback", MatrixGain(feedback * np.array([[1.0], [-1.0]])))
    builder.Connect(oscillator.GetOutputPort("signals"), mass.get_input_port())
    builder.Connect(mass.get_output_port(), sense.get_input_port())
    builder.Connect(sense.get_output_port(), oscillator.GetInputPort("feedback"))
    LogVectorOutput(oscillator.GetOutputPort("signals"), builder).set_name("log")
    diagram = builder.Build()
    diagram.set_name("entrainment")
    return diagram


def simulated_frequency(*, ratio: float, feedback: float, start: float = 0.0) -> float:
    """Frequency of the loop divided by the oscillator's own, by simulation: long after the start of
    the mass at a displacement x (m)."""
    diagram = make_diagram(ratio=ratio, feedback=feedback)
    simulator = Simulator(diagram)
    context = simulator.get_context()
    mass = diagram.GetSubsystemByName("mass on a spring")
    mass.GetMyMutableContextFromRoot(context).SetContinuousState([start, 0.0])
    ResetIntegratorFromFlags(simulator, "runge_kutta3", 0.05).set_target_accuracy(1e-3)
    simulator.AdvanceTo(DURATION)
    log = diagram.GetSubsystemByName("log").FindLog(context)
    late = log.sample_times() > TRANSIENT
    return dominant_frequency(log.sample_times()[late], log.data()[0, late]) / own_frequency()


def balanced_frequencies(*, ratio: float, feedback: float) -> np.ndarray:
    """Possible frequencies of the loop divided by the oscillator's own, by harmonic balance;
    ascending."""
    frequency = np.linspace(0.1, 4.0, 50_001)
    s, r = 2j * math.pi * own_frequency() * frequency, frequency / ratio
    follows = 1.0 / (1.0 - r**2 + 2j * DAMPING_RATIO * r)
    h = 2.0 * feedback * GAIN / STIFFNESS
    per_k = (WEIGHT - BETA / (1.0 + s * TAU_B) + h * follows) / (1.0 + s * TAU_A)
    balanced = (np.diff(np.sign(per_k.imag)) != 0) & (per_k.real[:-1] > 1.0)
    return np.asarray(frequency[:-1][balanced])


def balance_all(feedback: float) -> tuple[np.ndarray, np.ndarray]:
    """Curve of the theory: ratios (points,), denser than RATIOS, and frequencies (points,) by
    harmonic balance."""
    points = []
    for ratio in np.geomspace(RATIOS[0], RATIOS[-1], 200):
        for frequency in balanced_frequencies(ratio=ratio, feedback=feedback):
            points.append((ratio, frequency))
    ratios, frequencies = np.array(points).T
    return ratios, frequencies


def followed(ratios: np.ndarray, frequencies: np.ndarray) -> str:
    """Range of ratios for which the loop's frequency is nearer to the mass's resonance than to the
    oscillator's own frequency."""
    follows = ratios[np.abs(frequencies - ratios) < np.abs(frequencies - 1.0)]
    return f"{follows.min():.2f} to {follows.max():.2f}"


def compare(panel: Axes, feedback: float) -> None:
    """Simulates the loop for RATIOS, draws and prints its frequencies over the mass's resonance."""
    panel.plot(RATIOS, RATIOS, color="0.6", linewidth=0.8, label="resonance")
    panel.axhline(1.0, color="0.6", linewidth=0.8, linestyle="--", label="oscillator alone")
    theory = balance_all(feedback)
    panel.plot(*theory, ".", color="0.2", markersize=1.5, label="harmonic balance")
    panel.set(title=f"feedback {feedback:+g}/m", xlabel="resonance of the mass / own frequency")
    print(f"Feedback {feedback:+g}/m: follows a mass that resonates at the own frequency times")
    for (label, start), marker in zip(STARTS.items(), "ox", strict=True):
        frequencies = np.array(
            [simulated_frequency(ratio=r, feedback=feedback, start=start) for r in RATIOS]
        )
        (points,) = panel.plot(RATIOS, frequencies, marker, markersize=5, fillstyle="none")
        points.set_label(f"mass {label}")
        print(f"  {followed(RATIOS, frequencies)}, the mass {label} at first")
    print(f"  {followed(*theory)} by harmonic balance")


@common_style()
def draw() -> Figure:
    """Draws a panel for each sign of the feedback."""
    figure, axes = make_figure(width_in=7, height_in=3.6, columns=2, sharey=True)
    for panel, feedback in zip(axes[0], (FEEDBACK, -FEEDBACK), strict=True):
        compare(panel, feedback)
    axes[0, 0].set_ylabel("frequency of the loop / own frequency")
    axes[0, 0].legend(fontsize="small")
    return figure


def main(out: Path = OUT) -> None:
    """Simulates the loops and writes the pictures."""
    save_block_diagram(make_diagram(ratio=1.0, feedback=FEEDBACK), out / "entrainment.svg")
    balanced = own_frequency()
    simulated = simulated_frequency(ratio=1.0, feedback=0.0) * balanced
    print(f"Without feedback: {simulated:.3f} Hz (harmonic balance {balanced:.3f} Hz)")
    save_figure(draw(), out, "entrainment_frequencies", kinds=["svg"])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", nargs="?", type=Path, default=OUT)
    main(parser.parse_args().out)
