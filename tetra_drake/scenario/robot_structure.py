"""Kinds of robots: the row of tetrahedra, and structures: any tensegrity, as data.

Struts of a structure that share a node are one rigid body. Cables join bodies. Coordinates are in
the world frame (x forward, y left, z up), near a static equilibrium.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self

import numpy as np
import pydantic
from pydantic import Field

from tetra_drake.laws.cable import CableConstants, CableLaw, elastic_stretch, elastic_tension
from tetra_drake.laws.kinematics import rigid_motions
from tetra_drake.laws.model import WORLD
from tetra_drake.scenario.blueprint import Blueprint
from tetra_drake.scenario.metrics import ROW
from tetra_drake.scenario.robot_tetrahedra import (
    LIGHTEST,
    LONGEST,
    Tetrahedra,
    check_one_per_body,
    check_strut,
)
from tetra_drake.settings.quantities import (
    Acceleration,
    Density,
    ForceQuantity,
    Keyed,
    Length,
    Mass,
    Position,
    Stiffness,
    Time,
)
from tetra_drake.settings.refusals import described, hint, refuse
from tetra_drake.settings.section import Kinds, Section, Tree, Varied, mapped
from tetra_drake.settings.units import quantity_to_si

MOST_NODES, MOST_PAIRS = 1000, 2000

LEAST_DISTANCE = 1e-3
"""Least distance between two nodes, as a share of the shortest strut."""


def _check_name(name: object) -> object:
    """Checks the name of a node, group or oscillator. Blanks, dots, brackets and commas are
    refused: they separate the parts of cable names, the parts of keys, and keys."""
    if not isinstance(name, str):
        refuse("", f"found the name {name}, expected a text, such as n{name}")
    if re.search(r"[\s.,\[\]]", name):
        refuse("", f"found the name '{name}', expected one without blanks, dots, commas, brackets")
    return name


Name = Annotated[str, pydantic.BeforeValidator(_check_name)]
BareLength = Annotated[Length, Field(json_schema_extra={"if": False})]
"""A length that needs no unit where the structure has one."""
Coordinates = Annotated[list[BareLength], Field(min_length=3, max_length=3)]
Pair = Annotated[list[str], Field(min_length=2, max_length=2)]
AnchorAxes = Annotated[
    Literal["x", "y", "z", "xy", "xz", "yz", "xyz"],
    pydantic.BeforeValidator(lambda axes: "".join(sorted(axes)) if isinstance(axes, str) else axes),
    pydantic.WithJsonSchema(
        {"type": "string", "pattern": r"^(?!.*(.).*\1)[xyz]{1,3}$", "format": "some of x, y, z"}
    ),
]
Pairs = Annotated[list[Pair], Field(min_length=1, max_length=MOST_PAIRS)]


class StrutGroup(Section):
    """Struts of one make: solid cylinders with a sphere of the same density at each end."""

    pairs: Pairs
    """The nodes that each strut joins."""
    diameter: Length = Field(gt=0)
    """Diameter of a strut."""
    density: Density = Field(ge=0)
    """Density of struts and spheres. It may be 0 where other parts of the body have mass."""
    node_diameter: Length = Field(ge=0)
    """Diameter of the spheres; 0 for none. A node has one sphere, from its first strut in the
    file."""
    contact_radius: Length | None = Field(default=None, ge=0)
    """Radius of the sphere about each end that touches the ground; by default the sphere's radius,
    else the strut's. 0 for a ground that acts on the centres of nodes. The default is 0 for nodes
    that anchors hold along z. A bar with round ends rolls about its axis, if no cable is off the
    axis."""
    axial_stiffness: Stiffness | None = Field(default=None, gt=0)
    """Axial force per shortening of a strut, E A / l; none for rigid struts. Without load a strut
    is as long as its nodes are apart in the file. The axial force in equilibrium shortens it, and
    natural frequencies know its stiffness; in motion it keeps its length. Frequencies leave out
    the inertia of its elongation. Where it is 17, 3.3 or 1 times as stiff as its cable, the first
    frequency is 0.25, 1.2 or 4 % higher than with finite-element rods, the second 0.75, 3.7 or
    12 %."""


class SphereGroup(Section):
    """Solid spheres of one make at nodes, in place of the spheres of their struts. A sphere at a
    node of no strut is a body of its own."""

    nodes: list[str] = Field(min_length=1)
    """The nodes at their centres."""
    diameter: Length = Field(gt=0)
    """Diameter of a sphere."""
    density: Density = Field(ge=0)
    """Density of a sphere. It may be 0 where other parts of the body have mass."""
    contact_radius: Length | None = Field(default=None, ge=0)
    """Radius with which a sphere touches the ground; by default its own. The default is 0 for nodes
    that anchors hold along z."""


class Sphere(NamedTuple):
    """Sphere at a node."""

    diameter: float
    density: float
    contact_radius: float | None
    """Radius with which it touches the ground, if the file has one."""
    touching_radius: float
    """Radius with which it touches the ground by default."""


class CableGroup(CableConstants):
    """Cables of one make, which never push."""

    pairs: Pairs
    """The nodes that each cable joins."""
    stiffness: Annotated[Stiffness, Varied()] = Field(gt=0)
    """Tension per elongation."""
    free_length: Length | None = Field(default=None, ge=0)
    """Length without tension. A group has a free length or a tension."""
    tension: ForceQuantity | None = Field(default=None, ge=0)
    """Tension at the given coordinates of the nodes."""

    @pydantic.model_validator(mode="after")
    def _check(self) -> CableGroup:
        if (self.free_length is None) == (self.tension is None):
            found = "neither" if self.tension is None else "both"
            refuse("free_length", f"found {found}, expected one of free_length and tension")
        return self

    def law(self, free_length: float) -> dict[str, float]:
        """The constants of a cable, by the names of laws.cable.CableLaw."""
        return self.constants(stiffness=self.stiffness, free_length=free_length)

    def greatest_tension(self, length: float) -> float:
        """Tension (N) of a cable of this length (m) with a free length of 0."""
        return elastic_tension(length, CableLaw(**self.law(0.0)))

    def free_length_at(self, length: float) -> float:
        """Free length (m) of a cable. `length` (m) is the distance of its nodes in the file."""
        if self.free_length is not None:
            return self.free_length
        return length - elastic_stretch(self.tension or 0.0, CableLaw(**self.law(length)))


class Member(NamedTuple):
    """A strut or a cable."""

    key: str
    """Key in the structure file, such as "cables.side.pairs[0]"."""
    group: str
    nodes: tuple[str, str]

    @property
    def name(self) -> str:
        """Name: group and nodes, such as "side a1 b1"."""
        return " ".join((self.group, *self.nodes))


class StructureFile(Section):
    """A tensegrity: nodes, struts, cables and the oscillators that actuate cables."""

    tag: ClassVar[str] = "Structure"
    keys_of_files: ClassVar = {"file": "Name or file of a structure; the other keys change it."}
    lacking: ClassVar[tuple[str, ...]] = (ROW,)
    """Properties that some metrics need and this robot does not have."""
    slack: ClassVar[bool] = True
    """Cables never push."""

    nodes: Keyed[Name, Coordinates] = Field(max_length=MOST_NODES)
    """Coordinates [x, y, z] of each node, near an equilibrium. A node that nothing else names is
    left out."""
    unit: str | None = None
    """Unit of coordinates that are bare numbers, such as cm. A robot in mm is shown in mm."""
    struts: Keyed[Name, StrutGroup] = Field(default={})
    cables: Keyed[Name, CableGroup] = Field(default={})
    spheres: Keyed[Name, SphereGroup] = Field(default={})
    actuated: Keyed[Name, Annotated[list[str], Field(min_length=1)]] = Field(default={})
    """Names of the cables that each oscillator drives, their nodes in either order."""
    masses: Keyed[str, Annotated[Mass, Field(gt=0)]] = Field(default={})
    """Point masses at nodes, such as motors. One at a node of no strut is a body of its own, such
    as a payload that cables hold."""
    loads: Keyed[str, Annotated[list[ForceQuantity], Field(min_length=3, max_length=3)]] = Field(
        default={}
    )
    """Constant forces [x, y, z] on nodes, in the world frame."""
    anchors: Keyed[str, AnchorAxes] = Field(default={})
    """Axes along which the world holds nodes, such as xyz. A node of a strut is held by a spring
    and a damper along each axis, from its place in the file; a node of no strut is fixed there."""
    anchor_stiffness: Stiffness = Field(default=1e5, gt=0)
    """Stiffness that holds a node of a strut along each axis of its anchor."""
    anchor_time_constant: Time = Field(default=1e-3, ge=0)
    """Damping beside `anchor_stiffness`, divided by it. With less than 1 ms, a stiff anchor
    vibrates, and steps are short."""
    contacts: Literal["all"] | list[str] = "all"
    """Nodes that the ground can touch."""
    gravity: Acceleration = Field(default=9.80665, ge=0)
    """Acceleration of gravity."""
    offsets: list[Position] = Field(default=[])
    """Displacement [x, y, z] of each body at t = 0; none if empty. A body stays along the axes of
    its anchors."""
    ignored: list[str] | None = None
    """Settings of an imported file that have no effect, because the scenario has its own friction,
    ground and actuators. They are noted when the file is read."""

    def __copy__(self) -> Self:
        # The copy has no cached properties, because it may get other values.
        fields = {name: getattr(self, name) for name in type(self).model_fields}
        return self.model_construct(**fields)

    @property
    def body_count(self) -> int:
        """Number of rigid bodies."""
        return len(self.bodies)

    @property
    def size(self) -> float:
        """Length (m) of the shortest strut, or of the shortest cable if there are no struts; the
        unit of `disturbances.start`."""
        return min(map(self._length, self.all_struts or self.all_cables), default=0.0)

    def implied_changes(self, base: Section, changes: Tree) -> Tree:
        """Further changes that follow from `changes` to a base: none."""
        return {}

    def blueprint(self) -> Blueprint:
        """The robot with its nodes at the positions of the file."""
        nodes = tuple(self.body_of_node)
        number = {node: place for place, node in enumerate(nodes)}
        struts = sorted(self.all_struts, key=lambda strut: self.body_of_node[strut.nodes[0]])
        struts_ends = [[number[node] for node in strut.nodes] for strut in struts]
        groups = [self.struts[strut.group] for strut in struts]
        spheres = [self.sphere_of_node.get(node) for node in nodes]
        held = np.array([[axis in self._held(node) for axis in "xyz"] for node in nodes])
        cables = self.all_cables
        pairs = [sorted(cable.nodes, key=self.body_of_node.__getitem__) for cable in cables]
        ends = np.array([[number[node] for node in pair] for pair in pairs], dtype=int)
        laws = zip(cables, self.free_lengths, strict=True)
        return Blueprint(
            bodies=self.body_names,
            node_names=nodes,
            first_node=np.append(0, np.cumsum([len(body) for body in self.bodies])),
            p_WF=np.zeros((self.body_count, 3)),
            p_FN=np.array([self.nodes[node] for node in nodes]),
            struts=np.array(struts_ends, dtype=int).reshape(-1, 2),
            strut_radius=np.array([group.diameter / 2 for group in groups]),
            strut_density=np.array([group.density for group in groups]),
            strut_stiffness=np.array([group.axial_stiffness or math.inf for group in groups]),
            node_radius=np.array([one.diameter / 2 if one else 0.0 for one in spheres]),
            contact_radius=np.array([self._contact_radius(node) for node in nodes]),
            node_density=np.array([one.density if one else 0.0 for one in spheres]),
            node_mass=np.array([self.masses.get(node, 0.0) for node in nodes]),
            node_load=np.array([self.loads.get(node, [0.0, 0.0, 0.0]) for node in nodes]),
            anchor_stiffness=self.anchor_stiffness * held,
            anchor_damping=self.anchor_stiffness * self.anchor_time_constant * held,
            payload=np.zeros(self.body_count),
            cable_names=tuple(cable.name for cable in cables),
            cable_groups=tuple(cable.group for cable in cables),
            cable_ends=ends.reshape(-1, 2),
            cable_laws=tuple(self.cables[cable.group].law(length) for cable, length in laws),
            slack=self.slack,
            oscillators=tuple(self.actuated),
            groups=tuple(self.cables_of_oscillator.values()),
            contacts=np.array(sorted(number[node] for node in self.contact_nodes)),
        )

    @cached_property
    def all_struts(self) -> tuple[Member, ...]:
        """All struts, in the order of the file."""
        return tuple(_members("struts", self.struts))

    @cached_property
    def all_cables(self) -> tuple[Member, ...]:
        """All cables, in the order of the pairs of bodies; cables from fixed nodes come first. This
        order numbers them everywhere."""
        return tuple(sorted(_members("cables", self.cables), key=self._bodies_joined))

    @cached_property
    def bodies(self) -> tuple[tuple[str, ...], ...]:
        """Nodes of each rigid body. Bodies and nodes are in the order of the struts; then come
        point masses and spheres at other nodes."""
        of_struts = components(self.all_struts)
        used = {node for body in of_struts for node in body}
        spheres = (node for group in self.spheres.values() for node in group.nodes)
        with_mass = dict.fromkeys([*self.masses, *spheres])
        return *of_struts, *((node,) for node in with_mass if node not in used | self._fixed)

    @cached_property
    def body_names(self) -> tuple[str, ...]:
        """Names of the bodies: the group of struts with the same nodes, the part of a structure of
        NTRT with the same nodes, such as "vertebra1", or the nodes of the body."""
        names: dict[frozenset[str], str] = {}
        used = self.body_of_node
        for part in {node.rpartition("/")[0] for node in used} - {""}:
            names[frozenset(node for node in used if node.startswith(f"{part}/"))] = part
        for name, group in self.struts.items():
            names[frozenset(node for pair in group.pairs for node in pair)] = name
        return tuple(names.get(frozenset(body), " ".join(body)) for body in self.bodies)

    @cached_property
    def body_of_node(self) -> dict[str, int]:
        """Index of the body of each node that is used; fixed nodes come last and have WORLD."""
        of_bodies = {node: body for body, nodes in enumerate(self.bodies) for node in nodes}
        fixed = [node for node in self.nodes if node in self._fixed and node not in of_bodies]
        return of_bodies | dict.fromkeys(fixed, WORLD)

    @cached_property
    def unused(self) -> tuple[str, ...]:
        """Nodes that nothing uses, which are left out."""
        named = {node for cable in self.all_cables for node in cable.nodes}
        named |= {*self.body_of_node, *self.anchors}
        return tuple(node for node in self.nodes if node not in named)

    @cached_property
    def _fixed(self) -> set[str]:
        """Nodes with an anchor along all axes."""
        return {node for node, axes in self.anchors.items() if axes == "xyz"}

    @cached_property
    def sphere_of_node(self) -> dict[str, Sphere]:
        """Sphere of each node with one: its own one, or by the node's first strut."""
        spheres: dict[str, Sphere] = {}
        for strut in reversed(self.all_struts):
            group = self.struts[strut.group]
            touching = (group.node_diameter or group.diameter) / 2
            sphere = Sphere(group.node_diameter, group.density, group.contact_radius, touching)
            spheres |= dict.fromkeys(strut.nodes, sphere)
        for own in self.spheres.values():
            sphere = Sphere(own.diameter, own.density, own.contact_radius, own.diameter / 2)
            spheres |= dict.fromkeys(own.nodes, sphere)
        return spheres

    def _contact_radius(self, node: str) -> float:
        """Radius (m) of the foot at a node."""
        sphere = self.sphere_of_node.get(node)
        if sphere is not None and sphere.contact_radius is not None:
            return sphere.contact_radius
        return 0.0 if sphere is None or "z" in self._held(node) else sphere.touching_radius

    @cached_property
    def free_lengths(self) -> tuple[float, ...]:
        """Free lengths of the cables in m. If the file has a tension, they are computed from it."""
        cables = ((self.cables[cable.group], self._length(cable)) for cable in self.all_cables)
        return tuple(group.free_length_at(length) for group, length in cables)

    @cached_property
    def cables_of_oscillator(self) -> dict[str, tuple[int, ...]]:
        """Indices of the cables that each oscillator drives."""
        numbers = {}
        for number, cable in enumerate(self.all_cables):
            backward = cable._replace(nodes=cable.nodes[::-1])
            numbers[cable.name] = numbers[backward.name] = number
        driven = {}
        for oscillator, names in self.actuated.items():
            for place, name in enumerate(names):
                if name not in numbers:
                    problem = f"found unknown cable '{name}'; {hint(name, numbers)}"
                    refuse(f"actuated.{oscillator}[{place}]", problem)
            driven[oscillator] = tuple(numbers[name] for name in names)
        return driven

    @property
    def contact_nodes(self) -> tuple[str, ...]:
        """Names of the nodes that the ground can touch, in the order of `nodes`."""
        moving = {node for body in self.bodies for node in body}
        touching = moving if self.contacts == "all" else self.contacts
        return tuple(node for node in self.nodes if node in touching)

    def _held(self, node: str) -> str:
        """Axes along which an anchor holds the node of a strut."""
        return "" if self.body_of_node[node] == WORLD else self.anchors.get(node, "")

    def _bodies_joined(self, cable: Member) -> tuple[int, int]:
        """Indices of the two bodies that a cable joins, the lower one first; WORLD for a fixed
        node."""
        first, second = (self.body_of_node[node] for node in cable.nodes)
        return min(first, second), max(first, second)

    def _length(self, member: Member) -> float:
        first, second = (np.array(self.nodes[node]) for node in member.nodes)
        return float(np.linalg.norm(second - first))

    @pydantic.model_validator(mode="before")
    @classmethod
    def _apply_unit(cls, tree: Any) -> Any:
        """Applies the key `unit` of a tree to all coordinates without a unit. Only mm is kept:
        other units of a robot follow from its lengths."""
        if not isinstance(tree, dict) or tree.get("unit") is None:
            return tree
        unit = tree["unit"]
        try:
            quantity_to_si(f"1 {unit}", "m")
        except ValueError:
            refuse("unit", f"found {described(unit)}, expected a unit of length, such as mm")
        tree = tree | {"unit": "mm" if unit == "mm" else None}
        if "nodes" in tree:
            tree["nodes"] = mapped(
                tree["nodes"], lambda x: f"{x!r} {unit}" if type(x) in (int, float) else x
            )
        return tree

    @pydantic.model_validator(mode="before")
    @classmethod
    def _check_groups(cls, tree: Any) -> Any:
        """Refuses a group without pairs: most often a change of a group of another name."""
        for kind in ("struts", "cables") if isinstance(tree, dict) else ():
            given = tree.get(kind)
            groups = given.items() if isinstance(given, dict) else ()
            mappings = [(str(name), group) for name, group in groups if isinstance(group, dict)]
            whole = [name for name, group in mappings if "pairs" in group]
            for name, group in mappings:
                if "pairs" not in group:
                    refuse(f"{kind}.{name}", f"found a group without pairs; {hint(name, whole)}")
        return tree

    @pydantic.model_validator(mode="after")
    def _check(self) -> StructureFile:
        self._check_names()
        self._check_pairs()
        self._check_nodes()
        self._check_sizes()
        self._check_inertia()
        self._check_places()
        self._check_bodies()
        self._check_elastic_struts()
        self._check_tensions()
        self._check_actuated()
        if not any(map(self._can_move, self.bodies)):
            refuse("anchors", "hold every body, expected one that can move")
        if not self.contact_nodes:
            refuse("contacts", "found none, expected one node at least")
        check_one_per_body("offsets", self.offsets, self.body_count)
        return self

    def _check_names(self) -> None:
        """Refuses unknown nodes."""
        ends = [(member.key, node) for member in self._all_members for node in member.nodes]
        anchors = [(f"anchors.{node}", node) for node in self.anchors]
        for key, node in (*ends, *anchors, *self._moving_nodes):
            if node not in self.nodes:
                refuse(key, f"found unknown node '{node}'; {hint(node, self.nodes)}")

    @property
    def _all_members(self) -> tuple[Member, ...]:
        """Struts and cables, in the order of the file."""
        return *self.all_struts, *_members("cables", self.cables)

    @property
    def _moving_nodes(self) -> Iterator[tuple[str, str]]:
        """Keys and nodes that must be able to move."""
        yield from ((f"masses.{node}", node) for node in self.masses)
        for name, group in self.spheres.items():
            yield from ((f"spheres.{name}.nodes[{i}]", node) for i, node in enumerate(group.nodes))
        yield from ((f"loads.{node}", node) for node in self.loads)
        if self.contacts != "all":
            yield from ((f"contacts[{i}]", node) for i, node in enumerate(self.contacts))

    def _check_nodes(self) -> None:
        """Refuses nodes that neither belong to a body nor are fixed, and bodies that nothing
        holds."""
        ends = {node: None for member in self._all_members for node in member.nodes}
        for node in ends | self.anchors:
            if node not in self.body_of_node:
                expected = "a node of a strut, an anchor along xyz, a mass or a sphere"
                refuse(f"nodes.{node}", f"is on no strut, expected {expected}")
        for key, node in self._moving_nodes:
            if self.body_of_node.get(node, WORLD) == WORLD:
                what = "unused" if node in self.unused else "fixed"
                refuse(key, f"found the {what} node '{node}', expected one that can move")
        if not self.bodies:
            refuse("nodes", "none can move, expected struts, masses or spheres")
        for body in self.bodies:
            if len(body) == 1 and body[0] not in ends:
                refuse(f"nodes.{body[0]}", "is on no strut and no cable, expected a cable to it")

    def _can_move(self, body: tuple[str, ...]) -> bool:
        """True if a body with these nodes can move in spite of its anchors. The spin of a straight
        body does not count."""
        p = np.array([self.nodes[node] for node in body])
        motions = rigid_motions((p - p[0]) / (np.ptp(p, axis=0).max() or 1.0))
        held = np.array([[axis in self._held(node) for axis in "xyz"] for node in body])
        ways = np.linalg.matrix_rank(motions.reshape(-1, 6), tol=LEAST_DISTANCE)
        return bool(np.linalg.matrix_rank(motions[held], tol=LEAST_DISTANCE) < ways)

    def _check_pairs(self) -> None:
        keys: dict[object, str] = {}
        for member in self._all_members:
            if self._length(member) == 0.0:
                refuse(member.key, "has length 0, expected nodes at two places")
            is_cable, nodes = member.key.startswith("cables."), frozenset(member.nodes)
            earlier = keys.setdefault((member.group, nodes) if is_cable else nodes, member.key)
            if earlier != member.key:
                where = " in a group of cables" if is_cable else ""
                refuse(member.key, f"found the nodes of {earlier}, expected each pair once{where}")

    def _check_sizes(self) -> None:
        for node, place in self.nodes.items():
            if max(map(abs, place)) > LONGEST:
                expected = f"expected coordinates of at most {LONGEST:g} m"
                refuse(f"nodes.{node}", f"found {place}, {expected}")
        for strut in self.all_struts:
            group, length = self.struts[strut.group], self._length(strut)
            check_strut(strut.key, length=length, diameter=group.diameter, density=group.density)

    def _check_inertia(self) -> None:
        """Refuses bodies of several nodes without struts or spheres that have mass, and others
        without mass."""
        mass = np.zeros(self.body_count)
        for strut in self.all_struts:
            group, body = self.struts[strut.group], self.body_of_node[strut.nodes[0]]
            mass[body] += math.pi / 4 * group.diameter**2 * group.density * self._length(strut)
        for node, sphere in self.sphere_of_node.items():
            mass[self.body_of_node[node]] += math.pi / 6 * sphere.diameter**3 * sphere.density
        for node, own in self.masses.items():
            body = self.body_of_node[node]
            mass[body] += own if len(self.bodies[body]) == 1 else 0.0
        if mass.min() < LIGHTEST:
            node = self.bodies[int(mass.argmin())][0]
            without = "" if node in self.masses else "without point masses "
            problem = f"is on a body whose mass {without}is {mass.min():.3g} kg"
            refuse(f"nodes.{node}", f"{problem}, expected at least {LIGHTEST:g} kg")

    def _check_places(self) -> None:
        least = LEAST_DISTANCE * self.size
        names = list(self.body_of_node)
        p_WN = np.array([self.nodes[node] for node in names])
        for i in range(1, len(names)):
            distances = np.linalg.norm(p_WN[:i] - p_WN[i], axis=1)
            if distances.min() < least:
                problem = f"found the place of '{names[distances.argmin()]}'"
                refuse(f"nodes.{names[i]}", f"{problem}, expected nodes {least:.3g} m apart")

    def _check_bodies(self) -> None:
        for cable in self.all_cables:
            first, second = self._bodies_joined(cable)
            if first == second == WORLD:
                refuse(cable.key, "joins two fixed nodes, expected a node of a strut")
            if first == second:
                problem = f"joins the body '{self.body_names[first]}' to itself"
                refuse(cable.key, f"{problem}, expected nodes of two bodies")
        # Anchored nodes are joined by the world.
        anchored = [Member("", "", pair) for pair in itertools.pairwise(self.anchors)]
        groups = components((*self.all_struts, *self.all_cables, *anchored))
        joined = [nodes for nodes in groups if self.body_of_node[nodes[0]] != WORLD]
        if len(joined) > 1:
            one, other = (self.body_names[self.body_of_node[nodes[0]]] for nodes in joined[:2])
            problem = f"no cables lead from the body '{other}' to '{one}'"
            refuse("cables", f"{problem}, expected all bodies to be joined")

    def _check_elastic_struts(self) -> None:
        """Refuses an axial stiffness of struts whose forces would depend on the others of a
        body."""
        for strut in self.all_struts:
            body = self.bodies[self.body_of_node[strut.nodes[0]]]
            if self.struts[strut.group].axial_stiffness is not None and len(body) > 2:
                problem = f"the strut {strut.name} is part of a rigid body of several struts"
                refuse(f"struts.{strut.group}.axial_stiffness", problem)

    def _check_tensions(self) -> None:
        for cable, free_length in zip(self.all_cables, self.free_lengths, strict=True):
            if free_length < 0.0:
                group = self.cables[cable.group]
                most = f"at most {group.greatest_tension(self._length(cable)):.4g} N"
                problem = f"found {group.tension} N, expected {most} for '{cable.name}'"
                refuse(f"cables.{cable.group}.tension", f"{problem}, where its free length is 0")

    def _check_actuated(self) -> None:
        oscillators: dict[int, str] = {}
        for oscillator, cables in self.cables_of_oscillator.items():
            for place, cable in enumerate(cables):
                if cable in oscillators:
                    name = self.all_cables[cable].name
                    problem = f"found '{name}', which '{oscillators[cable]}' drives"
                    refuse(f"actuated.{oscillator}[{place}]", f"{problem}, expected it once")
                oscillators[cable] = oscillator


RobotKind = Annotated[Tetrahedra | StructureFile, Kinds()]
"""Union of the kinds of robots. A mapping without a tag is of the first kind.

All have `gravity`, `offsets` (one for each body), `body_count`, `slack`, `size`, `lacking`
(see scenario.metrics), `blueprint()` and `implied_changes()`.
"""


def _members(key: str, groups: Mapping[str, StrutGroup | CableGroup]) -> Iterator[Member]:
    for name, group in groups.items():
        for place, (first, second) in enumerate(group.pairs):
            yield Member(f"{key}.{name}.pairs[{place}]", name, (first, second))


def components(members: Iterable[Member]) -> tuple[tuple[str, ...], ...]:
    """Groups of nodes connected by members, in the order of the members."""
    first_node: dict[str, str] = {}
    for member in members:
        start, joined = (first_node.setdefault(node, node) for node in member.nodes)
        if start != joined:
            first_node |= {node: start for node, old in first_node.items() if old == joined}
    components: dict[str, list[str]] = {}
    for node, start in first_node.items():
        components.setdefault(start, []).append(node)
    return tuple(tuple(nodes) for nodes in components.values())
