"""Central pattern generator (network of oscillators), as a LeafSystem."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from pydrake.systems.framework import BasicVector, Context, ContinuousState

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
        u = oscillator.U
        DeclareOutput(self, "neurons", neurons, lambda s, c: s._neurons(c)[:, u].clip(0.0), sources)

    def DoCalcTimeDerivatives(self, context: Context, derivatives: ContinuousState) -> None:
        """Writes the rates of u and v (thesis Eq. 7) to `derivatives`."""
        neurons = self._neurons(context)
        tonic, feedback = self._default_tonic, 0.0
        if self._tonic.HasValue(context):
            tonic = self._tonic.Eval(context)
        if self._feedback.HasValue(context):
            feedback = self._feedback.Eval(context)
        oscillator.neuron_rates(self._network, tonic + feedback, neurons)
        derivatives.SetFromVector(neurons[:, oscillator.U_RATE : oscillator.V_RATE + 1].T.ravel())

    def _neurons(self, context: Context) -> np.ndarray:
        """Table `neurons` of laws.oscillator, a row per neuron (2n rows), made from the continuous
        state in `context`. It is a copy."""
        return oscillator.make_neurons(context.get_continuous_state_vector().value())

    def _calc_signals(self, context: Context, output: BasicVector) -> None:
        signals = output.get_mutable_value()
        oscillator.oscillator_output(self._neurons(context), signals)
        signals *= self._gain
