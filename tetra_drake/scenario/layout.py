"""The cables of a robot in space, and the groups of them that oscillators drive."""

from __future__ import annotations

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
        y = self.ends.mean(axis=1)[:, 1]
        is_left = [(y[list(cables)] > self._least_distance).all() for cables in self.groups]
        is_right = [(y[list(cables)] < -self._least_distance).all() for cables in self.groups]
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
        joined = [set(self.bodies[list(cables)].ravel().tolist()) for cables in self.groups]
        count = len(joined)
        near = np.array([[bool(a & b) for b in joined] for a in joined]).reshape(count, count)
        distances = np.array([[0 if a == b else count for b in joined] for a in joined])
        reached = np.eye(count, dtype=bool)
        for distance in range(1, count):
            reached = reached @ near
            distances[reached] = np.minimum(distances[reached], distance)
        return distances.reshape(count, count)

    @property
    def _least_distance(self) -> float:
        return TOLERANCE * float(np.linalg.norm(np.ptp(self.ends.reshape(-1, 3), axis=0)))

    def _images_of_cables(self) -> list[int]:
        """The mirror image of each cable, -1 where there is none."""
        images = []
        for ends in self.ends * [1.0, -1.0, 1.0]:
            apart = np.abs(self.ends - ends).max(axis=(1, 2))
            reversed_apart = np.abs(self.ends - ends[::-1]).max(axis=(1, 2))
            nearest = np.minimum(apart, reversed_apart)
            images.append(int(nearest.argmin()) if nearest.min() <= self._least_distance else -1)
        return images
