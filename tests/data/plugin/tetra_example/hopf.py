"""A kind of oscillators: Hopf's, in a row, each pulled towards the one before it."""

import math
from typing import NamedTuple

import numpy as np

from tetra_drake.kernels.compiling import inlined
from tetra_drake.kernels.lanes import Table
from tetra_drake.laws.oscillator import (
    RATE,
    VALUE,
    CpgKind,
    GaitParameter,
    OscillatorFunctions,
)
from tetra_drake.settings.quantities import InverseTime


class HopfConstants(NamedTuple):
    frequency: Table
    growth: Table
    pull: Table
    cosine: Table
    sine: Table


@inlined
def hopf_rates(inputs, states, law):
    count = law.growth.size
    for k in range(count):
        x, y = states[k, VALUE], states[count + k, VALUE]
        excitation = 0.5 * (inputs[2 * k] + inputs[2 * k + 1])
        push = 0.5 * (inputs[2 * k] - inputs[2 * k + 1])
        growth = law.growth[k] * (excitation - x * x - y * y)
        states[k, RATE] = growth * x - law.frequency[k] * (y - push)
        states[count + k, RATE] = growth * y + law.frequency[k] * x
        if k > 0:
            before, other = states[k - 1, VALUE], states[count + k - 1, VALUE]
            turned = law.cosine[k] * before + law.sine[k] * other
            states[k, RATE] += law.pull[k] * (turned - x)
            turned = law.cosine[k] * other - law.sine[k] * before
            states[count + k, RATE] += law.pull[k] * (turned - y)


@inlined
def hopf_outputs(states, outputs, law):
    for k in range(outputs.size):
        outputs[k] = states[k, VALUE]


class Hopf(CpgKind):
    """Hopf oscillators in a row. A gait has a frequency, and the lag of each behind the one
    before."""

    own = OscillatorFunctions(HopfConstants, hopf_rates, hopf_outputs)

    growth: InverseTime = 10.0
    """Half the rate at which amplitudes settle."""
    pull: InverseTime = 5.0
    """Rate at which an oscillator follows the one before it."""

    @property
    def usual_amplitude(self):
        return abs(self.gain)

    def parameters(self, wiring, bounds=None):
        lag = GaitParameter(-math.pi, math.pi, unit="rad")
        lags = {f"lag {k}": lag for k in range(2, wiring.signals + 1)}
        frequency = GaitParameter(0.3, 1.2, floor=0.0, least=0.0, unit="Hz")
        return {"frequency": frequency, **lags, **self.gain_parameters()}

    def network(self, wiring, gait):
        count = wiring.signals
        lags = np.array([gait.get(f"lag {k + 1}", 0.0) for k in range(count)])
        frequency = np.full(count, math.tau * gait["frequency"])
        growth, pull = np.full(count, self.growth), np.full(count, self.pull)
        constants = HopfConstants(frequency, growth, pull, np.cos(lags), np.sin(lags))
        return constants, np.repeat([1.0, 0.0], count)
