"""Matsuoka oscillators (Eq. 7-9): pairs of neurons that inhibit each other.

Neurons 2k and 2k + 1, counted from 0, are the extensor and the flexor of oscillator k. The law of
neuron i, with the output y = max(0, u) and weights w:

    tau_A du_i/dt = u0_i + f_i - u_i - beta v_i - sum_j w_ij y_j
    tau_B dv_i/dt = y_i - v_i

The tonic input is u0, the feedback f. The sign of u in Eq. 7 is a misprint: du/dt has the term -u,
as in the thesis's listing B.2. The output of an oscillator is y_extensor - y_flexor.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, NamedTuple, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field

from tetra_drake.kernels.compiling import inlined
from tetra_drake.kernels.lanes import Table, maximum
from tetra_drake.laws.feedback import PATHWAYS
from tetra_drake.laws.oscillator import (
    OUTPUT,
    RATE,
    VALUE,
    CpgKind,
    GaitBounds,
    GaitParameter,
    OscillatorFunctions,
    Oscillators,
    Wiring,
)

TAU_B_PER_TAU_A = 2.0
"""Ratio of the time constants in the thesis. With it the output resembles a sine wave."""

LEAST_TAU = 1e-9
"""Least time constant (s) of a neuron."""

NEURONS = "extensor", "flexor"
"""Kinds of neurons, by index modulo 2."""

_ANY = GaitBounds(weight_min=0.0, weight_max=0.0, tau_a_min=LEAST_TAU, tau_a_max=LEAST_TAU)
"""Bounds where no gaits are random."""


def connections(wiring: Wiring, reach: int | None) -> np.ndarray:
    """Indices of the two neurons of each weight (weights, 2): the inhibited one, then the
    inhibiting one. The neurons 2k and 2k + 1 are extensor and flexor of oscillator k. With `reach`,
    only oscillators at most this far apart are connected; see Blueprint.distances.

    Weights are sorted by inhibited neuron, then by inhibiting neuron, as in listing B.2 of the
    thesis. Both neurons of a weight have the same kind.
    """
    kind = np.arange(2 * wiring.signals) % 2
    connected = (kind[:, np.newaxis] == kind) & ~np.eye(len(kind), dtype=bool)
    if reach is not None:
        connected &= np.kron(wiring.distances, np.ones((2, 2))) <= reach
    return np.argwhere(connected)


def weight_names(pairs: np.ndarray, oscillators: Sequence[int]) -> list[str]:
    """Names of the weights between pairs of neurons, see connections(), of `oscillators`. With
    "weight 3->1 extensor", the extensor of oscillator 3 inhibits the extensor of oscillator 1.
    Oscillators are counted from 1 in names."""
    return [
        f"weight {oscillators[j // 2] + 1}->{oscillators[i // 2] + 1} {NEURONS[i % 2]}"
        for i, j in pairs.tolist()
    ]


class Network(NamedTuple):
    """Constants of a Matsuoka network with n oscillators. Most are tables with a row for each of
    its 2n neurons."""

    first: Table
    """Index of the first connection onto each neuron (2n + 1,); the last number is the number c of
    connections."""
    source: Table
    """Index of the neuron from which each connection comes (c,), sorted by the neuron onto which it
    goes, then by this index."""
    weight: Table
    """Weight of each connection (c,)."""
    per_tau_a: Table
    """1 / tau_A (2n,) in 1/s."""
    per_tau_b: Table
    """1 / tau_B (2n,) in 1/s."""
    self_inhibition_weight: Table
    """Weight beta of self-inhibition (2n,)."""

    @classmethod
    def of(
        cls,
        inhibition: npt.ArrayLike,
        *,
        tau_a: npt.ArrayLike,
        tau_b: npt.ArrayLike,
        self_inhibition_weight: npt.ArrayLike,
    ) -> Self:
        """A network from its weights `inhibition` (2n, 2n), of neuron i by neuron j, its time
        constants tau_A and tau_B (s), and the weight beta of its self-inhibition. These three are
        one number, or one per neuron. A weight is NaN where there is no connection.

        Raises ValueError if the shape of `inhibition` is not (2n, 2n), or a time constant is not
        above 0.
        """
        matrix = np.array(inhibition, dtype=float)
        if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or matrix.shape[0] % 2:
            raise ValueError(f"found inhibition of shape {matrix.shape}, expected (2n, 2n)")
        for name, tau in (("tau_a", tau_a), ("tau_b", tau_b)):
            if not np.all(np.asarray(tau) > 0.0):
                raise ValueError(f"found {tau!r} s as {name}, expected more than 0")
        neurons, onto = len(matrix), ~np.isnan(matrix)
        return cls(
            first=np.concatenate([[0], onto.sum(axis=1).cumsum()]).astype(np.int64),
            source=onto.nonzero()[1].astype(np.int64),
            weight=matrix[onto],
            per_tau_a=np.full(neurons, 1.0 / np.asarray(tau_a)),
            per_tau_b=np.full(neurons, 1.0 / np.asarray(tau_b)),
            self_inhibition_weight=np.full(neurons, self_inhibition_weight, dtype=float),
        )


@inlined
def neuron_rates(inputs: Table, states: Table, network: Network) -> None:
    """Writes the rates (1/s) of inner states u and self-inhibitions v to the table `states` (4n,
    5), which has u of all 2n neurons, then v (Eq. 7 of the thesis). The column OUTPUT becomes y.

    `inputs` (2n,) are the sums of tonic input u0 and feedback f.
    """
    count = inputs.size
    for i in range(count):
        states[i, OUTPUT] = maximum(states[i, VALUE], 0.0)
    for i in range(count):
        u, v, y = states[i, VALUE], states[count + i, VALUE], states[i, OUTPUT]
        total = inputs[i] - u - network.self_inhibition_weight[i] * v
        for c in range(network.first[i], network.first[i + 1]):
            total -= network.weight[c] * states[network.source[c], OUTPUT]
        states[i, RATE] = total * network.per_tau_a[i]
        states[count + i, RATE] = (y - v) * network.per_tau_b[i]


@inlined
def neuron_outputs(states: Table, outputs: Table, network: Network) -> None:
    """Writes the output y_extensor - y_flexor of each oscillator to `outputs` (n,), with y = max(0,
    u) (Eq. 8 and 9 of the thesis). `states` (4n, 5) has u of all neurons first."""
    for k in range(outputs.size):
        extensor, flexor = states[2 * k, VALUE], states[2 * k + 1, VALUE]
        outputs[k] = maximum(extensor, 0.0) - maximum(flexor, 0.0)


class Matsuoka(CpgKind):
    """Matsuoka oscillators (Table 4 of the thesis), pairs of neurons. Parameters of a gait are the
    weights between oscillators and the time constants, within `gait_bounds`."""

    own = OscillatorFunctions(Network, neuron_rates, neuron_outputs)
    mirrors = True

    self_inhibition_weight: float = Field(ge=0)
    """Weight beta of the self-inhibition v."""
    external_input: float
    """Tonic input u0 of all neurons."""
    initial_state: Annotated[list[float], Field(min_length=3, max_length=3)]
    """Initial values: u of every neuron, v of the extensors, v of the flexors."""
    partner_weight: float = Field(ge=0)
    """Weight of the inhibition between extensor and flexor of an oscillator."""
    reach: int | None = Field(default=None, ge=0)
    """Oscillators at most this far apart inhibit each other (see Blueprint.distances); by default
    all."""

    @property
    def tonic(self) -> float:
        return self.external_input

    @property
    def usual_amplitude(self) -> float:
        """Typical amplitude (N) of the signals; in random gaits y_extensor - y_flexor reaches 0.44
        to 0.53 times the tonic input."""
        return abs(self.gain) * 0.5 * abs(self.external_input)

    def parameters(
        self, wiring: Wiring, bounds: GaitBounds | None = None
    ) -> Mapping[str, GaitParameter]:
        """Weights, gains of the feedback, and time constants. Floors are from listing A.3 of the
        thesis."""
        bounds = bounds or _ANY
        pairs, low = connections(wiring, self.reach), bounds.tau_a_min
        names = images = weight_names(pairs, range(wiring.signals))
        if bounds.mirrored:
            opposite = [i if k is None else k for i, k in enumerate(wiring.images)]
            images = weight_names(pairs, opposite)
        weight = GaitParameter(bounds.weight_min, bounds.weight_max, floor=0.0, least=0.0)
        found: dict[str, GaitParameter] = {}
        for name, image in zip(names, images, strict=True):
            found[name] = weight._replace(copies=image) if image in found else weight
        tau = GaitParameter(low, bounds.tau_a_max, floor=low, least=LEAST_TAU, unit="s")
        follower = tau._replace(
            **{key: TAU_B_PER_TAU_A * getattr(tau, key) for key in ("low", "high", "floor")},
            leader="tau_A",
            ratio=TAU_B_PER_TAU_A,
            coupled=not bounds.independent_tau_b,
        )
        return found | self.gain_parameters() | {"tau_A": tau, "tau_B": follower}

    def network(self, wiring: Wiring, gait: Mapping[str, float]) -> tuple[Network, np.ndarray]:
        neurons, pairs = np.arange(2 * wiring.signals), connections(wiring, self.reach)
        inhibition = np.full((neurons.size, neurons.size), np.nan)
        inhibition[neurons, neurons ^ 1] = self.partner_weight
        names = weight_names(pairs, range(wiring.signals))
        inhibition[tuple(pairs.T)] = [gait[name] for name in names]
        network = Network.of(
            inhibition,
            tau_a=gait["tau_A"],
            tau_b=gait["tau_B"],
            self_inhibition_weight=self.self_inhibition_weight,
        )
        u, *v = self.initial_state
        return network, np.append(np.full(neurons.size, u), np.tile(v, wiring.signals))


_NONE = Network.of(np.zeros((0, 0)), tau_a=1.0, tau_b=1.0, self_inhibition_weight=0.0)
NO_OSCILLATORS = Oscillators(Matsuoka.own, _NONE, np.zeros(0), np.zeros(len(PATHWAYS)))
"""For robots whose signals are given."""
