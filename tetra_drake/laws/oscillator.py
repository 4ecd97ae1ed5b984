"""Oscillators of any kind: their settings, the parameters of their gaits, and their integration.

A kind is a section of settings that derives from CpgKind, with two functions for kernels: the rates
of its states, and its outputs. To add a kind, write one file such as laws.phase, with settings,
parameters(), network() and an OscillatorFunctions. All engines, the diagram's
LeafSystem and searches take everything from there. A plug-in names the class by an entry point; the
package's own kinds are in scenario.world.

Each oscillator has two inputs, which are tonic input plus feedback. A Matsuoka oscillator has two
neurons for them. Feedback with opposite signs on both shifts or entrains the oscillator; feedback
with the same signs excites it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, NamedTuple, Protocol, TypeAlias, cast

import numpy as np
from pydantic import Field, model_validator

from tetra_drake.kernels.compiling import compiled, inlined
from tetra_drake.kernels.lanes import Real, Table, Truth, select
from tetra_drake.kernels.own import OwnFunctions, with_own
from tetra_drake.kernels.packed import Packed, unpacked
from tetra_drake.laws.feedback import Pathway
from tetra_drake.settings.quantities import ForceQuantity, Time
from tetra_drake.settings.refusals import refuse
from tetra_drake.settings.section import Section

VALUE, RATE, START, SUM, OUTPUT, STATE_COLUMNS = range(6)
"""Columns of the table `states` (s, 5), and their number: value of a state of the oscillators, its
rate per s, value at the beginning of a step, sum of rates, and a number for the kind's own use."""

LARGEST_GAIN = 1.0
"""Largest absolute value of a feedback gain in random gaits."""


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
    """Value if a gait does not have it. One that follows another has `ratio` times its value."""


class GaitBounds(Section):
    """Ranges of the parameters of random gaits (Table 5 of the thesis). Equal bounds fix a
    parameter."""

    weight_min: float = Field(ge=0)
    """Least weight of the inhibition between oscillators."""
    weight_max: float = Field(ge=0)
    """Greatest of these weights."""
    tau_a_min: Time = Field(gt=0)
    """Least tau_A, the time constant of an oscillator's inner state u."""
    tau_a_max: Time = Field(gt=0)
    """Greatest tau_A."""
    turn: float = Field(default=0.0, ge=-1, le=1)
    """Steering of all random and evolved gaits. Left oscillators get the input u0 (1 + turn), right
    ones u0 (1 - turn)."""
    mirrored: bool = False
    """True if random and evolved gaits have the same weights left and right."""
    independent_tau_b: bool = False
    """True if tau_B, the time constant of self-inhibition, evolves. Otherwise it is 2 tau_A."""

    @model_validator(mode="after")
    def _check(self) -> GaitBounds:
        for name, unit in {"weight": "", "tau_a": " s"}.items():
            low, high = getattr(self, f"{name}_min"), getattr(self, f"{name}_max")
            if low > high:
                problem = f"found {low}{unit}, expected at most {name}_max, {high}{unit}"
                refuse(f"{name}_min", problem)
        return self


class Wiring(Protocol):
    """Oscillators of a robot and the cables that they drive; see scenario.blueprint.Blueprint."""

    @property
    def signals(self) -> int: ...
    @property
    def images(self) -> Sequence[int | None]: ...
    @property
    def distances(self) -> np.ndarray: ...


@dataclass(frozen=True)
class OscillatorFunctions(OwnFunctions):
    """Functions of a kind of n oscillators. Their last argument is a NamedTuple of the kind's
    constants, tables for all oscillators of a robot."""

    rates: Callable[[Table, Table, Any], None]
    """rates(inputs, states, constants) writes the column RATE of `states` (s, 5), and may use the
    column OUTPUT. `inputs` (2n,) are both inputs of each oscillator."""
    outputs: Callable[[Table, Table, Any], None]
    """outputs(states, outputs, constants) writes the output of each oscillator to `outputs` (n,):
    its signal, divided by `cpg.gain`. It depends on the column VALUE only."""


class Oscillators(NamedTuple):
    """Oscillators of a robot with the gait's numbers, for kernels."""

    own: OscillatorFunctions
    constants: Any
    """NamedTuple of tables."""
    start: Table
    """States (s,) at t = 0."""
    gains: Table
    """Gains of the feedback, in the order of laws.feedback.PATHWAYS."""


class CpgKind(Section):
    """Base class of the settings of a kind of oscillators, and of how their signals reach the
    cables."""

    own: ClassVar[OscillatorFunctions]
    mirrors: ClassVar[bool] = False
    """True if gaits can be the same on the left and on the right (`gait_bounds.mirrored`)."""
    gain: ForceQuantity
    """Signal (a force) of an oscillator per unit of its output."""
    start_up: Time = Field(default=1.25, ge=0)
    """Time until which the cables are not actuated."""
    signals: Literal["listing", "live"] = "live"
    """How signals are computed: `listing`, beforehand by forward Euler, as the thesis's code does;
    or `live`, integrated with the robot."""
    listing_step: Time = Field(default=5e-4, ge=1e-6)
    """Time step of `listing`."""
    feedback: list[Pathway] = Field(default=[])
    """Pathways of feedback; their gains are parameters of the gait."""

    @model_validator(mode="after")
    def _check_feedback(self) -> CpgKind:
        if self.feedback and self.signals != "live":
            refuse("signals", f"found '{self.signals}', expected 'live' for feedback")
        return self

    @property
    def tonic(self) -> float:
        """Tonic input u0 of all oscillators without steering."""
        return 1.0

    @property
    def usual_amplitude(self) -> float:
        """Typical amplitude (N) of the signals; they are at most about twice as large."""
        raise NotImplementedError

    def gain_parameters(self) -> dict[str, GaitParameter]:
        """Gains of the feedback, as parameters of a gait."""
        gain = GaitParameter(-LARGEST_GAIN, LARGEST_GAIN, default=0.0)
        return {f"gain {name}": gain for name in self.feedback}

    def parameters(
        self, wiring: Wiring, bounds: GaitBounds | None = None
    ) -> Mapping[str, GaitParameter]:
        """Parameters of a gait for a robot by name, with `gain_parameters` among them. `bounds` are
        of random gaits; None where no gait is random."""
        raise NotImplementedError

    def network(self, wiring: Wiring, gait: Mapping[str, float]) -> tuple[Any, np.ndarray]:
        """The oscillators that the parameters of a gait give a robot: a NamedTuple of tables that
        the functions `own` get, and the states (s,) at t = 0. Tables of integers are the same for
        all gaits of a robot."""
        raise NotImplementedError


rates = cast(Callable[[Oscillators, Table, Table], None], with_own("rates"))
"""rates(oscillators, inputs, states); see OscillatorFunctions."""

outputs_of = cast(Callable[[Oscillators, Table, Table], None], with_own("outputs"))
"""outputs_of(oscillators, states, outputs); see OscillatorFunctions."""


def make_states(oscillators: Oscillators) -> np.ndarray:
    """New table `states` (s, 5) for the kernels, at t = 0. The other columns are 0."""
    states = np.zeros((oscillators.start.size, STATE_COLUMNS))
    states[:, VALUE] = oscillators.start
    return states


@inlined
def steered_input(tonic: Real, turn: Table, side: Table) -> Table:
    """Tonic input that steers a robot, as in the steering of snakes (arXiv 2207.04899):
    tonic (1 + turn side).

    `tonic` is the input u0 without steering, `turn` the steering (-1 to 1). `side` is 1 for an
    oscillator on the left, -1 on the right, 0 for neither, so a positive `turn` raises the input
    on the left. Arguments are numbers or arrays.
    """
    return tonic * (1.0 + turn * side)


StateParts: TypeAlias = Packed[tuple[Oscillators, Table]]
"""Oscillators and their table `states`, packed for kernels."""


@compiled
def state_rates(parts: StateParts, values: Table, inputs: Table, derivatives: Table) -> None:
    """Writes the rates per s of the states `values` (s,) of oscillators to `derivatives` (s,). The
    `inputs` (2n,) are tonic inputs plus feedback. The table of `parts` is overwritten."""
    oscillators, states = unpacked(parts)
    for i in range(values.size):
        states[i, VALUE] = values[i]
    rates(oscillators, inputs, states)
    for i in range(values.size):
        derivatives[i] = states[i, RATE]


@compiled
def state_signals(parts: StateParts, values: Table, gain: float, signals: Table) -> None:
    """Writes the signals (n,) of oscillators, `gain` times their outputs, for the states `values`
    (s,). The table of `parts` is overwritten."""
    oscillators, states = unpacked(parts)
    for i in range(values.size):
        states[i, VALUE] = values[i]
    outputs_of(oscillators, states, signals)
    for k in range(signals.size):
        signals[k] *= gain


@inlined
def euler_step(oscillators: Oscillators, inputs: Table, step: Real, states: Table) -> None:
    """Integrates oscillators by one step (s) of the forward Euler method, as in listing B.1 of the
    thesis, which updates the table `states` (s, 5). `inputs` (2n,) are those at its beginning. Also
    the first half of a step of Heun's method (order 2); correct_states() is the second half."""
    rates(oscillators, inputs, states)
    for i in range(states.shape[0]):
        states[i, START], states[i, SUM] = states[i, VALUE], states[i, RATE]
        states[i, VALUE] += step * states[i, RATE]


@inlined
def runge_kutta_step(oscillators: Oscillators, inputs: Table, step: Real, states: Table) -> None:
    """Integrates oscillators by one step (s) of the classical Runge-Kutta method of order 4, which
    updates the table `states` (s, 5). `inputs` (2n,) are constant."""
    for i in range(states.shape[0]):
        states[i, START], states[i, SUM] = states[i, VALUE], 0.0
    for stage in range(4):
        weight = (1.0 if stage == 0 or stage == 3 else 2.0) / 6.0
        reach = 1.0 if stage == 2 else 0.5  # of the next stage
        rates(oscillators, inputs, states)
        for i in range(states.shape[0]):
            states[i, SUM] += weight * states[i, RATE]
            states[i, VALUE] = states[i, START] + reach * step * states[i, RATE]
    for i in range(states.shape[0]):
        states[i, VALUE] = states[i, START] + step * states[i, SUM]


@compiled
def write_outputs(
    parts: StateParts, inputs: Table, step: float, listing: bool, outputs: Table
) -> None:
    """Writes the outputs of oscillators over time to `outputs` (samples, n), one sample per step
    (s).

    `inputs` (k, 2n) are for the first k steps. Later steps use the last row. With `listing`, the
    method is forward Euler, and sample i is the state after i + 1 steps, as in listing B.1 of the
    thesis. Otherwise the method is Runge-Kutta, and sample i is the state after i steps. The table
    of `parts` is the state at the start, and is updated.
    """
    oscillators, states = unpacked(parts)
    last = inputs.shape[0] - 1
    for i in range(outputs.shape[0]):
        current = inputs[min(i, last)]
        if listing:
            euler_step(oscillators, current, step, states)
        outputs_of(oscillators, states, outputs[i])
        if not listing:
            runge_kutta_step(oscillators, current, step, states)


@inlined
def correct_states(
    oscillators: Oscillators, inputs: Table, step: Real, accepted: Truth, states: Table
) -> None:
    """Second half of a step (s) of Heun's method, after euler_step(). `inputs` (2n,) are taken
    at the end of the step. In lanes where `accepted` is false, the states return to their values at
    the beginning of the step; each lane is a robot."""
    rates(oscillators, inputs, states)
    half = 0.5 * step
    for i in range(states.shape[0]):
        rate, start = states[i, SUM] + states[i, RATE], states[i, START]
        states[i, VALUE] = select(accepted, start + half * rate, start)
