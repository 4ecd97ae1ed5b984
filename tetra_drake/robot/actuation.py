"""The oscillators of a robot: which cables each drives, and which of them inhibit each other."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Self

import numpy as np

from tetra_drake.scenario.cable_names import CABLES, mirrored, side_of
from tetra_drake.scenario.schema import Scenario

KINDS = "extensor", "flexor"
"""Kinds of neurons, by their number modulo 2."""

SIGNS = {"left": 1.0, "right": -1.0, "": 0.0}
"""Signs of the sides of the robot."""


@dataclass(frozen=True)
class Actuation:
    """m oscillators, group by group of each junction, from the rear to the lead."""

    names: tuple[str, ...]
    """Such as "T1-T2", or "T1-T2 outer bottom_left" where a junction has several groups."""
    cables: tuple[str, ...]
    """Cables of each oscillator, such as "T1-T2 outer bottom_left + outer bottom_right"."""
    drivers: np.ndarray
    """(cables,): the oscillator that drives each cable of the robot, PASSIVE if none does."""
    junctions: np.ndarray
    """(m,): of each oscillator, 0 between T1 and T2."""
    sides: np.ndarray
    """(m,): 1.0 for a group on the left of the robot, -1.0 on the right, 0.0 for any other."""
    couplings: np.ndarray
    """(weights, 2): the neurons, inhibited and inhibiting, of each weight, in the order of listing
    B.2: onto each neuron in turn, from the neurons of its own kind in turn."""
    images: np.ndarray
    """(weights,): the weight that is the mirror image of each; itself where there is none."""

    @classmethod
    def of(cls, scenario: Scenario) -> Self:
        """The oscillators of a scenario: `robot.actuation` and `cpg.reach`."""
        groups = tuple(map(tuple, scenario.robot.actuation))
        return cls._of(groups, scenario.robot.tetrahedra - 1, scenario.cpg.reach)

    @classmethod
    @functools.lru_cache(maxsize=8)  # as draws of disturbances leave it as it is
    def _of(cls, groups: tuple[tuple[str, ...], ...], count: int, reach: int | None) -> Self:
        """Oscillators of so many junctions."""
        from tetra_drake.physics.cable import PASSIVE  # numba, which no optimiser needs

        junctions = np.repeat(np.arange(count), len(groups))
        couplings = couplings_within(junctions, reach)
        cables = [f"T{i + 1}-T{i + 2} {' + '.join(g)}" for i in range(count) for g in groups]
        names = cables if len(groups) > 1 else [name.split()[0] for name in cables]
        group_of = {cable: k for k, group in enumerate(groups) for cable in group}
        driving = np.array([group_of.get(cable, PASSIVE) for cable in CABLES])
        is_driven = np.tile(driving != PASSIVE, count)
        first = np.repeat(len(groups) * np.arange(count), len(CABLES))
        return cls(
            names=tuple(names),
            cables=tuple(cables),
            drivers=np.where(is_driven, np.tile(driving, count) + first, PASSIVE),
            junctions=junctions,
            sides=np.tile([SIGNS[side_of(group)] for group in groups], count),
            couplings=couplings,
            images=_images(couplings, groups, junctions),
        )

    @property
    def weight_names(self) -> tuple[str, ...]:
        """Names of `couplings`: "3->1 extensor" is from oscillator 3 onto 1, counting from 1."""
        pairs = self.couplings.tolist()
        return tuple(f"{j // 2 + 1}->{i // 2 + 1} {KINDS[i % 2]}" for i, j in pairs)


def couplings_within(junctions: np.ndarray, reach: int | None) -> np.ndarray:
    """The `couplings` of oscillators of these junctions; all if `reach` is None."""
    junction, kind = np.repeat(junctions, 2), np.arange(2 * len(junctions)) % 2
    far = np.abs(junction[:, np.newaxis] - junction)
    coupled = (kind[:, np.newaxis] == kind) & ~np.eye(len(kind), dtype=bool)
    return np.argwhere(coupled if reach is None else coupled & (far <= reach))


def _images(
    couplings: np.ndarray, groups: tuple[tuple[str, ...], ...], junctions: np.ndarray
) -> np.ndarray:
    """The `images` of these couplings: groups of cables change places with their mirror images."""
    sets = [set(group) for group in groups]
    opposite = []
    for k, group in enumerate(groups):
        image = set(mirrored(group))
        opposite.append(sets.index(image) if image in sets else k)
    count = len(junctions) // len(groups)
    oscillators = np.tile(opposite, count) + len(groups) * junctions
    neurons = (2 * oscillators[:, np.newaxis] + [0, 1]).ravel()
    place = {(i, j): weight for weight, (i, j) in enumerate(couplings.tolist())}
    images = [place.get((i, j), w) for w, (i, j) in enumerate(neurons[couplings].tolist())]
    return np.array(images, dtype=int)
