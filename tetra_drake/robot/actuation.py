"""The oscillators of a robot: which cables each drives, and which of them inhibit each other."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from tetra_drake.scenario.cable_names import CABLES, SIDES, mirrored
from tetra_drake.scenario.schema import Scenario

KINDS = "extensor", "flexor"
"""Kinds of neurons, by their number modulo 2."""


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
        place = {cable: k for k, group in enumerate(groups) for cable in group}
        own = np.array([place.get(cable, PASSIVE) for cable in CABLES])
        drivers = [np.where(own == PASSIVE, own, own + len(groups) * i) for i in range(count)]
        couplings = couplings_within(junctions, reach)
        sets = [set(group) for group in groups]
        others = [set(mirrored(group)) for group in groups]
        opposite = [sets.index(o) if o in sets else k for k, o in enumerate(others)]
        oscillators = np.tile(opposite, count) + len(groups) * junctions
        neurons = (2 * oscillators[:, np.newaxis] + [0, 1]).ravel()
        index = {pair: i for i, pair in enumerate(map(tuple, couplings.tolist()))}
        pairs = map(tuple, neurons[couplings].tolist())
        cables = tuple(f"T{i + 1}-T{i + 2} {' + '.join(g)}" for i in range(count) for g in groups)
        return cls(
            names=cables if len(groups) > 1 else tuple(name.split()[0] for name in cables),
            cables=cables,
            drivers=np.concatenate(drivers),
            junctions=junctions,
            sides=np.tile([_side(group) for group in groups], count),
            couplings=couplings,
            images=np.array([index.get(pair, i) for i, pair in enumerate(pairs)], dtype=int),
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


def _side(group: Sequence[str]) -> float:
    for side, name in zip((1.0, -1.0), SIDES, strict=True):
        if all(cable.endswith(name) for cable in group):
            return side
    return 0.0
