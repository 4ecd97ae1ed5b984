"""Structures: robots of any shape, as data about nodes, struts, cables and oscillators.

Struts of a structure that share a node are one rigid body. Cables join bodies. Coordinates are in
the world frame (x forward, y left, z up), near a static equilibrium.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
import pydantic
from pydantic import Field

from tetra_drake.laws.cable import CableConstants, CableLaw, elastic_stretch
from tetra_drake.laws.model import WORLD
from tetra_drake.scenario.blueprint import LONGEST, Blueprint
from tetra_drake.scenario.metrics import ROW
from tetra_drake.scenario.robot_tetrahedra import Tetrahedra
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
    """Struts with the same constants: solid cylinders with a sphere of the same density at each
    end."""

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
    """Axial force per shortening of a strut, E A / l; none for rigid struts. Without load, a strut
    is as long as the distance of its nodes in the file. In equilibrium, the axial force shortens
    it, and natural frequencies include its stiffness; in motion it keeps its length. Frequencies
    leave out the inertia of its elongation. If a strut is 17, 3.3 or 1 times as stiff as its cable,
    the first frequency is 0.25, 1.2 or 4 % higher than with finite-element rods, and the second is
    0.75, 3.7 or 12 % higher."""


class SphereGroup(Section):
    """Equal solid spheres at nodes. They replace the spheres of struts at these nodes. A sphere at
    a node without struts is a body of its own."""

    nodes: list[str] = Field(min_length=1)
    """Nodes at the centres of the spheres."""
    diameter: Length = Field(gt=0)
    """Diameter of a sphere."""
    density: Density = Field(ge=0)
    """Density of a sphere. It may be 0 where other parts of the body have mass."""
    contact_radius: Length | None = Field(default=None, ge=0)
    """Radius with which a sphere touches the ground; by default its own. The default is 0 for nodes
    that anchors hold along z."""


class CableGroup(CableConstants):
    """Cables with the same constants. They never push."""

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

    def law(self, distance: float) -> dict[str, float]:
        """Constants (SI) of a cable's force law, by the names of laws.cable.CableLaw. `distance`
        (m) is the distance of its nodes in the file; it gives the free length for a `tension`."""
        free_length = self.free_length
        if free_length is None:
            law = CableLaw(**self.constants(stiffness=self.stiffness, free_length=distance))
            free_length = distance - elastic_stretch(self.tension or 0.0, law)
        return self.constants(stiffness=self.stiffness, free_length=free_length)


class Member(NamedTuple):
    """A strut or a cable of a structure file."""

    key: str
    """Key in the file, such as "cables.side.pairs[0]"."""
    group: str
    nodes: tuple[str, str]


class StructureFile(Section):
    """A tensegrity: nodes, struts, cables and the oscillators that actuate cables."""

    tag: ClassVar[str] = "Structure"
    keys_of_files: ClassVar = {"file": "Name or file of a structure; the other keys change it."}
    lacking: ClassVar[tuple[str, ...]] = (ROW,)
    """Properties that some metrics need and this robot does not have."""

    nodes: Keyed[Name, Coordinates] = Field(max_length=MOST_NODES)
    """Coordinates [x, y, z] of each node, near an equilibrium. A node that nothing else names is
    left out."""
    unit: str | None = None
    """Unit of coordinates that are bare numbers, such as cm. A robot in mm is shown in mm."""
    struts: Keyed[Name, StrutGroup] = Field(default={})
    cables: Keyed[Name, CableGroup] = Field(default={})
    spheres: Keyed[Name, SphereGroup] = Field(default={})
    actuated: Keyed[Name, Annotated[list[str], Field(min_length=1)]] = Field(default={})
    """Names of the cables that each oscillator drives. The two nodes in a name may have either
    order."""
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
    """Ratio of damping to stiffness of an anchor. With less than 1 ms, a stiff anchor vibrates, and
    steps are short."""
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

    @property
    def body_count(self) -> int:
        """Number of rigid bodies."""
        return len(self._nodes_of_bodies())

    @property
    def size(self) -> float:
        """Length (m) of the shortest strut, or of the shortest cable if there are no struts; the
        unit of `disturbances.start`."""
        return self.blueprint().shortest

    def implied_changes(self, base: Section, changes: Tree) -> Tree:
        """Further changes that follow from `changes` to the robot `base`: none for structures, so
        the mapping is empty. Rows of tetrahedra adapt their spacing."""
        return {}

    def blueprint(self) -> Blueprint:
        """The robot with its nodes at the positions of the file.

        Bodies and their nodes are in the order of the struts; then come other nodes with a mass or
        a sphere. Cables are in the order of the pairs of bodies, those from fixed nodes first.
        """
        bodies = self._nodes_of_bodies()
        body_of = {node: body for body, nodes in enumerate(bodies) for node in nodes}
        moving = [*body_of]
        fixed = [node for node in self.nodes if self.anchors.get(node) == "xyz"]
        body_of |= {node: WORLD for node in fixed if node not in body_of}
        nodes = tuple(body_of)
        number = {node: index for index, node in enumerate(nodes)}
        held = np.array([[axis in self.anchors.get(node, "") for axis in "xyz"] for node in nodes])
        held[len(moving) :] = False
        touching = moving if self.contacts == "all" else self.contacts
        radius, density, contact_radius = self._spheres(number, held)

        struts = sorted(_members("struts", self.struts), key=lambda strut: body_of[strut.nodes[0]])
        makes = [self.struts[strut.group] for strut in struts]
        ends = [[number[node] for node in strut.nodes] for strut in struts]
        cables = sorted(
            _members("cables", self.cables),
            key=lambda cable: sorted(body_of[node] for node in cable.nodes),
        )
        cable_ends, cable_laws = [], []
        for cable in cables:
            first, second = sorted(cable.nodes, key=body_of.__getitem__)
            span = np.array(self.nodes[second]) - self.nodes[first]
            cable_ends.append([number[first], number[second]])
            cable_laws.append(self.cables[cable.group].law(float(np.linalg.norm(span))))
        cable_names = tuple(" ".join((cable.group, *cable.nodes)) for cable in cables)
        numbers = _cable_numbers(cable_names)
        groups = [  # unknown cables are refused by _check_actuated()
            tuple(numbers[name] for name in names if name in numbers)
            for names in self.actuated.values()
        ]

        return Blueprint(
            bodies=self._names_of_bodies(bodies, nodes),
            node_names=nodes,
            first_node=np.append(0, np.cumsum([len(nodes) for nodes in bodies])),
            p_WF=np.zeros((len(bodies), 3)),
            p_FN=np.array([self.nodes[node] for node in nodes]),
            struts=np.array(ends, dtype=int).reshape(-1, 2),
            strut_keys=tuple(strut.key for strut in struts),
            strut_radius=np.array([make.diameter / 2 for make in makes]),
            strut_density=np.array([make.density for make in makes]),
            strut_stiffness=np.array([make.axial_stiffness or math.inf for make in makes]),
            node_radius=radius,
            contact_radius=contact_radius,
            node_density=density,
            node_mass=np.array([self.masses.get(node, 0.0) for node in nodes]),
            node_load=np.array([self.loads.get(node, [0.0, 0.0, 0.0]) for node in nodes]),
            anchor_stiffness=self.anchor_stiffness * held,
            anchor_damping=self.anchor_stiffness * self.anchor_time_constant * held,
            payload=np.zeros(len(bodies)),
            offsets=np.array(self.offsets or np.zeros((len(bodies), 3))),
            cable_names=cable_names,
            cable_groups=tuple(cable.group for cable in cables),
            cable_keys=tuple(cable.key for cable in cables),
            cable_ends=np.array(cable_ends, dtype=int).reshape(-1, 2),
            cable_laws=tuple(cable_laws),
            slack=True,
            contacts=np.array(sorted({number[node] for node in touching}), dtype=int),
            oscillators=tuple(self.actuated),
            groups=tuple(groups),
        )

    def _spheres(self, number: Mapping[str, int], held: np.ndarray) -> np.ndarray:
        """Radii (m), densities (kg/m^3) and contact radii (m) of the spheres at the nodes: three
        rows (3, nodes). A node has the sphere of its first strut in the file, unless it has one of
        its own. `number` has the index of each node by name; `held` (nodes, 3) is True along the
        axes of its anchor."""
        spheres: list[tuple[list[str], StrutGroup | SphereGroup, float, float]] = []
        for bar in reversed(self.struts.values()):
            ends = [node for pair in bar.pairs for node in pair]
            spheres.append((ends, bar, bar.node_diameter, bar.node_diameter or bar.diameter))
        for own in self.spheres.values():
            spheres.append((own.nodes, own, own.diameter, own.diameter))

        made = np.zeros((3, len(number)))
        for names, make, diameter, foot in spheres:
            for node in (number[name] for name in names):
                by_default = 0.0 if held[node, 2] else foot / 2
                given = make.contact_radius
                made[:, node] = diameter / 2, make.density, by_default if given is None else given
        return made

    def _nodes_of_bodies(self) -> list[list[str]]:
        """Names of the nodes of each rigid body. Struts that share a node are one body. A node with
        a mass or sphere and without struts is a body of its own, unless it is fixed."""
        bodies = components(pair for group in self.struts.values() for pair in group.pairs)
        of_struts = {node for nodes in bodies for node in nodes}
        with_sphere = [node for group in self.spheres.values() for node in group.nodes]
        for node in dict.fromkeys([*self.masses, *with_sphere]):
            if node not in of_struts and self.anchors.get(node) != "xyz":
                bodies.append([node])
        return bodies

    def _names_of_bodies(self, bodies: list[list[str]], nodes: Sequence[str]) -> tuple[str, ...]:
        """Name of each body: the group of struts that has exactly its nodes, or the part of a
        structure of NTRT that has them, such as "vertebra1"; otherwise the names of its nodes."""
        names: dict[frozenset[str], str] = {}
        for part in {node.rpartition("/")[0] for node in nodes} - {""}:
            names[frozenset(node for node in nodes if node.startswith(f"{part}/"))] = part
        for name, group in self.struts.items():
            names[frozenset(node for pair in group.pairs for node in pair)] = name
        return tuple(names.get(frozenset(body), " ".join(body)) for body in bodies)

    @pydantic.model_validator(mode="before")
    @classmethod
    def _prepare(cls, tree: Any) -> Any:
        """Checks the content of a structure file before its fields are read, and completes it.

        Raises InputError if a group of struts or cables has no key `pairs`. Then most often a
        scenario meant to change a group of the file, but misspelled its name. Nodes get the unit
        of the key `unit` where their coordinates are bare numbers. Afterwards `unit` is "mm" or
        None: a robot in mm is shown in mm, for others Scenario.units chooses the unit by size.
        """
        if not isinstance(tree, dict):
            return tree
        for kind in ("struts", "cables"):
            given = tree.get(kind)
            groups = given.items() if isinstance(given, dict) else ()
            mappings = [(str(name), group) for name, group in groups if isinstance(group, dict)]
            whole = [name for name, group in mappings if "pairs" in group]
            for name, group in mappings:
                if "pairs" not in group:
                    refuse(f"{kind}.{name}", f"found a group without pairs; {hint(name, whole)}")

        unit = tree.get("unit")
        if unit is None:
            return tree
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

    @pydantic.model_validator(mode="after")
    def _check(self) -> StructureFile:
        """Refuses nodes that do not exist, are joined twice or to themselves, or hang on nothing;
        fixed nodes with a mass, sphere, load or contact; and nodes that are far away. Then checks
        what holds for any robot, see Blueprint.check()."""
        members = [*_members("struts", self.struts), *_members("cables", self.cables)]
        ends = [(member.key, node) for member in members for node in member.nodes]
        anchors = [(f"anchors.{node}", node) for node in self.anchors]
        moving = [(f"masses.{node}", node) for node in self.masses]
        for name, group in self.spheres.items():
            moving += [(f"spheres.{name}.nodes[{i}]", node) for i, node in enumerate(group.nodes)]
        moving += [(f"loads.{node}", node) for node in self.loads]
        if self.contacts != "all":
            moving += [(f"contacts[{i}]", node) for i, node in enumerate(self.contacts)]
        for key, node in (*ends, *anchors, *moving):
            if node not in self.nodes:
                refuse(key, f"found unknown node '{node}'; {hint(node, self.nodes)}")

        keys: dict[object, str] = {}
        for key, group_name, (first, second) in members:
            if self.nodes[first] == self.nodes[second]:
                refuse(key, "has length 0, expected nodes at two places")
            is_cable, pair = key.startswith("cables."), frozenset([first, second])
            earlier = keys.setdefault((group_name, pair) if is_cable else pair, key)
            if earlier != key:
                where = " in a group of cables" if is_cable else ""
                refuse(key, f"found the nodes of {earlier}, expected each pair once{where}")

        bodies, joined = self._nodes_of_bodies(), {node: None for _, node in ends}
        of_bodies = {node for nodes in bodies for node in nodes}
        for node in joined | self.anchors:
            if node not in of_bodies and self.anchors.get(node) != "xyz":
                expected = "a node of a strut, an anchor along xyz, a mass or a sphere"
                refuse(f"nodes.{node}", f"is on no strut, expected {expected}")
        for key, node in moving:
            if node not in of_bodies:
                what = "fixed" if node in self.anchors else "unused"
                refuse(key, f"found the {what} node '{node}', expected one that can move")
        if not bodies:
            refuse("nodes", "none can move, expected struts, masses or spheres")
        for node, *others in bodies:
            if not others and node not in joined:
                refuse(f"nodes.{node}", "is on no strut and no cable, expected a cable to it")

        for node, place in self.nodes.items():
            if max(map(abs, place)) > LONGEST:
                expected = f"expected coordinates of at most {LONGEST:g} m"
                refuse(f"nodes.{node}", f"found {place}, {expected}")
        blueprint = self.blueprint()
        blueprint.check()
        self._check_actuated(blueprint.cable_names)
        return self

    def _check_actuated(self, cable_names: Sequence[str]) -> None:
        """Raises InputError if `actuated` names a cable that is not among `cable_names`, the names
        of all cables, or gives a cable to a second oscillator."""
        numbers, drivers = _cable_numbers(cable_names), dict[int, str]()
        for oscillator, names in self.actuated.items():
            for i, name in enumerate(names):
                key = f"actuated.{oscillator}[{i}]"
                if name not in numbers:
                    refuse(key, f"found unknown cable '{name}'; {hint(name, numbers)}")
                cable = numbers[name]
                if cable in drivers:
                    found = f"found '{cable_names[cable]}', which '{drivers[cable]}' drives"
                    refuse(key, f"{found}, expected it once")
                drivers[cable] = oscillator


RobotKind = Annotated[Tetrahedra | StructureFile, Kinds()]
"""Robot of a scenario: a row of tetrahedra or a structure. A mapping without a tag is a Tetrahedra.

All have `gravity`, `offsets` (one for each body), `body_count`, `size`, `lacking` (see
scenario.metrics), `unit`, `blueprint()` and `implied_changes()`.
"""


def _members(key: str, groups: Mapping[str, StrutGroup | CableGroup]) -> Iterator[Member]:
    for name, group in groups.items():
        for place, (first, second) in enumerate(group.pairs):
            yield Member(f"{key}.{name}.pairs[{place}]", name, (first, second))


def _cable_numbers(names: Iterable[str]) -> dict[str, int]:
    """Indices of cables by their names, such as "side n1 n2". Each cable is listed with its two
    nodes in either order."""
    numbers: dict[str, int] = {}
    for number, name in enumerate(names):
        group, first, second = name.split()
        numbers[name] = numbers[f"{group} {second} {first}"] = number
    return numbers


def components(pairs: Iterable[Sequence[str]]) -> list[list[str]]:
    """Connected components of the graph with the pairs as edges, each a list of nodes; in the order
    of the pairs."""
    first_node: dict[str, str] = {}
    for pair in pairs:
        start, joined = (first_node.setdefault(node, node) for node in pair)
        if start != joined:
            first_node |= {node: start for node, old in first_node.items() if old == joined}
    groups: dict[str, list[str]] = {}
    for node, start in first_node.items():
        groups.setdefault(start, []).append(node)
    return [*groups.values()]
