"""Central pattern generator (network of oscillators) of any kind, as a LeafSystem."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from pydrake.systems.framework import BasicVector, Context, ContinuousState

from tetra_drake.kernels.compiling import machine_code
from tetra_drake.kernels.packed import Packed
from tetra_drake.laws.oscillator import Oscillators, make_states, state_rates, state_signals
from tetra_drake.systems.scalar_conversion import ConvertibleSystem


class OscillatorCpg(ConvertibleSystem):
    """Network of n oscillators of any kind, such as phase oscillators.

    | port     | in, out | shape | unit | meaning                                               |
    |----------|---------|-------|------|-------------------------------------------------------|
    | tonic    | in      | (2n,) | 1    | tonic input, two numbers per oscillator; without a    |
    |          |         |       |      | connection `tonic` of the constructor                 |
    | feedback | in      | (2n,) | 1    | is added to the tonic input; without a connection 0   |
    | signals  | out     | (n,)  | N    | gain times the outputs of the oscillators             |

    The continuous state is what the kind of oscillators has. The outputs depend only on the state,
    so a feedback loop around the network is not algebraic. The signals begin at t = 0, without a
    start-up time. `Robot.oscillators` gives the oscillators of a robot with a gait.
    """

    def __init__(
        self,
        oscillators: Oscillators,
        *,
        tonic: npt.ArrayLike,
        gain: float = 1.0,
    ) -> None:
        """`tonic` (2n,) is the input without a connected port, `gain` the force (N) per unit of
        output."""
        super().__init__()
        state, self._default_tonic = oscillators.start, np.array(tonic, dtype=float)
        self._gain, inputs = float(gain), self._default_tonic.size
        # The kernel writes to these arrays at every call.
        parts, self._rates = Packed((oscillators, make_states(oscillators))), state.copy()
        self._compute_rates = machine_code(
            state_rates, parts, state, self._default_tonic, self._rates
        )
        self._compute_signals = machine_code(
            state_signals, parts, state, self._gain, np.empty(inputs // 2)
        )
        self._tonic = self.DeclareVectorInputPort("tonic", inputs)
        self._feedback = self.DeclareVectorInputPort("feedback", inputs)
        self.DeclareContinuousState(BasicVector(state))
        sources = {self.xc_ticket()}
        self.DeclareVectorOutputPort("signals", inputs // 2, self._calc_signals, sources)

    def DoCalcTimeDerivatives(self, context: Context, derivatives: ContinuousState) -> None:
        """Writes the rates of the oscillators' states to `derivatives`."""
        inputs, state = self._default_tonic, context.get_continuous_state_vector().value()
        if self._tonic.HasValue(context):
            inputs = self._tonic.Eval(context)
        if self._feedback.HasValue(context):
            inputs = inputs + self._feedback.Eval(context)
        self._compute_rates(state, inputs, self._rates)
        derivatives.SetFromVector(self._rates)

    def _calc_signals(self, context: Context, output: BasicVector) -> None:
        state = context.get_continuous_state_vector().value()
        self._compute_signals(state, self._gain, output.get_mutable_value())
