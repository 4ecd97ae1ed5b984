"""The oscillators of a robot: which cables each drives, and which of them inhibit each other."""

from __future__ import annotations

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

    names: tuple[str, ...]
    """Such as "T1-T2", or "T1-T2 outer bottom_left" where a junction has several groups."""
    cables: tuple[str, ...]
    """Cables of each oscillator, such as "T1-T2 outer bottom_left + T1-T2 outer bottom_right"."""
    drivers: np.ndarray
    """(cables,): the oscillator that drives each cable of the robot, PASSIVE if none does."""
    ahead: np.ndarray
    """(m,): the last of the bodies that each oscillator's cables join."""
    sides: np.ndarray
    """(m,): 1.0 for a group on the left of the robot, -1.0 on the right, 0.0 for any other."""
    couplings: np.ndarray
    """(weights, 2): the neurons, inhibited and inhibiting, of each weight, in the order of listing
    B.2: onto each neuron in turn, from the neurons of its own kind in turn."""
    images: np.ndarray
    """(weights,): the weight that is the mirror image of each; itself where there is none."""

    @classmethod
    def of(cls, scenario: Scenario) -> Self:
        """The oscillators of a scenario's robot, within `cpg.reach` of each other."""
        from tetra_drake.physics.cable import PASSIVE  # numba, which no optimiser needs

        layout = scenario.robot.layout()
        drivers = np.full(len(layout.cable_names), PASSIVE)
        for oscillator, cables in enumerate(layout.groups):
            drivers[list(cables)] = oscillator
        couplings = _couplings(layout.distances, scenario.cpg.reach)
        return cls(
            names=layout.oscillators,
            cables=tuple(
                " + ".join(layout.cable_names[cable] for cable in cables)
                for cables in layout.groups
            ),
            drivers=drivers,
            ahead=np.array([layout.bodies[list(cables)].max() for cables in layout.groups], int),
            sides=layout.sides,
            couplings=couplings,
            images=_images(couplings, layout),
        )

    @property
    def weight_names(self) -> tuple[str, ...]:
        """Names of `couplings`: "3->1 extensor" is from oscillator 3 onto 1, counting from 1."""
        pairs = self.couplings.tolist()
        return tuple(f"{j // 2 + 1}->{i // 2 + 1} {KINDS[i % 2]}" for i, j in pairs)


def _couplings(distances: np.ndarray, reach: int | None) -> np.ndarray:
    """The `couplings` of oscillators at these distances (m, m); all if `reach` is None."""
    distance, kind = np.kron(distances, np.ones((2, 2))), np.arange(2 * len(distances)) % 2
    coupled = (kind[:, np.newaxis] == kind) & ~np.eye(len(kind), dtype=bool)
    return np.argwhere(coupled if reach is None else coupled & (distance <= reach))


def _images(couplings: np.ndarray, layout: Layout) -> np.ndarray:
    """The `images` of these couplings: oscillators change places with their mirror images."""
    opposite = [k if image is None else image for k, image in enumerate(layout.images)]
    neurons = (2 * np.array(opposite, int)[:, np.newaxis] + [0, 1]).ravel()
    place = {(i, j): weight for weight, (i, j) in enumerate(couplings.tolist())}
    images = [place.get((i, j), w) for w, (i, j) in enumerate(neurons[couplings].tolist())]
    return np.array(images, dtype=int)
