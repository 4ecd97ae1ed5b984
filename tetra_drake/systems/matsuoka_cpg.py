"""The central pattern generator as a system."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from pydrake.systems.framework import BasicVector, Context, ContinuousState, LeafSystem

from tetra_drake.physics.oscillator import (
    U_RATE,
    V_RATE,
    Network,
    U,
    make_neurons,
    neuron_rates,
    oscillator_output,
)


class MatsuokaCpg(LeafSystem):
    """A network of n Matsuoka oscillators (thesis Eq. 7-9).

    | port     | shape | unit | meaning                                                      |
    |----------|-------|------|--------------------------------------------------------------|
    | tonic    | (2n,) | 1    | u0 of Eq. 7, by neuron; if not connected, as constructed     |
    | feedback | (2n,) | 1    | f of Eq. 7, by neuron; zero where nothing is connected       |
    | signals  | (n,)  | N    | gain (y_extensor - y_flexor), by oscillator                  |
    | neurons  | (2n,) | 1    | y = max(0, u); neurons 2k, 2k+1: extensor, flexor of the k-th |

    Continuous state: u (2n,), then v (2n,), the inner states and the self-inhibitions. Outputs
    depend on it alone, so what they drive may feed back without an algebraic loop. The signals are
    those of the network from t = 0 on. The robot's network is `Robot.network`;
    diagrams/entrainment.py closes a loop around an oscillator of its own.
    """

    def __init__(
        self,
        network: Network,
        *,
        tonic: npt.ArrayLike,
        initial_state: npt.ArrayLike,
        gain: float = 1.0,
    ) -> None:
        """`tonic` for all neurons or each, `initial_state` (4n,), `gain` per unit of y."""
        super().__init__()
        neurons = len(network.inhibition)
        self._network, self._gain = network, gain
        self._default_tonic = np.full(neurons, tonic, dtype=float)
        self._tonic = self.DeclareVectorInputPort("tonic", neurons)
        self._feedback = self.DeclareVectorInputPort("feedback", neurons)
        state = np.array(initial_state, dtype=float)
        if state.shape != (2 * neurons,):
            expected = f"({2 * neurons},) for {neurons} neurons"
            raise ValueError(f"found initial_state of shape {state.shape}, expected {expected}")
        self.DeclareContinuousState(BasicVector(state))
        sources = {self.xc_ticket()}
        self.DeclareVectorOutputPort("signals", neurons // 2, self._calc_signals, sources)
        self.DeclareVectorOutputPort("neurons", neurons, self._calc_neurons, sources)

    def DoCalcTimeDerivatives(self, context: Context, derivatives: ContinuousState) -> None:
        """Eq. 7."""
        neurons = self._neurons(context)
        tonic, feedback = self._default_tonic, 0.0
        if self._tonic.HasValue(context):
            tonic = self._tonic.Eval(context)
        if self._feedback.HasValue(context):
            feedback = self._feedback.Eval(context)
        neuron_rates(self._network, tonic + feedback, neurons)
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
