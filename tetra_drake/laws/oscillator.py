"""Matsuoka network (Eq. 7-9) of n oscillators with 2n neurons.

Neurons 2k and 2k + 1, counted from 0, are the extensor and the flexor of oscillator k. The law of
neuron i, with the output y = max(0, u) and weights w:

    tau_A du_i/dt = u0_i + f_i - u_i - beta v_i - sum_j w_ij y_j
    tau_B dv_i/dt = y_i - v_i

The tonic input is u0, the feedback f. The signal of an oscillator is `cpg.gain` times
y_extensor - y_flexor.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple, Protocol, Self, TypeAlias

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from tetra_drake.kernels.compiling import compiled, inlined
from tetra_drake.kernels.lanes import Real, Table, Truth, maximum, select
from tetra_drake.kernels.packed import Packed, unpacked
from tetra_drake.laws.feedback import Pathway
from tetra_drake.settings.quantities import ForceQuantity, Time
from tetra_drake.settings.refusals import refuse
from tetra_drake.settings.section import Section

U, V, U_RATE, V_RATE, Y, U_START, V_START, U_SUM, V_SUM, NEURON_COLUMNS = range(10)
"""Columns of the table `neurons` (2n, 9), and their number: inner state u, self-inhibition v, their
rates (1/s), output y, u and v at the beginning of a step, sums of their rates."""


LARGEST_GAIN = 1.0
"""Largest absolute value of a feedback gain in random gaits."""

TAU_B_PER_TAU_A = 2.0
"""Ratio of the time constants in the thesis. With it the output resembles a sine wave."""

LEAST_TAU = 1e-9
"""Least time constant (s) of a neuron."""

NEURONS = "extensor", "flexor"
"""Kinds of neurons, by index modulo 2."""


class GaitParameter(NamedTuple):
    """A number of a gait, as searches see it, in SI units."""

    low: float
    """Least value in random gaits; equal to `high` if it is fixed."""
    high: float
    floor: float = -math.inf
    """Limit that searches keep it above."""
    least: float = -math.inf
    """Smaller values are refused."""
    unit: str = ""
    copies: str = ""
    """Name of an earlier parameter that it is always equal to in random and evolved gaits."""
    leader: str = ""
    """Name of an earlier parameter that it follows: random gaits have `ratio` times its value."""
    ratio: float = 1.0
    coupled: bool = True
    """True if evolved gaits have this ratio, too."""
    default: float | None = None
    """Value if a gait file does not have it."""

    @property
    def has_default(self) -> bool:
        """True if a gait file need not have it."""
        return bool(self.leader) or self.default is not None

    def default_among(self, values: Mapping[str, float]) -> float:
        """Value if a gait file does not have it, by the values of earlier parameters."""
        return self.ratio * values[self.leader] if self.leader else self.default or 0.0


class GaitBounds(Section):
    """Ranges of the parameters of random gaits (Table 5 of the thesis). Equal bounds fix a
    parameter."""

    weight_min: float = Field(ge=0)
    """Least weight of the inhibition between oscillators."""
    weight_max: float = Field(ge=0)
    """Greatest weight of the inhibition between oscillators."""
    tau_a_min: Time = Field(gt=0)
    """Least time constant tau_A of the inner state u of an oscillator."""
    tau_a_max: Time = Field(gt=0)
    """Greatest time constant tau_A of the inner state u of an oscillator."""
    turn: float = Field(default=0.0, ge=-1, le=1)
    """Steering of all random and evolved gaits, -1 to 1. Left oscillators get the input u0 (1 +
    turn), right ones u0 (1 - turn)."""
    mirrored: bool = False
    """True if random and evolved gaits have the same weights on the left and on the right."""
    independent_tau_b: bool = False
    """True if tau_B, the time constant of self-inhibition, evolves by itself. Otherwise it stays at
    2 tau_A."""

    @model_validator(mode="after")
    def _check(self) -> GaitBounds:
        for name, unit in {"weight": "", "tau_a": " s"}.items():
            low, high = getattr(self, f"{name}_min"), getattr(self, f"{name}_max")
            if low > high:
                problem = f"found {low}{unit}, expected at most {name}_max, {high}{unit}"
                refuse(f"{name}_min", problem)
        return self


_ANY = GaitBounds(weight_min=0.0, weight_max=0.0, tau_a_min=LEAST_TAU, tau_a_max=LEAST_TAU)
"""Bounds where no gaits are random."""


class Wiring(Protocol):
    """Oscillators of a robot and the cables that they drive; see scenario.blueprint.Blueprint."""

    @property
    def signals(self) -> int: ...
    @property
    def images(self) -> Sequence[int | None]: ...
    @property
    def distances(self) -> np.ndarray: ...


class CpgSection(Section):
    """Settings of the Matsuoka oscillators (Table 4 of the thesis), and of how their signals reach
    the cables."""

    self_inhibition_weight: float = Field(ge=0)
    """Weight beta of the self-inhibition v."""
    external_input: float
    """Tonic input u0 of all neurons."""
    initial_state: Annotated[list[float], Field(min_length=3, max_length=3)]
    """Initial values: u of every neuron, v of the extensors, v of the flexors."""
    partner_weight: float = Field(ge=0)
    """Weight of the inhibition between extensor and flexor of an oscillator."""
    gain: ForceQuantity
    """Signal (a force) of an oscillator per unit of its output y_extensor - y_flexor."""
    start_up: Time = Field(ge=0)
    """Time until which the cables are not actuated."""
    signals: Literal["listing", "live"]
    """How the signals are computed. `listing`: before the simulation, by forward Euler, as in the
    thesis's listing. `live`: integrated with the robot, as feedback needs it."""
    listing_step: Time = Field(ge=1e-6)
    """Time step of signals that are computed beforehand."""
    reach: int | None = Field(default=None, ge=0)
    """Oscillators at most this far apart inhibit each other (see Blueprint.distances); all if not
    given."""
    feedback: list[Pathway] = Field(default=[])
    """Pathways of feedback; their gains are parameters of the gait."""

    @model_validator(mode="after")
    def _check(self) -> CpgSection:
        if self.feedback and self.signals != "live":
            refuse("signals", f"found '{self.signals}', expected 'live' for feedback")
        return self

    @property
    def usual_amplitude(self) -> float:
        """Typical amplitude (N) of the signals; 0.44 to 0.53 times gain and tonic input in random
        gaits."""
        return abs(self.gain) * 0.5 * abs(self.external_input)

    def parameters(
        self, wiring: Wiring, bounds: GaitBounds | None = None
    ) -> Mapping[str, GaitParameter]:
        """Parameters of a gait by name: weights, gains of the feedback, time constants. `bounds`
        are of random gaits; floors are from listing A.3 of the thesis."""
        bounds = bounds or _ANY
        weights, low = Weights(wiring, self.reach), bounds.tau_a_min
        names = [f"weight {name}" for name in weights.names]
        weight = GaitParameter(bounds.weight_min, bounds.weight_max, floor=0.0, least=0.0)
        found = dict.fromkeys(names, weight)
        for place, image in enumerate(weights.images.tolist() if bounds.mirrored else ()):
            if image < place:
                found[names[place]] = weight._replace(copies=names[image])
        gain = GaitParameter(-LARGEST_GAIN, LARGEST_GAIN, default=0.0)
        found |= {f"gain {name}": gain for name in self.feedback}
        tau = GaitParameter(low, bounds.tau_a_max, floor=low, least=LEAST_TAU, unit="s")
        follower = tau._replace(
            **{key: TAU_B_PER_TAU_A * getattr(tau, key) for key in ("low", "high", "floor")},
            leader="tau_A",
            ratio=TAU_B_PER_TAU_A,
            coupled=not bounds.independent_tau_b,
        )
        return found | {"tau_A": tau, "tau_B": follower}

    def network(self, wiring: Wiring, gait: Mapping[str, float]) -> Network:
        """Constants of the network that a gait gives a robot. `gait` has the parameters by name."""
        neurons, weights = np.arange(2 * wiring.signals), Weights(wiring, self.reach)
        inhibition = np.zeros((neurons.size, neurons.size))
        inhibition[neurons, neurons ^ 1] = self.partner_weight
        inhibition[tuple(weights.couplings.T)] = [gait[f"weight {name}"] for name in weights.names]
        return Network.of(
            inhibition,
            tau_a=gait["tau_A"],
            tau_b=gait["tau_B"],
            self_inhibition_weight=self.self_inhibition_weight,
        )

    def initial_neurons(self, oscillators: int) -> np.ndarray:
        """State (4n,) at t = 0 of the 2n neurons of n = `oscillators` oscillators: the inner states
        u of all neurons, then the self-inhibitions v. Extensor and flexor alternate.

        The numbers are from Table 4 of the thesis.
        """
        inner_state, extensor_self_inhibition, flexor_self_inhibition = self.initial_state
        u = np.full(2 * oscillators, inner_state)
        v = np.tile([extensor_self_inhibition, flexor_self_inhibition], oscillators)
        return np.concatenate([u, v])


@dataclass(frozen=True)
class Weights:
    """Connections between the oscillators of a robot. A gait has a weight for each connection."""

    wiring: Wiring
    reach: int | None
    """Largest distance between oscillators that inhibit each other, counted in steps between
    oscillators that share a body; None for no limit."""

    @functools.cached_property
    def couplings(self) -> np.ndarray:
        """Indices of the two neurons of each weight (weights, 2): the inhibited one, then the
        inhibiting one. The neurons 2k and 2k + 1 are extensor and flexor of oscillator k.

        Weights are sorted by inhibited neuron, then by inhibiting neuron, as in listing B.2 of the
        thesis. Both neurons of a weight have the same kind.
        """
        kind = np.arange(2 * self.wiring.signals) % 2
        coupled = (kind[:, np.newaxis] == kind) & ~np.eye(len(kind), dtype=bool)
        if self.reach is not None:
            coupled &= np.kron(self.wiring.distances, np.ones((2, 2))) <= self.reach
        return np.argwhere(coupled)

    @functools.cached_property
    def images(self) -> np.ndarray:
        """Index of the mirror image of each weight (weights,): the weight between the oscillators
        on the robot's other side, left and right exchanged. A weight without an image has its own
        index."""
        images = self.wiring.images
        opposite = [k if image is None else image for k, image in enumerate(images)]
        neurons = np.add.outer(2 * np.array(opposite, dtype=int), [0, 1]).ravel()
        index = {(i, j): weight for weight, (i, j) in enumerate(self.couplings.tolist())}
        pairs = neurons[self.couplings].tolist()
        return np.array([index.get((i, j), w) for w, (i, j) in enumerate(pairs)], dtype=int)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the weights: with "3->1 extensor", the extensor of oscillator 3 inhibits the
        extensor of oscillator 1. Oscillators are counted from 1."""
        pairs = self.couplings.tolist()
        return tuple(f"{j // 2 + 1}->{i // 2 + 1} {NEURONS[i % 2]}" for i, j in pairs)


class Network(NamedTuple):
    """Constants of a Matsuoka network with n oscillators, as tables with a row for each of its 2n
    neurons."""

    first: Table
    """Index of the first neuron that inhibits each neuron (2n,)."""
    beyond: Table
    """Index of the last neuron that inhibits each neuron, plus 1 (2n,); 0 if there is none."""
    inhibition: Table
    """Weights W (2n, 2n): W[i, j] is the inhibition of neuron i by neuron j."""
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
        constants tau_A and tau_B (s), and the weight beta of its self-inhibition. The last three
        are one number, or one per neuron.

        Raises ValueError if the shape of `inhibition` is not (2n, 2n), or a time constant is not
        above 0.
        """
        matrix = np.array(inhibition, dtype=float)
        if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or matrix.shape[0] % 2:
            raise ValueError(f"found inhibition of shape {matrix.shape}, expected (2n, 2n)")
        for name, tau in (("tau_a", tau_a), ("tau_b", tau_b)):
            if not np.all(np.asarray(tau) > 0.0):
                raise ValueError(f"found {tau!r} s as {name}, expected more than 0")
        neurons, inhibiting = len(matrix), [np.flatnonzero(row) for row in matrix]
        first = np.array([row[0] if row.size else 0 for row in inhibiting], dtype=np.int64)
        beyond = np.array([row[-1] + 1 if row.size else 0 for row in inhibiting], dtype=np.int64)
        return cls(
            first,
            beyond,
            matrix,
            per_tau_a=np.full(neurons, 1.0 / np.asarray(tau_a)),
            per_tau_b=np.full(neurons, 1.0 / np.asarray(tau_b)),
            self_inhibition_weight=np.full(neurons, self_inhibition_weight, dtype=float),
        )


NetworkParts: TypeAlias = Packed[tuple[Network, Table]]
"""Network and table `neurons`, packed for kernels."""


def make_neurons(state: np.ndarray) -> np.ndarray:
    """New table `neurons` (2n, 9) for the kernels. `state` (4n,) is the inner states u of all
    neurons, then their self-inhibitions v. The other columns are 0."""
    neurons = np.zeros((state.size // 2, NEURON_COLUMNS))
    neurons[:, U], neurons[:, V] = state.reshape(2, -1)
    return neurons


@inlined
def steered_input(external_input: Real, turn: Table, side: Table) -> Table:
    """Tonic input of a neuron that steers a robot, as in the steering of snakes (arXiv 2207.04899):
    external_input (1 + turn side).

    `external_input` is the input u0 without steering, `turn` the steering (-1 to 1). `side` is 1
    for a neuron on the left, -1 on the right, 0 for neither, so a positive `turn` raises the input
    on the left. Arguments are numbers or arrays.
    """
    return external_input * (1.0 + turn * side)


@compiled
def neuron_rates(network: Network, inputs: Table, neurons: Table) -> None:
    """Writes the rates (1/s) of inner state u and self-inhibition v, and the output y, of each
    neuron to the table `neurons` (2n, 9), which has u and v (Eq. 7 of the thesis).

    The sign of u in Eq. 7 is a misprint: du/dt has the term -u, as in the thesis's listing B.2.
    `inputs` (2n,) is the sum of tonic input u0 and feedback f.
    """
    count = neurons.shape[0]
    for i in range(count):
        neurons[i, Y] = maximum(neurons[i, U], 0.0)
    for i in range(count):
        u, v, y = neurons[i, U], neurons[i, V], neurons[i, Y]
        total = inputs[i] - u - network.self_inhibition_weight[i] * v
        for j in range(network.first[i], network.beyond[i]):
            total -= network.inhibition[i, j] * neurons[j, Y]
        neurons[i, U_RATE] = total * network.per_tau_a[i]
        neurons[i, V_RATE] = (y - v) * network.per_tau_b[i]


@compiled
def oscillator_output(neurons: Table, output: Table) -> None:
    """Writes the output y_extensor - y_flexor of each oscillator to `output` (n,), with y = max(0,
    u) (Eq. 8 and 9 of the thesis). `neurons` (2n, 9) has the inner states u."""
    for k in range(output.size):
        extensor, flexor = neurons[2 * k, U], neurons[2 * k + 1, U]
        output[k] = maximum(extensor, 0.0) - maximum(flexor, 0.0)


@compiled
def network_rates(parts: NetworkParts, state: Table, inputs: Table, rates: Table) -> None:
    """Writes the rates (1/s) of all u, then of all v, to `rates` (4n,). `state` (4n,) is u, then v.

    `inputs` (2n,) is the sum of tonic input u0 and feedback f. `parts` is a Network and a table
    `neurons` (2n, 10), which is overwritten.
    """
    network, neurons = unpacked(parts)
    count = neurons.shape[0]
    for i in range(count):
        neurons[i, U], neurons[i, V] = state[i], state[count + i]
    neuron_rates(network, inputs, neurons)
    for i in range(count):
        rates[i], rates[count + i] = neurons[i, U_RATE], neurons[i, V_RATE]


@compiled
def network_signals(state: Table, gain: Real, signals: Table) -> None:
    """Writes gain (y_extensor - y_flexor) of each oscillator to `signals` (n,), in the unit of
    `gain`. `state` (4n,) is u of all neurons, then v."""
    for k in range(signals.size):
        signals[k] = gain * (maximum(state[2 * k], 0.0) - maximum(state[2 * k + 1], 0.0))


@inlined
def euler_step(network: Network, inputs: Table, step: Real, neurons: Table) -> None:
    """Integrates a network by one step (s) of the forward Euler method, as in listing B.1 of the
    thesis. Updates the table `neurons` (2n, 9). `inputs` (2n,), tonic input plus feedback, are
    constant."""
    neuron_rates(network, inputs, neurons)
    for i in range(neurons.shape[0]):
        neurons[i, U] += step * neurons[i, U_RATE]
        neurons[i, V] += step * neurons[i, V_RATE]


@inlined
def runge_kutta_step(network: Network, inputs: Table, step: Real, neurons: Table) -> None:
    """Integrates a network by one step (s) of the classical Runge-Kutta method of order 4. Updates
    the table `neurons` (2n, 9). `inputs` (2n,), tonic input plus feedback, are constant."""
    for i in range(neurons.shape[0]):
        neurons[i, U_START], neurons[i, V_START] = neurons[i, U], neurons[i, V]
        neurons[i, U_SUM], neurons[i, V_SUM] = 0.0, 0.0
    for stage in range(4):
        weight = (1.0 if stage == 0 or stage == 3 else 2.0) / 6.0
        reach = 1.0 if stage == 2 else 0.5  # of the next stage
        neuron_rates(network, inputs, neurons)
        for i in range(neurons.shape[0]):
            neurons[i, U_SUM] += weight * neurons[i, U_RATE]
            neurons[i, V_SUM] += weight * neurons[i, V_RATE]
            neurons[i, U] = neurons[i, U_START] + reach * step * neurons[i, U_RATE]
            neurons[i, V] = neurons[i, V_START] + reach * step * neurons[i, V_RATE]
    for i in range(neurons.shape[0]):
        neurons[i, U] = neurons[i, U_START] + step * neurons[i, U_SUM]
        neurons[i, V] = neurons[i, V_START] + step * neurons[i, V_SUM]


@compiled
def network_output(
    network: Network, inputs: Table, step: float, listing: bool, neurons: Table, output: Table
) -> None:
    """Writes the outputs y_extensor - y_flexor of a network over time to `output` (samples, n), one
    sample per step (s).

    `inputs` (k, 2n) has the neurons' inputs for the first k steps. Later steps use its last row.
    With `listing`, the method is forward Euler, and sample i is the state after i + 1 steps, as in
    listing B.1 of the thesis. Otherwise the method is Runge-Kutta, and sample i is the state after
    i steps. `neurons` (2n, 9) is the state at the start, and is updated.
    """
    last = inputs.shape[0] - 1
    for i in range(output.shape[0]):
        current = inputs[min(i, last)]
        if listing:
            euler_step(network, current, step, neurons)
        oscillator_output(neurons, output[i])
        if not listing:
            runge_kutta_step(network, current, step, neurons)


@inlined
def predict_neurons(network: Network, inputs: Table, step: Real, neurons: Table) -> None:
    """First half of a step (s) of Heun's method (order 2): an Euler step that updates the table
    `neurons` (2n, 9). `inputs` (2n,), tonic input plus feedback, are taken at the beginning of the
    step. correct_neurons() is the second half."""
    neuron_rates(network, inputs, neurons)
    for i in range(neurons.shape[0]):
        neurons[i, U_START], neurons[i, V_START] = neurons[i, U], neurons[i, V]
        neurons[i, U_SUM], neurons[i, V_SUM] = neurons[i, U_RATE], neurons[i, V_RATE]
        neurons[i, U] += step * neurons[i, U_RATE]
        neurons[i, V] += step * neurons[i, V_RATE]


@inlined
def correct_neurons(
    network: Network, inputs: Table, step: Real, accepted: Truth, neurons: Table
) -> None:
    """Second half of a step (s) of Heun's method, after predict_neurons(). `inputs` (2n,), tonic
    input plus feedback, are taken at the end of the step. In lanes where `accepted` is false, the
    neurons return to their values at the beginning of the step; each lane is a robot."""
    neuron_rates(network, inputs, neurons)
    half = 0.5 * step
    for i in range(neurons.shape[0]):
        u_rate = neurons[i, U_SUM] + neurons[i, U_RATE]
        v_rate = neurons[i, V_SUM] + neurons[i, V_RATE]
        u, v = neurons[i, U_START], neurons[i, V_START]
        neurons[i, U] = select(accepted, u + half * u_rate, u)
        neurons[i, V] = select(accepted, v + half * v_rate, v)
