"""The central pattern generator as a system."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import BasicVector, Context, ContinuousState, LeafSystem

from tetra_drake.physics.oscillator import (
    U_RATE,
    V_RATE,
    U,
    make_neurons,
    neuron_rates,
    oscillator_output,
)
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.model import initial_state, make_network
from tetra_drake.scenario.schema import CpgScenario


class MatsuokaCpg(LeafSystem):
    """The network of n Matsuoka oscillators (thesis Eq. 7-9) of one gait.

    | port     | shape | unit | meaning                                                      |
    |----------|-------|------|--------------------------------------------------------------|
    | feedback | (2n,) | 1    | f of Eq. 7, by neuron; zero where nothing is connected       |
    | signals  | (n,)  | N    | gain (y_extensor - y_flexor), by oscillator                  |
    | neurons  | (2n,) | 1    | y = max(0, u); neurons 2k, 2k+1: extensor, flexor of the k-th |

    Continuous state: u (2n,), then v (2n,), the inner states and the self-inhibitions. It
    starts at the scenario's initial values. The signals are those of the network from t = 0 on;
    a StartUpGate keeps them from the cables at first.
    """

    def __init__(self, cpg: CpgScenario, gait: Gait, *, oscillators: int) -> None:
        super().__init__()
        neurons = 2 * oscillators
        self._gain = cpg.gain
        self._network = make_network(cpg, gait, oscillators=oscillators)
        self._no_feedback = np.zeros(neurons)
        self._feedback = self.DeclareVectorInputPort("feedback", neurons)
        self.DeclareContinuousState(BasicVector(initial_state(cpg, oscillators)))
        tickets = {self.xc_ticket()}
        self.DeclareVectorOutputPort("signals", oscillators, self._calc_signals, tickets)
        self.DeclareVectorOutputPort("neurons", neurons, self._calc_neurons, tickets)

    def DoCalcTimeDerivatives(self, context: Context, derivatives: ContinuousState) -> None:
        """Eq. 7."""
        neurons, feedback = self._neurons(context), self._no_feedback
        if self._feedback.HasValue(context):
            feedback = self._feedback.Eval(context)
        neuron_rates(self._network, feedback, neurons)
        derivatives.SetFromVector(neurons[:, U_RATE : V_RATE + 1].T.ravel())

    def _neurons(self, context: Context) -> np.ndarray:
        """The `neurons` of physics.oscillator."""
        return make_neurons(context.get_continuous_state_vector().value())

    def _calc_signals(self, context: Context, output: BasicVector) -> None:
        signals = output.get_mutable_value()
        oscillator_output(self._neurons(context), signals)
        signals *= self._gain

    def _calc_neurons(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(np.maximum(0.0, self._neurons(context)[:, U]))
