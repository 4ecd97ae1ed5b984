"""Network of a gait: which oscillators inhibit each other, its state at the start, its steering."""

from __future__ import annotations

import functools
import numbers
from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.laws.oscillator import CpgSection
from tetra_drake.scenario.blueprint import Blueprint
from tetra_drake.scenario.world import World

NEURONS = "extensor", "flexor"
"""Kinds of neurons, by index modulo 2."""

AMPLITUDE = 0.5
"""Typical amplitude of y_extensor - y_flexor, as a share of the tonic input u0; 0.44 to 0.53 in
random gaits."""

SteeringSignal = Callable[[float], float]
"""Function from time (s) to the turn, -1 to 1."""


@dataclass(frozen=True)
class Weights:
    """Connections between the oscillators of a robot. A gait has a weight for each connection."""

    blueprint: Blueprint
    reach: int | None
    """Largest distance between oscillators that inhibit each other, counted in steps between
    oscillators that share a body; None for no limit."""

    @classmethod
    def of(cls, scenario: World) -> Self:
        """The connections of a scenario's oscillators."""
        return cls(scenario.robot.blueprint(), scenario.cpg.reach)

    @functools.cached_property
    def couplings(self) -> np.ndarray:
        """Indices of the two neurons of each weight (weights, 2): the inhibited one, then the
        inhibiting one. The neurons 2k and 2k + 1 are extensor and flexor of oscillator k.

        Weights are sorted by inhibited neuron, then by inhibiting neuron, as in listing B.2 of the
        thesis. Both neurons of a weight have the same kind.
        """
        kind = np.arange(2 * self.blueprint.signals) % 2
        coupled = (kind[:, np.newaxis] == kind) & ~np.eye(len(kind), dtype=bool)
        if self.reach is not None:
            from scipy.sparse.csgraph import shortest_path

            # Oscillators are at distance 0 if their cables join the same bodies, at distance 1 if
            # they share a body, at distance 2 if both are at distance 1 of a third, and so on.
            joined = [self.blueprint.bodies_at(cables) for cables in self.blueprint.groups]
            shape = len(joined), len(joined)
            near = np.array([[bool(a & b) for b in joined] for a in joined]).reshape(shape)
            same = np.array([[a == b for b in joined] for a in joined]).reshape(shape)
            steps = np.minimum(shortest_path(near, unweighted=True), len(joined))
            distances = np.where(same, 0.0, steps)
            coupled &= np.kron(distances, np.ones((2, 2))) <= self.reach
        return np.argwhere(coupled)

    @functools.cached_property
    def images(self) -> np.ndarray:
        """Index of the mirror image of each weight (weights,): the weight between the oscillators
        on the robot's other side, left and right exchanged. A weight without an image has its own
        index."""
        images = self.blueprint.images
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


def usual_amplitude(cpg: CpgSection) -> float:
    """Typical amplitude (N) of the signals of an oscillator network with these settings."""
    return abs(cpg.gain) * AMPLITUDE * abs(cpg.external_input)


def constant_steering(turn: float) -> SteeringSignal:
    """Steering function that gives the same turn, -1 to 1, at all times; a positive turn raises the
    input of left oscillators. Raises InputError unless the turn is a number; checked_turn() checks
    its limits later."""
    if isinstance(turn, bool) or not isinstance(turn, numbers.Real):
        expected = "a number from -1 to 1, or a function of the time in s"
        raise InputError("steering", "", f"found {turn!r}, expected {expected}")
    return lambda time: turn


def checked_turn(turn: float, *, time: float) -> float:
    """The turn as a float. Raises InputError unless it is a number from -1 to 1; the message names
    the `time` (s) for which a steering function gave it."""
    if not isinstance(turn, numbers.Real) or not abs(turn) <= 1.0:
        raise InputError("steering", f"at {time:g} s", f"found {turn!r:.60}, expected -1 to 1")
    return float(turn)


def initial_neurons(cpg: CpgSection, oscillators: int) -> np.ndarray:
    """State (4n,) at t = 0 of the 2n neurons of n = `oscillators` oscillators: the inner states u
    of all neurons, then the self-inhibitions v. Extensor and flexor alternate.

    The numbers are from the settings `cpg`; their defaults are from Table 4 of the thesis.
    """
    inner_state, extensor_self_inhibition, flexor_self_inhibition = cpg.initial_state
    u = np.full(2 * oscillators, inner_state)
    v = np.tile([extensor_self_inhibition, flexor_self_inhibition], oscillators)
    return np.concatenate([u, v])
