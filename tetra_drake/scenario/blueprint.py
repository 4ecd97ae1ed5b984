"""Blueprint of a robot: plain data that every kind of robot provides."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Self

import numpy as np

from tetra_drake.laws.model import WORLD

TOLERANCE = 1e-6
"""Distance below which two points count as the same, as a share of the robot's size."""

USUAL_SIZES = 0.1, 1.0
"""Least and greatest size (m) of robots for which areas of terrain, margins of figures and other
lengths are chosen. They grow and shrink with other robots. See Blueprint.scale."""


@dataclass(frozen=True, kw_only=True)
class Blueprint:
    """A robot at the positions of its settings; SI units.

    Nodes and struts are in the order of the bodies. Then come fixed nodes, which belong to no body:
    the world holds them where they are. Left and right are the two sides of the plane
    y = 0; mirror images are with respect to this plane.
    """

    bodies: tuple[str, ...]
    """Names of the bodies, such as "T1"."""
    node_names: tuple[str, ...]
    """Names of the nodes, such as "T1 tip"."""
    first_node: np.ndarray
    """Index of each body's first node (bodies + 1,); the last number is the index of the first
    fixed node."""
    p_WF: np.ndarray
    """Origins (bodies, 3) of the frames F of the bodies. Their axes are the world's."""
    p_FN: np.ndarray
    """Positions of the nodes (nodes, 3) in the frames F; of fixed nodes in the world."""
    struts: np.ndarray
    """Indices of the two nodes of each strut (struts, 2)."""
    strut_radius: np.ndarray
    """Radii of the struts (struts,)."""
    strut_density: np.ndarray
    """Densities of the struts (struts,), solid cylinders."""
    strut_stiffness: np.ndarray
    """Axial stiffness of the struts (struts,); infinite for rigid struts."""
    node_radius: np.ndarray
    """Radii of the spheres at the nodes (nodes,); 0 for no sphere."""
    contact_radius: np.ndarray
    """Radii of the feet at the nodes (nodes,): the spheres that touch the ground."""
    node_density: np.ndarray
    """Densities of the spheres at the nodes (nodes,), which are solid."""
    node_mass: np.ndarray
    """Point masses at the nodes (nodes,)."""
    node_load: np.ndarray
    """Constant forces on the nodes (nodes, 3) in the world frame."""
    anchor_stiffness: np.ndarray
    """Stiffness (nodes, 3) of the springs that hold the nodes of bodies along x, y and z; 0 along a
    free axis."""
    anchor_damping: np.ndarray
    """Damping (nodes, 3) beside `anchor_stiffness`."""
    payload: np.ndarray
    """Point masses at the centres of mass (bodies,)."""
    cable_names: tuple[str, ...]
    """Names of the cables, such as "T1-T2 outer bottom_left", in the order of pairs of bodies.
    Cables from fixed nodes come first."""
    cable_groups: tuple[str, ...]
    """Group of each cable, such as "outer"."""
    cable_ends: np.ndarray
    """Indices of the two nodes of each cable (cables, 2), from the lower body to the higher."""
    cable_laws: tuple[Mapping[str, float], ...]
    """Constants of each cable, by the names of laws.cable.CableLaw."""
    slack: bool
    """True if cables go slack instead of pushing."""
    oscillators: tuple[str, ...]
    """Names of the m oscillators, such as "T1-T2"."""
    groups: tuple[tuple[int, ...], ...]
    """Indices of the cables that each oscillator drives (m)."""
    contacts: np.ndarray
    """Indices of the nodes that the ground can touch (contacts,), ascending."""
    markers: np.ndarray = field(default_factory=lambda: np.array([], dtype=int))
    """Indices of the nodes whose motion is shown (markers,), in the order of the bodies. Empty if
    the motion of the centre of mass is shown."""
    followed: str = "centre"
    """Name of the points whose motion is shown."""
    points_ahead: bool = False
    """True if the bodies' x axes point forward, so that the robot has a heading."""
    feet: int | None = None
    """Number of nodes that bear the weight; None if it follows from the equilibrium."""
    settles: bool = True
    """True if the robot starts in equilibrium, False if it starts at the given positions."""

    @functools.cached_property
    def carriers(self) -> np.ndarray:
        """Index of the body of each node (nodes,); WORLD for a fixed node."""
        of_bodies = np.repeat(np.arange(len(self.bodies)), np.diff(self.first_node))
        fixed = len(self.node_names) - len(of_bodies)
        return np.pad(of_bodies, (0, fixed), constant_values=WORLD)

    @property
    def body_of_node(self) -> tuple[str, ...]:
        """Name of the body of each node; "world" for a fixed node."""
        names = *self.bodies, "world"
        return tuple(names[body] for body in self.carriers)

    @property
    def held(self) -> np.ndarray:
        """True for each axis of a node along which the world holds it (nodes, 3)."""
        is_fixed = self.carriers == WORLD
        return is_fixed[:, np.newaxis] | (self.anchor_stiffness > 0.0)

    @property
    def p_WN(self) -> np.ndarray:
        """Positions of the nodes (nodes, 3) in the world frame."""
        return np.vstack([self.p_WF, np.zeros(3)])[self.carriers] + self.p_FN

    @property
    def scale(self) -> float:
        """Factor on lengths that suit robots of USUAL_SIZES; 1 for these."""
        size = float(np.ptp(self.p_WN, axis=0).max())
        return size / min(max(size, USUAL_SIZES[0]), USUAL_SIZES[1]) or 1.0  # a point has no size

    @property
    def signals(self) -> int:
        """Number of actuation signals: one per oscillator."""
        return len(self.oscillators)

    @property
    def driven_cables(self) -> tuple[str, ...]:
        """Names of each oscillator's cables, such as "T1-T2 outer top + T1-T2 inner top"."""
        names = self.cable_names
        return tuple(" + ".join(names[cable] for cable in group) for group in self.groups)

    @property
    def ahead(self) -> np.ndarray:
        """Index of the last body that each oscillator's cables join (m,)."""
        bodies = self.carriers[self.cable_ends]
        last = [bodies[list(cables)].max() for cables in self.groups]
        return np.array(last, dtype=np.int64)

    @functools.cached_property
    def sides(self) -> np.ndarray:
        """Side of each oscillator's cables (m,): 1.0 left, -1.0 right, 0.0 neither."""
        y, least = self._ends.mean(axis=1)[:, 1], self._least_distance
        is_left = [(y[list(cables)] > least).all() for cables in self.groups]
        is_right = [(y[list(cables)] < -least).all() for cables in self.groups]
        return np.array(is_left, dtype=float) - np.array(is_right, dtype=float)

    @property
    def images(self) -> tuple[int | None, ...]:
        """Index of the oscillator that drives the mirror image of each oscillator's cables (m);
        None if there is none."""
        groups = [set(cables) for cables in self.groups]
        image = self._images_of_cables()
        images = [{image[cable] for cable in cables} for cables in self.groups]
        return tuple(groups.index(cables) if cables in groups else None for cables in images)

    @property
    def distances(self) -> np.ndarray:
        """Distances between oscillators (m, m): 0 if their cables join the same bodies, 1 if they
        share a body, 2 if both are at distance 1 of a third oscillator, and so on."""
        from scipy.sparse.csgraph import shortest_path

        bodies = self.carriers[self.cable_ends]
        joined = [set(bodies[list(cables)].ravel().tolist()) for cables in self.groups]
        count = len(joined)
        near = np.array([[bool(a & b) for b in joined] for a in joined]).reshape(count, count)
        same = np.array([[a == b for b in joined] for a in joined]).reshape(count, count)
        steps = np.minimum(shortest_path(near, unweighted=True), count)
        return np.where(same, 0.0, steps)

    def with_oscillator_per_cable(self, *, without_law: bool) -> Self:
        """The robot with one oscillator for each driven cable, group by group.

        With `without_law`, the constants of driven cables are 0, so the force of a cable is its
        signal.
        """
        driven = [cable for group in self.groups for cable in group]
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
        """Positions of the two ends of each cable (cables, 2, 3)."""
        return self.p_WN[self.cable_ends]

    @property
    def _least_distance(self) -> float:
        return TOLERANCE * float(np.linalg.norm(np.ptp(self.p_WN, axis=0)))

    def _images_of_cables(self) -> list[int]:
        """Index of the mirror image of each cable; -1 if there is none."""
        placed, least = self._ends, self._least_distance
        images: list[int] = []
        for ends, group in zip(placed * [1.0, -1.0, 1.0], self.cable_groups, strict=True):
            forward = np.abs(placed - ends).max(axis=(1, 2))
            backward = np.abs(placed - ends[::-1]).max(axis=(1, 2))
            found = np.flatnonzero(np.minimum(forward, backward) <= least).tolist()
            # Of parallel cables, the image is one of the same group.
            alike = [cable for cable in found if self.cable_groups[cable] == group]
            images.append(next(iter(alike or found), -1))
        return images
