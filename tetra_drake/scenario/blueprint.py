"""The blueprint of a robot: plain data that every kind of robot gives."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np

TOLERANCE = 1e-6
"""Distance between two points that count as one, as a share of the robot's size."""


@dataclass(frozen=True)
class Blueprint:
    """A robot where its settings place it. Nodes and struts run body by body; SI units.

    Left and right, and mirror images, are those of the plane y = 0.
    """

    bodies: tuple[str, ...]
    """The names of the bodies, such as "T1"."""
    node_names: tuple[str, ...]
    """Such as "T1 tip"."""
    first_node: np.ndarray
    """(bodies + 1,): the index of each body's first node, and the number of nodes."""
    p_WF: np.ndarray
    """(bodies, 3): the origins of the frames F that the nodes are given in, with World's axes."""
    p_FN: np.ndarray
    """(nodes, 3)."""
    struts: np.ndarray
    """(struts, 2): the indices of the nodes that each joins."""
    strut_radius: np.ndarray
    """(struts,)."""
    strut_density: np.ndarray
    """(struts,): of solid cylinders."""
    node_radius: np.ndarray
    """(nodes,): 0 where there is no sphere."""
    node_density: np.ndarray
    """(nodes,): of solid spheres."""
    node_mass: np.ndarray
    """(nodes,): point masses."""
    payload: np.ndarray
    """(bodies,): point masses at the centres of mass."""
    cable_names: tuple[str, ...]
    """Such as "T1-T2 outer bottom_left", pair by pair of bodies."""
    cable_groups: tuple[str, ...]
    """The group of each cable, such as "outer"."""
    cable_ends: np.ndarray
    """(cables, 2): the indices of the nodes that each joins, from the lower body to the higher."""
    cable_laws: tuple[Mapping[str, float], ...]
    """The constants of each cable, by the names of physics.cable.CableLaw."""
    slack: bool
    """True if the cables never push."""
    oscillators: tuple[str, ...]
    """The names of the m oscillators, such as "T1-T2"."""
    groups: tuple[tuple[int, ...], ...]
    """(m): the cables that each oscillator drives."""
    contacts: np.ndarray
    """(contacts,): the indices of the nodes that the ground can touch, ascending."""
    markers: np.ndarray
    """(markers,): the indices of the nodes that are followed, body by body; none if the centre of
    mass is."""
    followed: str
    """The name of what is followed."""
    points_ahead: bool
    """True if the bodies' x axes point ahead, so that the robot has a heading."""
    feet: int | None
    """The number of nodes that bear the weight; None for those that do at rest."""
    settles: bool
    """True if the robot starts at rest, False if it starts where it is placed."""

    @functools.cached_property
    def carriers(self) -> np.ndarray:
        """(nodes,): the index of each node's body."""
        return np.repeat(np.arange(len(self.bodies)), np.diff(self.first_node))

    @property
    def p_WN(self) -> np.ndarray:
        """(nodes, 3): the nodes where they are placed."""
        return self.p_WF[self.carriers] + self.p_FN

    @property
    def signals(self) -> int:
        """Actuation signals: one per oscillator."""
        return len(self.oscillators)

    @property
    def driven_cables(self) -> tuple[str, ...]:
        """Cables of each oscillator, such as "T1-T2 outer top + T1-T2 inner top"."""
        names = self.cable_names
        return tuple(" + ".join(names[cable] for cable in group) for group in self.groups)

    @property
    def ahead(self) -> np.ndarray:
        """(m,): the last of the bodies that each oscillator's cables join."""
        bodies = self.carriers[self.cable_ends]
        last = [bodies[list(cables)].max() for cables in self.groups]
        return np.array(last, dtype=np.int64)

    @property
    def sides(self) -> np.ndarray:
        """(m,): 1.0 for a group on the left of the robot, -1.0 on the right, 0.0 for any other."""
        y, least = self._ends.mean(axis=1)[:, 1], self._least_distance
        is_left = [(y[list(cables)] > least).all() for cables in self.groups]
        is_right = [(y[list(cables)] < -least).all() for cables in self.groups]
        return np.array(is_left, dtype=float) - np.array(is_right, dtype=float)

    @property
    def images(self) -> tuple[int | None, ...]:
        """(m): the oscillator that drives the mirror image of each group; None where none does."""
        groups = [set(cables) for cables in self.groups]
        image = self._images_of_cables()
        images = [{image[cable] for cable in cables} for cables in self.groups]
        return tuple(groups.index(cables) if cables in groups else None for cables in images)

    @property
    def distances(self) -> np.ndarray:
        """(m, m): 0 for oscillators whose cables join the same bodies, 1 if they share a body, 2 if
        both are at distance 1 of a third one, and so on."""
        bodies = self.carriers[self.cable_ends]
        joined = [set(bodies[list(cables)].ravel().tolist()) for cables in self.groups]
        count = len(joined)
        near = np.array([[bool(a & b) for b in joined] for a in joined]).reshape(count, count)
        distances = np.array([[0 if a == b else count for b in joined] for a in joined])
        reached = np.eye(count, dtype=bool)
        for distance in range(1, count):
            reached = reached @ near
            distances[reached] = np.minimum(distances[reached], distance)
        return distances.reshape(count, count)

    def with_oscillator_per_cable(self, *, without_law: bool) -> Self:
        """The robot in which an oscillator drives each driven cable alone.

        without_law: the constants of driven cables are 0, so that a cable's force is its signal.
        """
        driven = sorted(cable for group in self.groups for cable in group)
        laws = [
            dict.fromkeys(law, 0.0) if without_law and cable in driven else law
            for cable, law in enumerate(self.cable_laws)
        ]
        return dataclasses.replace(
            self,
            cable_laws=tuple(laws),
            oscillators=tuple(self.cable_names[cable] for cable in driven),
            groups=tuple((cable,) for cable in driven),
        )

    @property
    def _ends(self) -> np.ndarray:
        """(cables, 2, 3): where each cable begins and ends."""
        return self.p_WN[self.cable_ends]

    @property
    def _least_distance(self) -> float:
        return TOLERANCE * float(np.linalg.norm(np.ptp(self.p_WN, axis=0)))

    def _images_of_cables(self) -> list[int]:
        """The mirror image of each cable, -1 where there is none."""
        images, placed, least = [], self._ends, self._least_distance
        for ends in placed * [1.0, -1.0, 1.0]:
            apart = np.abs(placed - ends).max(axis=(1, 2))
            reversed_apart = np.abs(placed - ends[::-1]).max(axis=(1, 2))
            nearest = np.minimum(apart, reversed_apart)
            images.append(int(nearest.argmin()) if nearest.min() <= least else -1)
        return images
