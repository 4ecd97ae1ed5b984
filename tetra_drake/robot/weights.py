"""Weights of a network: which oscillators inhibit each other, and names of the weights."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Self

import numpy as np

from tetra_drake.scenario.blueprint import Blueprint
from tetra_drake.scenario.scenario import Scenario

NEURONS = "extensor", "flexor"
"""Kinds of neurons, by index modulo 2."""


@dataclass(frozen=True)
class Weights:
    """The weights between the oscillators of a robot."""

    blueprint: Blueprint
    reach: int | None
    """Largest distance between oscillators that inhibit each other; None for no limit."""

    @classmethod
    def of(cls, scenario: Scenario) -> Self:
        """The weights of a scenario's gaits."""
        return cls(scenario.robot.blueprint(), scenario.cpg.reach)

    @functools.cached_property
    def couplings(self) -> np.ndarray:
        """Neurons of each weight (weights, 2): the inhibited one, then the inhibiting one.

        The order is from listing B.2: by inhibited neuron, then by inhibiting neuron. Both neurons
        have the same kind.
        """
        kind = np.arange(2 * self.blueprint.signals) % 2
        coupled = (kind[:, np.newaxis] == kind) & ~np.eye(len(kind), dtype=bool)
        if self.reach is not None:
            coupled &= np.kron(self.blueprint.distances, np.ones((2, 2))) <= self.reach
        return np.argwhere(coupled)

    @functools.cached_property
    def images(self) -> np.ndarray:
        """Index of the mirror image of each weight (weights,); the weight itself if it has none."""
        images = self.blueprint.images
        opposite = [k if image is None else image for k, image in enumerate(images)]
        neurons = (2 * np.array(opposite, dtype=int)[:, np.newaxis] + [0, 1]).ravel()
        index = {(i, j): weight for weight, (i, j) in enumerate(self.couplings.tolist())}
        pairs = neurons[self.couplings].tolist()
        return np.array([index.get((i, j), w) for w, (i, j) in enumerate(pairs)], dtype=int)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the weights: "3->1 extensor" is from oscillator 3 onto 1, counted from 1."""
        pairs = self.couplings.tolist()
        return tuple(f"{j // 2 + 1}->{i // 2 + 1} {NEURONS[i % 2]}" for i, j in pairs)
