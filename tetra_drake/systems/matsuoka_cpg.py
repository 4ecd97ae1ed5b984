"""Central pattern generator of Matsuoka oscillators, as a LeafSystem."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from pydrake.systems.framework import Context

from tetra_drake.laws.matsuoka import Matsuoka, Network
from tetra_drake.laws.oscillator import Oscillators
from tetra_drake.systems.attachment import DeclareOutput
from tetra_drake.systems.oscillator_cpg import OscillatorCpg


class MatsuokaCpg(OscillatorCpg):
    """Network of n Matsuoka oscillators (thesis Eq. 7-9).

    | port     | in, out | shape | unit | meaning                                               |
    |----------|---------|-------|------|-------------------------------------------------------|
    | tonic    | in      | (2n,) | 1    | u0 of thesis Eq. 7, by neuron; without a connection   |
    |          |         |       |      | `tonic` of the constructor                            |
    | feedback | in      | (2n,) | 1    | f of thesis Eq. 7, by neuron; without a connection 0  |
    | signals  | out     | (n,)  | N    | gain * (y_extensor - y_flexor), by oscillator         |
    | neurons  | out     | (2n,) | 1    | outputs y = max(0, u) of the neurons                  |

    Neurons 2k and 2k + 1 are the extensor and the flexor of oscillator k, from 0 on. The continuous
    state is u (2n,), then v (2n,): inner states and self-inhibitions. OscillatorCpg says what all
    kinds have in common, and diagrams/entrainment.py has a loop around a single oscillator.
    """

    def __init__(
        self,
        network: Network,
        *,
        tonic: npt.ArrayLike,
        initial_state: npt.ArrayLike,
        gain: float = 1.0,
    ) -> None:
        """`network` has the constants of the neurons and their connections. `tonic` is the input
        u0 without a connected port: a number, or a value per neuron.
        `initial_state` (4n,) is u of all neurons, then v. `gain` is the force (N) per unit of y."""
        neurons = len(network.per_tau_a)
        if (shape := np.shape(initial_state)) != (2 * neurons,):
            expected = f"({2 * neurons},) for {neurons} neurons"
            raise ValueError(f"found initial_state of shape {shape}, expected {expected}")
        inputs = np.full(neurons, tonic, dtype=float)
        start = np.array(initial_state, dtype=float)
        oscillators = Oscillators(Matsuoka.own, network, start, gains=np.zeros(0))
        super().__init__(oscillators, tonic=inputs, gain=gain)
        DeclareOutput(self, "neurons", neurons, MatsuokaCpg._outputs, {self.xc_ticket()})

    def _outputs(self, context: Context) -> np.ndarray:
        """Outputs y of the neurons (2n,)."""
        return context.get_continuous_state_vector().value()[: self._default_tonic.size].clip(0.0)
