"""The oscillators of a robot: which cables each drives, and which of them inhibit each other."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Self

import numpy as np

from tetra_drake.scenario.layout import Layout
from tetra_drake.scenario.schema import Scenario

KINDS = "extensor", "flexor"
"""Kinds of neurons, by their number modulo 2."""


@dataclass(frozen=True)
class Actuation:
    """m oscillators and the cables that they drive."""

    layout: Layout
    reach: int | None
    """The greatest distance between oscillators that inhibit each other; None for any."""

    @classmethod
    def of(cls, scenario: Scenario) -> Self:
        """The oscillators of a scenario's robot, within `cpg.reach` of each other."""
        return cls(scenario.robot.layout(), scenario.cpg.reach)

    @property
    def names(self) -> tuple[str, ...]:
        """Such as "T1-T2", or "T1-T2 outer bottom_left" where a junction has several groups."""
        return self.layout.oscillators

    @property
    def cables(self) -> tuple[str, ...]:
        """Cables of each oscillator, such as "T1-T2 outer top + T1-T2 inner top"."""
        names = self.layout.cable_names
        return tuple(" + ".join(names[cable] for cable in group) for group in self.layout.groups)

    @functools.cached_property
    def drivers(self) -> np.ndarray:
        """(cables,): the oscillator that drives each cable of the robot, PASSIVE if none does."""
        from tetra_drake.physics.cable import PASSIVE  # numba, which no optimiser needs

        drivers = np.full(len(self.layout.cable_names), PASSIVE)
        for oscillator, cables in enumerate(self.layout.groups):
            drivers[list(cables)] = oscillator
        return drivers

    @functools.cached_property
    def ahead(self) -> np.ndarray:
        """(m,): the last of the bodies that each oscillator's cables join."""
        last = [self.layout.bodies[list(cables)].max() for cables in self.layout.groups]
        return np.array(last, dtype=np.int64)

    @functools.cached_property
    def sides(self) -> np.ndarray:
        """(m,): 1.0 for a group on the left of the robot, -1.0 on the right, 0.0 for any other."""
        return self.layout.sides

    @functools.cached_property
    def couplings(self) -> np.ndarray:
        """(weights, 2): the neurons, inhibited and inhibiting, of each weight, in the order of
        listing B.2: onto each neuron in turn, from the neurons of its own kind in turn."""
        kind = np.arange(2 * len(self.names)) % 2
        coupled = (kind[:, np.newaxis] == kind) & ~np.eye(len(kind), dtype=bool)
        if self.reach is not None:
            coupled &= np.kron(self.layout.distances, np.ones((2, 2))) <= self.reach
        return np.argwhere(coupled)

    @functools.cached_property
    def images(self) -> np.ndarray:
        """(weights,): the weight that is the mirror image of each; itself where there is none."""
        images = self.layout.images
        opposite = [k if image is None else image for k, image in enumerate(images)]
        neurons = (2 * np.array(opposite, dtype=int)[:, np.newaxis] + [0, 1]).ravel()
        place = {(i, j): weight for weight, (i, j) in enumerate(self.couplings.tolist())}
        pairs = neurons[self.couplings].tolist()
        return np.array([place.get((i, j), w) for w, (i, j) in enumerate(pairs)], dtype=int)

    @property
    def weight_names(self) -> tuple[str, ...]:
        """Names of `couplings`: "3->1 extensor" is from oscillator 3 onto 1, counting from 1."""
        pairs = self.couplings.tolist()
        return tuple(f"{j // 2 + 1}->{i // 2 + 1} {KINDS[i % 2]}" for i, j in pairs)
