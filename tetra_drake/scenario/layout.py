"""The cables of a robot in space, and the groups of them that oscillators drive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

TOLERANCE = 1e-6
"""Distance between two points that count as one, as a share of the robot's size."""


@dataclass(frozen=True)
class Layout:
    """Cables where the robot's settings place them, and the group that each oscillator drives.

    Left and right, and mirror images, are those of the plane y = 0.
    """

    cable_names: tuple[str, ...]
    ends: np.ndarray
    """(cables, 2, 3): where each cable begins and ends, in m."""
    bodies: np.ndarray
    """(cables, 2): the indices of the bodies that each cable joins."""
    oscillators: tuple[str, ...]
    """The names of the m oscillators."""
    groups: tuple[tuple[int, ...], ...]
    """(m): the cables that each oscillator drives."""

    @property
    def sides(self) -> np.ndarray:
        """(m,): 1.0 for a group on the left of the robot, -1.0 on the right, 0.0 for any other."""
        middle = self.ends.mean(axis=1)[:, 1]
        sides = np.zeros(len(self.groups))
        for oscillator, cables in enumerate(self.groups):
            y = middle[list(cables)]
            if y.min() > self._least_distance:
                sides[oscillator] = 1.0
            elif y.max() < -self._least_distance:
                sides[oscillator] = -1.0
        return sides

    @property
    def images(self) -> tuple[int | None, ...]:
        """(m): the oscillator that drives the mirror image of each group; None where none does."""
        images = self._images_of_cables()
        groups: list[frozenset[int | None]] = [frozenset(cables) for cables in self.groups]
        oscillators: list[int | None] = []
        for cables in self.groups:
            mirrored = frozenset(images[cable] for cable in cables)
            oscillators.append(groups.index(mirrored) if mirrored in groups else None)
        return tuple(oscillators)

    @property
    def distances(self) -> np.ndarray:
        """(m, m): 0 for oscillators whose cables join the same bodies, 1 if they share a body, 2 if
        both are at distance 1 of a third one, and so on."""
        joined = [frozenset(self.bodies[list(cables)].ravel().tolist()) for cables in self.groups]
        count = len(joined)
        near = np.array([[bool(a & b) for b in joined] for a in joined]).reshape(count, count)
        distances = np.full((count, count), count)
        reached = np.eye(count, dtype=bool)
        for distance in range(1, count):
            reached = reached @ near
            distances[reached & (distances == count)] = distance
        same = np.array([[a == b for b in joined] for a in joined]).reshape(count, count)
        distances[same] = 0
        return distances

    @property
    def _least_distance(self) -> float:
        return TOLERANCE * float(np.linalg.norm(np.ptp(self.ends.reshape(-1, 3), axis=0)))

    def _images_of_cables(self) -> Sequence[int | None]:
        """The mirror image of each cable, None where there is none."""
        mirrored = self.ends * [1.0, -1.0, 1.0]
        images: list[int | None] = []
        for ends in mirrored:
            apart = np.abs(self.ends - ends).max(axis=(1, 2))
            reversed_apart = np.abs(self.ends - ends[::-1]).max(axis=(1, 2))
            nearest = np.minimum(apart, reversed_apart)
            image = int(nearest.argmin())
            images.append(image if nearest[image] <= self._least_distance else None)
        return images
