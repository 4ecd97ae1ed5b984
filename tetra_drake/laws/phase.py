"""Phase oscillators with controlled amplitudes, after Ijspeert (Science 315, 2007, 1416-1420).

Oscillator k has the phase phi and the amplitude r; its output is r cos phi. Neighbours in the order
of the oscillators pull their phases to a difference, the lag. With the push p, half the difference
of the oscillator's two inputs, and the excitation e, their mean:

    phi_k' = 2 pi f (1 - p_k sin phi_k) + w sum_j r_j sin(phi_j - phi_k - lag_jk)
    r_k'' = a (a / 4 (e_k R_k - r_k) - r_k')

The push is what a signal forces on the oscillator: one near its frequency entrains it. Turn and
feedback of loads change the excitation, so the amplitude follows them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Literal, NamedTuple

import numpy as np
from pydantic import Field

from tetra_drake.kernels.compiling import inlined
from tetra_drake.kernels.lanes import Table, sine
from tetra_drake.laws.oscillator import (
    RATE,
    VALUE,
    CpgKind,
    GaitBounds,
    GaitParameter,
    OscillatorFunctions,
    Wiring,
)
from tetra_drake.settings.quantities import PAIR, Angle, Frequency, InverseTime


class PhaseConstants(NamedTuple):
    """Constants of n phase oscillators; tables (n,)."""

    frequency: Table
    """2 pi f in rad/s."""
    amplitude: Table
    """Amplitude R without steering and feedback."""
    lag: Table
    """Phase (rad) by which each oscillator is behind the one before it."""
    coupling: Table
    """Coupling w in 1/s to the oscillator before; 0 for the first one."""
    settling: Table
    """Rate a in 1/s at which amplitudes settle."""


@inlined
def phase_rates(inputs: Table, states: Table, law: PhaseConstants) -> None:
    """Writes the rates of phases, amplitudes and rates of amplitudes to the table `states` (3n, 5),
    which has these of all oscillators one after the other. `inputs` (2n,) are two per
    oscillator."""
    count = law.frequency.size
    for k in range(count):
        phase, r, r_rate = states[k, VALUE], states[count + k, VALUE], states[2 * count + k, VALUE]
        push = 0.5 * (inputs[2 * k] - inputs[2 * k + 1])
        target = 0.5 * (inputs[2 * k] + inputs[2 * k + 1]) * law.amplitude[k]
        states[k, RATE] = law.frequency[k] * (1.0 - push * sine(phase))
        states[count + k, RATE] = r_rate
        states[2 * count + k, RATE] = law.settling[k] * (
            0.25 * law.settling[k] * (target - r) - r_rate
        )
    for k in range(1, count):
        pull = law.coupling[k] * sine(states[k - 1, VALUE] - states[k, VALUE] - law.lag[k])
        states[k, RATE] += states[count + k - 1, VALUE] * pull
        states[k - 1, RATE] -= states[count + k, VALUE] * pull


@inlined
def phase_outputs(states: Table, outputs: Table, law: PhaseConstants) -> None:
    """Writes the output r cos phi of each oscillator to `outputs` (n,)."""
    for k in range(outputs.size):
        outputs[k] = states[outputs.size + k, VALUE] * sine(states[k, VALUE] + 0.5 * math.pi)


class PhaseOscillators(CpgKind):
    """Phase oscillators with controlled amplitudes.

    Frequency, amplitudes, lags and coupling are parameters of a gait; here are their bounds in
    random gaits, and equal bounds fix them. With fixed amplitudes and coupling and common lags a
    gait is a travelling sine. The oscillators start with their lags and without amplitude; the
    first one rises through 0 at the start-up time.
    """

    tag = "Phase"
    own = OscillatorFunctions(PhaseConstants, phase_rates, phase_outputs)

    frequency: Annotated[list[Annotated[Frequency, Field(ge=0)]], *PAIR] = Field(default=[0.3, 1.2])
    """Bounds of the frequency of all oscillators."""
    amplitude: Annotated[list[Annotated[float, Field(ge=0)]], *PAIR] = Field(default=[0.5, 1.0])
    """Bounds of the amplitudes; `gain` is the signal per unit."""
    lag: Annotated[list[Angle], *PAIR] = Field(default=[-math.pi, math.pi])
    """Bounds of the phase by which an oscillator is behind the one before."""
    coupling: Annotated[list[Annotated[InverseTime, Field(ge=0)]], *PAIR] = Field(
        default=[8.0, 8.0]
    )
    """Bounds of the coupling w of neighbours. A small displacement of a phase decays at a rate of
    about w."""
    common: list[Literal["amplitude", "lag"]] = Field(default=[])
    """Parameters that all oscillators of random and evolved gaits share."""
    settling: InverseTime = Field(default=20.0, gt=0)
    """Rate at which amplitudes settle."""

    @property
    def usual_amplitude(self) -> float:
        """Largest amplitude (N) of the signals of random gaits without steering."""
        return abs(self.gain) * self.amplitude[1]

    def parameters(
        self, wiring: Wiring, bounds: GaitBounds | None = None
    ) -> Mapping[str, GaitParameter]:
        """Frequency, amplitudes, lags, coupling, and gains of the feedback."""
        numbers = range(1, wiring.signals + 1)
        given = {
            "frequency": (["frequency"], "Hz"),
            "amplitude": ([f"amplitude {k}" for k in numbers], ""),
            "lag": ([f"lag {k}->{k + 1}" for k in numbers[:-1]], "rad"),
            "coupling": (["coupling"], "1/s"),
        }
        found: dict[str, GaitParameter] = {}
        for key, (names, unit) in given.items():
            (low, high), limit = getattr(self, key), -math.inf if key == "lag" else 0.0
            for name in names:
                copies = names[0] if key in self.common and name != names[0] else ""
                found[name] = GaitParameter(low, high, limit, limit, unit=unit, copies=copies)
        return found | self.gain_parameters()

    def network(
        self, wiring: Wiring, gait: Mapping[str, float]
    ) -> tuple[PhaseConstants, np.ndarray]:
        count, frequency = wiring.signals, gait["frequency"]
        numbers = range(1, count + 1)
        coupling = np.full(count, gait["coupling"])
        coupling[:1] = 0.0
        constants = PhaseConstants(
            frequency=np.full(count, math.tau * frequency),
            amplitude=np.array([gait[f"amplitude {k}"] for k in numbers]),
            lag=np.array([gait.get(f"lag {k - 1}->{k}", 0.0) for k in numbers]),
            coupling=coupling,
            settling=np.full(count, self.settling),
        )
        phases = -math.tau * (0.25 + frequency * self.start_up) - np.cumsum(constants.lag)
        return constants, np.append(phases, np.zeros(2 * count))
