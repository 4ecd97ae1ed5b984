"""Central pattern generator (network of oscillators), as a LeafSystem."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from pydrake.systems.framework import BasicVector, Context, ContinuousState

from tetra_drake.kernels.compiling import machine_code
from tetra_drake.kernels.packed import Packed
from tetra_drake.laws import oscillator
from tetra_drake.systems.attachment import DeclareOutput
from tetra_drake.systems.scalar_conversion import ConvertibleSystem


class MatsuokaCpg(ConvertibleSystem):
    """Network of n Matsuoka oscillators (thesis Eq. 7-9).

    | port     | in, out | shape | unit | meaning                                               |
    |----------|---------|-------|------|-------------------------------------------------------|
    | tonic    | in      | (2n,) | 1    | u0 of thesis Eq. 7, by neuron; without a connection   |
    |          |         |       |      | `tonic` of the constructor                            |
    | feedback | in      | (2n,) | 1    | f of thesis Eq. 7, by neuron; without a connection 0  |
    | signals  | out     | (n,)  | N    | gain * (y_extensor - y_flexor), by oscillator         |
    | neurons  | out     | (2n,) | 1    | outputs y = max(0, u) of the neurons                  |

    Neurons 2k and 2k + 1 are the extensor and the flexor of oscillator k, from 0 on. The continuous
    state is u (2n,), then v (2n,): inner states and self-inhibitions. The outputs depend only on
    the state, so a feedback loop around the network is not algebraic. The signals begin at t = 0,
    without a start-up time. See `Robot.network` for the robot's network, and
    diagrams/entrainment.py for a loop around a single oscillator.
    """

    def __init__(
        self,
        network: oscillator.Network,
        *,
        tonic: npt.ArrayLike,
        initial_state: npt.ArrayLike,
        gain: float = 1.0,
    ) -> None:
        """`network` has the constants of the neurons and their connections. `tonic` is the input
        u0 without a connected port: a number, or a value per neuron.
        `initial_state` (4n,) is u of all neurons, then v. `gain` is the force (N) per unit of y."""
        super().__init__()
        neurons = len(network.inhibition)
        state = np.array(initial_state, dtype=float)
        if state.shape != (2 * neurons,):
            expected = f"({2 * neurons},) for {neurons} neurons"
            raise ValueError(f"found initial_state of shape {state.shape}, expected {expected}")
        self._gain, self._default_tonic = float(gain), np.full(neurons, tonic, dtype=float)
        # The kernel writes to these arrays at every call.
        self._parts, self._rates = Packed((network, oscillator.make_neurons(state))), state.copy()
        self._compute_rates = machine_code(
            oscillator.network_rates, self._parts, state, self._default_tonic, self._rates
        )
        self._compute_signals = machine_code(
            oscillator.network_signals, state, self._gain, np.empty(neurons // 2)
        )
        self._tonic = self.DeclareVectorInputPort("tonic", neurons)
        self._feedback = self.DeclareVectorInputPort("feedback", neurons)
        self.DeclareContinuousState(BasicVector(state))
        outputs, sources = MatsuokaCpg._outputs, {self.xc_ticket()}
        self.DeclareVectorOutputPort("signals", neurons // 2, self._calc_signals, sources)
        DeclareOutput(self, "neurons", neurons, outputs, sources)

    def DoCalcTimeDerivatives(self, context: Context, derivatives: ContinuousState) -> None:
        """Writes the rates of u and v (thesis Eq. 7) to `derivatives`."""
        inputs, state = self._default_tonic, context.get_continuous_state_vector().value()
        if self._tonic.HasValue(context):
            inputs = self._tonic.Eval(context)
        if self._feedback.HasValue(context):
            inputs = inputs + self._feedback.Eval(context)
        self._compute_rates(self._parts, state, inputs, self._rates)
        derivatives.SetFromVector(self._rates)

    def _outputs(self, context: Context) -> np.ndarray:
        """Outputs y of the neurons (2n,)."""
        return context.get_continuous_state_vector().value()[: self._default_tonic.size].clip(0.0)

    def _calc_signals(self, context: Context, output: BasicVector) -> None:
        state = context.get_continuous_state_vector().value()
        self._compute_signals(state, self._gain, output.get_mutable_value())
