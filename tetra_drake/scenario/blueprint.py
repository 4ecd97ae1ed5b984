"""Blueprint of a robot: bodies, nodes, struts and cables as plain data, for any kind of robot."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from tetra_drake.laws.cable import CableLaw, elastic_tension
from tetra_drake.laws.kinematics import rigid_motions
from tetra_drake.laws.model import WORLD, carriers_of
from tetra_drake.scenario.start import Start
from tetra_drake.settings.refusals import check_known, refuse

TOLERANCE = 1e-6
"""Distance below which two points count as the same, as a share of the robot's size."""

USUAL_SIZES = 0.1, 1.0
"""Least and greatest size (m) of robots for which default lengths are chosen, such as the area of
terrain and the margins of figures. For larger and smaller robots these lengths are scaled. See
Blueprint.scale."""

LONGEST, SHORTEST = 1e4, 1e-6
"""Limits for the length of a strut, in m. The first is also the largest coordinate of a node."""

THINNEST = 1e-5
"""Least diameter of a strut, as a share of its length. In thinner struts the moment of inertia
about the axis would be too small beside the others."""

LIGHTEST = 1e-12
"""Least mass of a strut, in kg."""

SAGS, HOLDS = 1e-5, 1e3
"""Displacement of an anchor or joint under the robot's weight, as a share of the robot's length;
and its stiffness as a multiple of the stiffness of all cables."""
STIFFEST = 1e8
"""Stiffness (N/m) of anchors and joints per mass (kg) of the lightest body, above which steps are
short and errors larger where bodies swing. No cable needs more than HOLDS times its own."""

LEAST_DISTANCE = 1e-3
"""Least distance between two nodes, as a share of the shortest strut."""


class Segments(NamedTuple):
    """Straight pieces of the cables. A straight cable has one, a routed cable several."""

    ends: np.ndarray
    """Indices of the two nodes of each piece (pieces, 2)."""
    cable: np.ndarray
    """Index of the cable of each piece (pieces,), ascending."""


class GivenInertia(NamedTuple):
    """Mass, centre of mass and inertia of a body that are given in place of what follows from its
    parts; SI units. What is not given is None."""

    mass: float | None
    centre: np.ndarray | None
    """Position (3,) of the centre of mass in the blueprint's frame F of the body."""
    inertia: np.ndarray | None
    """Moments and products of inertia (6,) about the centre of mass: xx, yy, zz, xy, xz, yz."""


@dataclass(frozen=True, kw_only=True)
class Blueprint:
    """Geometry and constants of a robot, computed from its settings; SI units.

    Nodes and struts are in the order of the bodies. Then come fixed nodes, which belong to no body:
    the world holds them where they are. Left is y > 0, right is y < 0; mirror images are with
    respect to the plane y = 0.
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
    strut_keys: tuple[str, ...]
    """Keys of the struts in the settings, such as "struts.bar.pairs[0]", for error messages."""
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
    """Damping (nodes, 3) of the springs that hold the nodes of bodies along x, y and z."""
    payload: np.ndarray
    """Point masses at the centres of mass of the bodies (bodies,)."""
    offsets: np.ndarray
    """Displacements (bodies, 3) of the bodies at the start."""
    cable_names: tuple[str, ...]
    """Names of the cables, such as "T1-T2 outer bottom_left", in the order of pairs of bodies.
    Cables from fixed nodes come first."""
    cable_groups: tuple[str, ...]
    """Group of each cable, such as "outer"."""
    cable_keys: tuple[str, ...]
    """Keys of the cables in the settings, such as "cables.side.pairs[0]", for error messages."""
    cable_ends: np.ndarray
    """Indices of the two end nodes of each cable (cables, 2). The node of the body with the lower
    index comes first."""
    cable_laws: tuple[CableLaw, ...]
    """Constants of each cable's force law."""
    slack: bool
    """True if cables go slack instead of pushing."""
    contacts: np.ndarray
    """Indices of the nodes that the ground can touch (contacts,), ascending."""
    oscillators: tuple[str, ...] = ()
    """Names of the m oscillators, such as "T1-T2"."""
    groups: tuple[tuple[int, ...], ...] = ()
    """Indices of the cables that each oscillator drives (m)."""
    cable_rings: Mapping[int, tuple[int, ...]] = field(default_factory=dict)
    """Inner nodes of each cable that runs over rings, from its first end to its second, by the
    index of the cable. Such cables come after all straight ones."""
    cable_limits: np.ndarray = field(default_factory=lambda: np.zeros(0))
    """Greatest tensions (cables,) that the springs bear, infinite without a limit; empty if no
    cable has one."""
    joints: np.ndarray = field(default_factory=lambda: np.zeros((0, 2), dtype=int))
    """Indices of the two nodes of each ball joint (joints, 2), nodes of two bodies at one place.
    The node of the body with the lower index comes first."""
    joint_keys: tuple[str, ...] = ()
    """Keys of the joints in the settings, such as "joints.knee", for error messages."""
    joint_stiffness: np.ndarray = field(default_factory=lambda: np.zeros(0))
    """Stiffness of the springs that hold the nodes of a joint together (joints,)."""
    joint_damping: np.ndarray = field(default_factory=lambda: np.zeros(0))
    """Damping of the springs that hold the nodes of a joint together (joints,)."""
    joint_friction: np.ndarray = field(default_factory=lambda: np.zeros(0))
    """Torque limits of the friction of the joints (joints,)."""
    given_inertia: Mapping[int, GivenInertia] = field(default_factory=dict)
    """Given mass, centre and inertia, by the index of the body."""
    markers: np.ndarray = field(default_factory=lambda: np.array([], dtype=int))
    """Indices of the nodes whose motion is shown (markers,), in the order of the bodies. Empty if
    the motion of the centre of mass is shown."""
    followed: str = "centre"
    """Name, in texts, of the points whose motion is shown, such as "centre"."""
    points_ahead: bool = False
    """True if the bodies' x axes point forward, so that the robot has a heading."""
    feet: int | None = None
    """Number of nodes that bear the weight; None if it follows from the equilibrium."""
    start: Start | None = None
    """How the bodies are turned and move at t = 0."""
    settles: bool = True
    """True if the robot starts in equilibrium, False if it starts at the given positions."""

    @functools.cached_property
    def carriers(self) -> np.ndarray:
        """Index of the body that each node belongs to (nodes,); WORLD (-1) for a fixed node."""
        return carriers_of(self.first_node, nodes=len(self.node_names))

    @functools.cached_property
    def distances(self) -> np.ndarray:
        """Distances (m, m) between the m oscillators: 0 if their cables join the same bodies, 1 if
        they share a body, 2 if both are at distance 1 of a third, and so on."""
        from scipy.sparse.csgraph import shortest_path

        joined = [self.bodies_at(cables) for cables in self.groups]
        shape = len(joined), len(joined)
        near = np.array([[bool(a & b) for b in joined] for a in joined]).reshape(shape)
        same = np.array([[a == b for b in joined] for a in joined]).reshape(shape)
        steps = np.minimum(shortest_path(near, unweighted=True), len(joined))
        return np.where(same, 0.0, steps)

    @functools.cached_property
    def segments(self) -> Segments:
        """Straight pieces of the cables, in the order of the cables."""
        paths = [
            [first, *self.cable_rings.get(cable, ()), last]
            for cable, (first, last) in enumerate(self.cable_ends.tolist())
        ]
        ends = [pair for path in paths for pair in itertools.pairwise(path)]
        cables = [cable for cable, path in enumerate(paths) for _ in path[1:]]
        return Segments(np.array(ends, dtype=int).reshape(-1, 2), np.array(cables, dtype=int))

    def along_cables(self, of_pieces: np.ndarray) -> np.ndarray:
        """Sums (cables,) of numbers of the straight pieces (pieces,) along each cable."""
        return np.bincount(self.segments.cable, of_pieces, minlength=len(self.cable_names))

    def bodies_at(self, cables: Sequence[int]) -> set[int]:
        """Indices of the bodies that some cables join, also at rings; WORLD for fixed nodes."""
        pieces = self.segments.ends[np.isin(self.segments.cable, cables)]
        return set(self.carriers[pieces].ravel().tolist())

    @functools.cached_property
    def places(self) -> np.ndarray:
        """Number of the place of each node (nodes,). Nodes that joints hold together have the same
        number; otherwise it is the node's index."""
        places = np.arange(len(self.node_names))
        for first, second in self.joints:
            places[places == places[second]] = places[first]
        return places

    @property
    def body_of_node(self) -> tuple[str, ...]:
        """Name of the body of each node; "world" for a fixed node."""
        names = *self.bodies, "world"
        return tuple(names[body] for body in self.carriers)

    @property
    def held(self) -> np.ndarray:
        """Whether the world holds each node along x, y and z, as Booleans (nodes, 3): by the spring
        of an anchor or, for a fixed node, along all axes."""
        is_fixed = self.carriers == WORLD
        return is_fixed[:, np.newaxis] | (self.anchor_stiffness > 0.0)

    @property
    def p_WN(self) -> np.ndarray:
        """Positions of the nodes (nodes, 3) in the world frame."""
        return np.vstack([self.p_WF, np.zeros(3)])[self.carriers] + self.p_FN

    @property
    def length(self) -> float:
        """Length (m) of the robot: its largest extent along an axis."""
        return float(np.ptp(self.p_WN, axis=0).max())

    @property
    def scale(self) -> float:
        """Factor by which lengths such as margins of figures grow or shrink with the robot: 1 for
        robots of a `length` of 0.1 m to 1 m, 3 for 3 m, 0.5 for 0.05 m."""
        size = self.length
        return size / min(max(size, USUAL_SIZES[0]), USUAL_SIZES[1]) or 1.0  # a point has no size

    @property
    def signals(self) -> int:
        """Number of actuation signals: one per oscillator."""
        return len(self.oscillators)

    @functools.cached_property
    def _middles(self) -> np.ndarray:
        """Middles of the cables (cables, 3): means of the middles of their straight pieces."""
        sums = self.p_WN[self.segments.ends].mean(axis=1).T
        sums = np.stack([self.along_cables(of_pieces) for of_pieces in sums], axis=1)
        return sums / np.bincount(self.segments.cable)[:, np.newaxis]

    @functools.cached_property
    def sides(self) -> np.ndarray:
        """Side of each oscillator's cables (oscillators,): 1.0 if the middles of all of them are on
        the left, -1.0 on the right, 0.0 otherwise."""
        y, least = self._middles[:, 1], self._least_distance
        is_left = [(y[list(cables)] > least).all() for cables in self.groups]
        is_right = [(y[list(cables)] < -least).all() for cables in self.groups]
        return np.array(is_left, dtype=float) - np.array(is_right, dtype=float)

    @property
    def images(self) -> tuple[int | None, ...]:
        """For each oscillator, the index of the oscillator that drives exactly the mirror images of
        its cables in the plane y = 0, such as itself; None if there is none."""
        paths = np.hstack([self.p_WN[self.cable_ends], self._middles[:, np.newaxis]])
        image_of_cable: list[int] = []
        for mirrored, group in zip(paths * [1.0, -1.0, 1.0], self.cable_groups, strict=True):
            forward = np.abs(paths - mirrored).max(axis=(1, 2))
            backward = np.abs(paths - mirrored[[1, 0, 2]]).max(axis=(1, 2))
            found = np.flatnonzero(np.minimum(forward, backward) <= self._least_distance).tolist()
            # Of parallel cables, the image is one of the same group.
            alike = [cable for cable in found if self.cable_groups[cable] == group]
            image_of_cable.append(next(iter(alike or found), -1))

        groups = [set(cables) for cables in self.groups]
        images = [{image_of_cable[cable] for cable in cables} for cables in self.groups]
        return tuple(groups.index(cables) if cables in groups else None for cables in images)

    @property
    def rubbing(self) -> list[str]:
        """Keys of the cables with friction at their rings, and of the joints with friction."""
        laws = zip(self.cable_keys, self.cable_laws, strict=True)
        joints = itertools.compress(self.joint_keys, self.joint_friction)
        return [key for key, law in laws if law.mu] + [*joints]

    def check(self) -> None:
        """Raises InputError, naming the key of the robot's settings, if it cannot be simulated."""
        self.check_sizes()
        self._check_joints()
        self.check_masses()
        self._check_places()
        self._check_cables()

        sizes = np.diff(self.first_node)
        is_bent = sizes[self.carriers[self.struts[:, 0]]] > 2
        for strut in np.flatnonzero(is_bent & np.isfinite(self.strut_stiffness)):
            _, group, _ = self.strut_keys[strut].split(".")
            name = " ".join([group, *(self.node_names[node] for node in self.struts[strut])])
            problem = f"the strut {name} is part of a rigid body of several struts"
            refuse(f"struts.{group}.axial_stiffness", problem)

        for first, end in itertools.pairwise(self.first_node):
            p, held = self.p_WN[first:end], self.held[first:end]
            motions = rigid_motions((p - p[0]) / (np.ptp(p, axis=0).max() or 1.0))
            # The spin of a straight body does not count.
            ways = np.linalg.matrix_rank(motions.reshape(-1, 6), tol=LEAST_DISTANCE)
            if np.linalg.matrix_rank(motions[held], tol=LEAST_DISTANCE) < ways:
                break
        else:
            refuse("anchors", "hold every body, expected one that can move")
        if not self.contacts.size:
            refuse("contacts", "found none, expected one node at least")

    def check_sizes(self) -> None:
        """Raises InputError if `offsets` or `payload` has not one item for each body, if `start`
        names no body, or if a strut is too short, too long, too thin or too light for the
        computation of forces."""
        bodies = len(self.bodies)
        for key, items in (("offsets", self.offsets), ("payload", self.payload)):
            if len(items) != bodies:
                expected = f"expected none or {bodies}, one for each body"
                refuse(key, f"found {len(items)} items, {expected}")
        for name in self.start.bodies if self.start else ():
            check_known(f"start.bodies.{name}", "body", name, self.bodies)

        lengths, diameters = self._distances(self.struts), 2.0 * self.strut_radius
        masses = math.pi * self.strut_radius**2 * lengths * self.strut_density
        struts = zip(self.strut_keys, lengths, diameters, masses, strict=True)
        for key, length, diameter, mass in struts:
            if not SHORTEST <= length <= LONGEST:
                refuse(key, f"is {length:.3g} m long, expected {SHORTEST:g} m to {LONGEST:g} m")
            if diameter < THINNEST * length:
                thick = f"is {diameter:.3g} m thick and {length:.3g} m long"
                refuse(key, f"{thick}, expected a diameter of at least {THINNEST:g} of the length")
            if 0.0 < mass < LIGHTEST:
                refuse(key, f"has a mass of {mass:.3g} kg, expected at least {LIGHTEST:g} kg")

    def firm_stiffness(self, gravity: float) -> tuple[float, float]:
        """Stiffness (N/m) of anchors and joints that hardly give way, neither to all cables nor to
        the robot's weight, on earth at least, and its loads; and the greatest default, with which
        steps are still long. See HOLDS, SAGS and STIFFEST."""
        mass = self._masses(self.node_mass)
        for body, given in self.given_inertia.items():
            mass[body] = mass[body] if given.mass is None else given.mass
        weight = mass.sum() * max(gravity, 9.80665) + np.abs(self.node_load).sum()
        cables = [HOLDS * law.stiffness for law in self.cable_laws]
        firm = max(sum(cables), float(weight) / (SAGS * (self.length or 1.0)))
        return firm, max([STIFFEST * float(mass.min()), *cables])

    def _masses(self, points: np.ndarray) -> np.ndarray:
        """Masses (bodies,) of struts, spheres and `points` (nodes,), masses at the nodes."""
        moving = self.first_node[-1]
        of_struts = math.pi * self.strut_radius**2 * self.strut_density
        of_struts *= self._distances(self.struts)
        of_nodes = 4.0 / 3.0 * math.pi * self.node_radius**3 * self.node_density + points
        mass = np.add.reduceat(of_nodes[:moving], self.first_node[:-1])
        np.add.at(mass, self.carriers[self.struts[:, 0]], of_struts)
        return np.asarray(mass)

    def check_masses(self) -> None:
        """Raises InputError for bodies of hardly any mass.

        The point masses of a body with several nodes do not count, as they have no inertia about
        the line between two of them.
        """
        sizes = np.diff(self.first_node)
        is_alone = np.append(sizes, 0)[self.carriers] == 1  # 0 for the world
        mass = self._masses(np.where(is_alone, self.node_mass, 0.0))
        for body, given in self.given_inertia.items():
            for key, value in (("centre", given.centre), ("inertia", given.inertia)):
                if mass[body] < LIGHTEST and value is None:
                    problem = "is missing, and no part of the body has mass and inertia"
                    refuse(f"bodies.{self.bodies[body]}.{key}", problem)
            mass[body] = mass[body] if given.mass is None else given.mass
        if mass.min() < LIGHTEST:
            lightest = mass.argmin()
            node = self.first_node[lightest]
            without = "without point masses " if sizes[lightest] > 1 else ""
            problem = f"is on a body whose mass {without}is {mass.min():.3g} kg"
            expected = f"expected at least {LIGHTEST:g} kg"
            refuse(f"nodes.{self.node_names[node]}", f"{problem}, {expected}")

    def _check_places(self) -> None:
        """Raises InputError for two nodes at the same position, unless nothing leads to one of
        them."""
        ends = np.unique(np.vstack([self.segments.ends, self.struts]))
        p_WN, least = self.p_WN[ends], LEAST_DISTANCE * self.shortest
        is_near = np.linalg.norm(p_WN - p_WN[:, np.newaxis], axis=2) < least
        is_near &= self.places[ends] != self.places[ends, np.newaxis]
        for first, second in np.argwhere(is_near):
            problem = f"found the place of '{self.node_names[ends[first]]}'"
            expected = f"expected nodes {least:.3g} m apart"
            refuse(f"nodes.{self.node_names[ends[second]]}", f"{problem}, {expected}")

    def _check_cables(self) -> None:
        """Raises InputError for cables that do not join two bodies, or a body and the world; for
        bodies that no cables, joints or anchors join to the others; and for a tension in the
        settings so high that the free length of the cable would be negative."""
        places, pairs = self.places[self.segments.ends], self.carriers[self.segments.ends]
        for piece in np.flatnonzero(places[:, 0] == places[:, 1]):
            problem = "has length 0 between nodes of a joint, expected nodes at two places"
            refuse(self.cable_keys[self.segments.cable[piece]], problem)
        for cable, key in enumerate(self.cable_keys):
            first, *others = self.bodies_at([cable])
            if first == WORLD and not others:
                refuse(key, "joins two fixed nodes, expected a node of a strut")
            if not others:
                problem = f"joins the body '{self.bodies[first]}' to itself"
                refuse(key, f"{problem}, expected nodes of two bodies, or a pinned node between")

        joined = np.arange(len(self.bodies) + 1)  # equal numbers if joined; the last: the world
        anchored = self.carriers[self.held.any(axis=1)]
        joints = self.carriers[self.joints]
        for first, second in [*pairs, *joints, *((WORLD, body) for body in anchored)]:
            joined[joined == joined[first]] = joined[second]
        apart = np.flatnonzero(joined[:WORLD] != joined[0])
        if apart.size:
            problem = f"no cables lead from '{self.bodies[apart[0]]}' to '{self.bodies[0]}'"
            refuse("cables", f"{problem}, expected all bodies to be joined")

        lengths = self.along_cables(self._distances(self.segments.ends))
        for cable, (length, law) in enumerate(zip(lengths, self.cable_laws, strict=True)):
            if law.free_length < 0.0:
                tension = round(elastic_tension(length - law.free_length, law), 12)
                most = elastic_tension(length, law._replace(free_length=0.0))
                expected = f"expected at most {most:.4g} N for '{self.cable_names[cable]}'"
                problem = f"found {tension} N, {expected}, where its free length is 0"
                refuse(f"cables.{self.cable_groups[cable]}.tension", problem)

    def _check_joints(self) -> None:
        """Refuses joints of a body with itself or with the world, and nodes that are apart."""
        apart = self._distances(self.joints)
        joints = zip(self.joint_keys, self.joints, apart, strict=True)
        for key, nodes, distance in joints:
            names = " and ".join(f"'{self.node_names[node]}'" for node in nodes)
            first, second = self.carriers[nodes]
            if WORLD in (first, second):
                refuse(key, f"found {names}, one of them fixed; expected an anchor for it instead")
            if first == second:
                problem = f"found {names} of the body '{self.bodies[first]}'"
                refuse(key, f"{problem}, expected nodes of two bodies")
            if distance > self._least_distance:
                problem = f"found {names} {distance:.3g} m apart"
                refuse(key, f"{problem}, expected two nodes at one place")

    @property
    def shortest(self) -> float:
        """Length (m) of the shortest strut, or of the shortest cable if there are no struts; 0 if
        there are no cables either."""
        pairs = self.struts if len(self.struts) else self.cable_ends
        return float(self._distances(pairs).min()) if len(pairs) else 0.0

    def _distances(self, pairs: np.ndarray) -> np.ndarray:
        """Distances (pairs,) in m between the two nodes of each pair (pairs, 2)."""
        ends = self.p_WN[pairs]
        return np.asarray(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1))

    @property
    def _least_distance(self) -> float:
        return TOLERANCE * float(np.linalg.norm(np.ptp(self.p_WN, axis=0)))


def cable_numbers(names: Iterable[str]) -> dict[str, int]:
    """Indices of cables by their names, such as "side n1 n2". Each cable is listed with its nodes
    in either order."""
    numbers: dict[str, int] = {}
    for number, name in enumerate(names):
        group, *nodes = name.split()
        numbers[name] = numbers[" ".join((group, *nodes[::-1]))] = number
    return numbers
