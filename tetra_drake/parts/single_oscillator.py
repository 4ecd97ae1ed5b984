"""One neural oscillator: what its weight and time constants make of its signal."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput

from tetra_drake.engines.drake import MakeSimulator
from tetra_drake.robot.gait import TAU_B_PER_TAU_A, Gait
from tetra_drake.scenario.schema import Scenario
from tetra_drake.systems import MatsuokaCpg

TAU_A = 0.3
"""s, as in the thesis's figures."""

SINE_WEIGHT = 1.5
"""Of the inhibition between extensor and flexor: the thesis's choice, which with
tau_B = 2 tau_A gives a sine."""

WEIGHTS = (SINE_WEIGHT, 2.0)
"""Those the thesis compares (Fig. 10), with tau_B = 2 tau_A."""

FACTORS = (1.5, TAU_B_PER_TAU_A, 3.0)
"""tau_B / tau_A: those the thesis compares (Fig. 9), with a weight of 1.5."""

DURATION = 15.0  # s
TRANSIENT = 5.0  # s; what comes before does not count as the oscillation's shape


@dataclass(frozen=True)
class Oscillation:
    """A recorded signal: times (samples,) in s and signal (samples,) in N."""

    times: np.ndarray
    signal: np.ndarray


def MakeOscillatorDiagram(
    scenario: Scenario,
    *,
    partner_weight: float = SINE_WEIGHT,
    tau_a: float = TAU_A,
    factor: float = TAU_B_PER_TAU_A,
) -> Diagram:
    """A network of one oscillator, and a log of its signal.

    Subsystems: cpg, signals_log. `tau_a` in s; `factor` is tau_B / tau_A.
    """
    builder = DiagramBuilder()
    cpg = dataclasses.replace(scenario.cpg, partner_weight=partner_weight)
    gait = Gait(name="single oscillator", weights=(), tau_a=tau_a, tau_b=factor * tau_a)
    oscillator = builder.AddNamedSystem("cpg", MatsuokaCpg(cpg, gait, oscillators=1))
    LogVectorOutput(oscillator.GetOutputPort("signals"), builder).set_name("signals_log")
    diagram = builder.Build()
    diagram.set_name("single_oscillator")
    return diagram


def oscillate(
    scenario: Scenario,
    *,
    partner_weight: float = SINE_WEIGHT,
    tau_a: float = TAU_A,
    factor: float = TAU_B_PER_TAU_A,
    duration: float = DURATION,
) -> Oscillation:
    """The signal of one oscillator from rest; times in s, `factor` is tau_B / tau_A."""
    diagram = MakeOscillatorDiagram(
        scenario, partner_weight=partner_weight, tau_a=tau_a, factor=factor
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


def oscillations_by_weight(scenario: Scenario) -> dict[float, Oscillation]:
    """What Fig. 10 compares: an oscillation for each of WEIGHTS."""
    return {weight: oscillate(scenario, partner_weight=weight) for weight in WEIGHTS}


def oscillations_by_factor(scenario: Scenario) -> dict[float, Oscillation]:
    """What Fig. 9 compares: an oscillation for each of FACTORS."""
    return {factor: oscillate(scenario, factor=factor) for factor in FACTORS}


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
    scenario: Scenario,
    *,
    partner_weight: float = SINE_WEIGHT,
    tau_a: float = TAU_A,
    factor: float = TAU_B_PER_TAU_A,
) -> float:
    """In Hz, of Eq. 7 while both neurons fire, when the equations are linear.

    The differences d of the two u and e of the two v then follow
    tau_A d' = (w - 1) d - beta e and tau_B e' = d - e. That is an undamped oscillation where
    tau_B / tau_A = 1 / (w - 1), which is the thesis's choice of 2 with w = 1.5; a
    smaller ratio damps it, a greater one lets it grow until neurons fall silent.
    """
    tau_b = factor * tau_a
    squared = (scenario.cpg.self_inhibition_weight + 1.0 - partner_weight) / (tau_a * tau_b)
    damping = (1.0 / tau_b - (partner_weight - 1.0) / tau_a) / 2.0
    return math.sqrt(squared - damping**2) / (2.0 * math.pi)
