"""Kinds of robots: the row of tetrahedra, and structures, which are any tensegrity as data.

Struts of a structure that share a node are one rigid body; cables join bodies. Coordinates are in
World (x forward, y left, z up) and need only be near a static equilibrium.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self

import numpy as np
import pydantic
from pydantic import Field

from tetra_drake.scenario.layout import Layout
from tetra_drake.scenario.metric_units import METRICS_OF_A_ROW
from tetra_drake.scenario.nesting import Tetrahedra
from tetra_drake.scenario.sections import (
    TAG,
    Kinds,
    Section,
    Tree,
    described,
    hint,
    quantity,
    refuse,
)
from tetra_drake.scenario.units import quantity_to_si

MOST_NODES, MOST_BODIES, MOST_CABLES = 1000, 200, 2000

LEAST_DISTANCE = 1e-3
"""Least distance between two nodes, as a share of the shortest strut."""

Point = Annotated[list[float], Field(min_length=3, max_length=3)]
Pair = Annotated[list[str], Field(min_length=2, max_length=2)]
Pairs = Annotated[list[Pair], Field(min_length=1)]


class StrutGroup(Section):
    """Struts of one make: solid cylinders with a sphere of the same density at each end."""

    pairs: Pairs
    diameter: float = quantity("m", gt=0)
    density: float = quantity("kg/m^3", gt=0)
    node_diameter: float = quantity("m", ge=0)
    """Diameter of the spheres; 0 for none. A node has one, that of its first strut in the file."""


class CableGroup(Section):
    """Cables of one make, which never push."""

    pairs: Pairs
    stiffness: float = quantity("N/m", gt=0)
    damping: float = quantity("N*s/m", ge=0)
    free_length: float | None = quantity("m", default=None, ge=0)
    tension: float | None = quantity("N", default=None, ge=0)
    """Tension where the nodes are as given, instead of a free length."""

    @pydantic.model_validator(mode="after")
    def _check(self) -> CableGroup:
        expected = "expected one of free_length and tension"
        if self.free_length is None and self.tension is None:
            refuse("free_length", f"found neither it nor a tension, {expected}")
        if self.free_length is not None and self.tension is not None:
            refuse("tension", f"found a free_length, too, {expected}")
        return self


class Member(NamedTuple):
    """A strut or a cable."""

    key: str
    """Its place in the structure file, such as "cables.side.pairs[0]"."""
    group: str
    nodes: tuple[str, str]

    @property
    def name(self) -> str:
        """Group and nodes, such as "side a1 b1"."""
        return " ".join((self.group, *self.nodes))


class Structure(Section):
    """A tensegrity: nodes, struts and cables between them, and what actuates the cables.

    Nodes, bodies and cables are numbered in the order of `nodes`, `bodies` and `all_cables`. A file
    may give the `unit` of coordinates that are bare numbers; once read, they are in m.
    """

    lacking: ClassVar[tuple[str, ...]] = METRICS_OF_A_ROW
    """Metrics that the robot does not have."""
    slack: ClassVar[bool] = True
    """Cables never push."""

    nodes: dict[str, Point] = quantity("m")
    struts: dict[str, StrutGroup] = Field(min_length=1)
    cables: dict[str, CableGroup] = Field(default={})
    actuated: dict[str, Annotated[list[str], Field(min_length=1)]] = Field(default={})
    """Names of the cables that each oscillator drives, their nodes in either order."""
    masses: dict[str, Annotated[float, Field(gt=0)]] = quantity("kg", default={})
    """Point masses at nodes, such as motors."""
    contacts: Literal["all"] | list[str] = "all"
    """Nodes that the ground can touch."""
    gravity: float = quantity("m/s^2", default=9.80665, ge=0)
    offsets: list[Point] = quantity("m", default=[])
    """Displacement [x, y, z] of each body at t = 0; none if empty."""

    def __copy__(self) -> Self:
        # Without the cached properties, as a copy may get other values.
        fields = {name: getattr(self, name) for name in type(self).model_fields}
        return self.model_construct(**fields)

    @property
    def body_count(self) -> int:
        """The number of rigid bodies."""
        return len(self.bodies)

    @property
    def oscillator_count(self) -> int:
        """The number of neural oscillators."""
        return len(self.actuated)

    @property
    def size(self) -> float:
        """Length in m of the shortest strut, of which `disturbances.start` is a share."""
        return min(map(self._length, self.all_struts))

    def following(self, base: Section, changes: Tree) -> Tree:
        """What changes, too, where `changes` made this robot of a base: nothing."""
        return {}

    @cached_property
    def all_struts(self) -> tuple[Member, ...]:
        """The struts, in the order of the file."""
        return tuple(_members("struts", self.struts))

    @cached_property
    def all_cables(self) -> tuple[Member, ...]:
        """The cables, in the order of the file."""
        return tuple(_members("cables", self.cables))

    @cached_property
    def ordered_cables(self) -> tuple[int, ...]:
        """The numbers of the cables, pair by pair of bodies: the order in which they are simulated
        and recorded."""
        bodies = [self._bodies_joined(cable) for cable in self.all_cables]
        return tuple(sorted(range(len(bodies)), key=bodies.__getitem__))

    def layout(self) -> Layout:
        """Cables and oscillators of the robot, cables in the order of `ordered_cables`."""
        cables = [self.all_cables[number] for number in self.ordered_cables]
        place = {number: place for place, number in enumerate(self.ordered_cables)}
        ends = [[self.nodes[node] for node in cable.nodes] for cable in cables]
        return Layout(
            cable_names=tuple(cable.name for cable in cables),
            ends=np.array(ends).reshape(-1, 2, 3),
            bodies=np.array([self._bodies_joined(cable) for cable in cables]).reshape(-1, 2),
            oscillators=tuple(self.actuated),
            groups=tuple(
                tuple(place[number] for number in numbers)
                for numbers in self.cables_of_oscillator.values()
            ),
        )

    @cached_property
    def bodies(self) -> tuple[tuple[str, ...], ...]:
        """The nodes of each rigid body, bodies and nodes in the order of the struts."""
        return _components(strut.nodes for strut in self.all_struts)

    @cached_property
    def body_names(self) -> tuple[str, ...]:
        """The group of struts whose nodes are those of the body, or else its nodes."""
        group_of_nodes = {
            frozenset(node for pair in group.pairs for node in pair): name
            for name, group in self.struts.items()
        }
        return tuple(group_of_nodes.get(frozenset(body), " ".join(body)) for body in self.bodies)

    @cached_property
    def body_of_node(self) -> dict[str, int]:
        """The number of the body that a node belongs to."""
        return {node: body for body, nodes in enumerate(self.bodies) for node in nodes}

    @cached_property
    def sphere_of_node(self) -> dict[str, StrutGroup]:
        """The group whose sphere a node has: that of the first strut at the node."""
        groups: dict[str, StrutGroup] = {}
        for strut in self.all_struts:
            for node in strut.nodes:
                groups.setdefault(node, self.struts[strut.group])
        return groups

    @cached_property
    def free_lengths(self) -> tuple[float, ...]:
        """Free lengths of the cables in m; from the tension where the file gives that."""
        lengths = []
        for cable in self.all_cables:
            group = self.cables[cable.group]
            if group.free_length is not None:
                lengths.append(group.free_length)
            elif group.tension is not None:
                lengths.append(self._length(cable) - group.tension / group.stiffness)
        return tuple(lengths)

    @cached_property
    def cables_of_oscillator(self) -> dict[str, tuple[int, ...]]:
        """The numbers of the cables that each oscillator drives."""
        numbers = self._cable_numbers
        return {
            oscillator: tuple(numbers[name] for name in names)
            for oscillator, names in self.actuated.items()
        }

    @property
    def contact_nodes(self) -> tuple[str, ...]:
        """The nodes that the ground can touch, in the order of `nodes`."""
        touching = self.nodes if self.contacts == "all" else self.contacts
        return tuple(node for node in self.nodes if node in touching)

    @property
    def _cable_numbers(self) -> dict[str, int]:
        """The numbers of the cables by their names, for both orders of the nodes."""
        numbers = {}
        for number, cable in enumerate(self.all_cables):
            backward = cable._replace(nodes=(cable.nodes[1], cable.nodes[0]))
            numbers[cable.name] = numbers[backward.name] = number
        return numbers

    def _bodies_joined(self, cable: Member) -> tuple[int, int]:
        """The numbers of the bodies that a cable joins, the lower one first."""
        first, second = (self.body_of_node[node] for node in cable.nodes)
        return min(first, second), max(first, second)

    def _length(self, member: Member) -> float:
        first, second = (np.array(self.nodes[node]) for node in member.nodes)
        return float(np.linalg.norm(second - first))

    @pydantic.model_validator(mode="before")
    @classmethod
    def _read_nodes(cls, tree: Any) -> Any:
        """The tree with a unit at every coordinate, if it has the key `unit`, and without that."""
        if not isinstance(tree, dict):
            return tree
        tree = dict(tree)
        unit = tree.pop("unit", None)
        if not isinstance(tree.get("nodes"), dict):
            return tree
        for node in tree["nodes"]:
            if not isinstance(node, str):
                refuse(f"nodes.{node}", f"found the name {node}, expected a text, such as n{node}")
        if unit is None:
            return tree
        try:
            quantity_to_si(f"1 {unit}", "m")
        except ValueError:
            refuse("unit", f"found {described(unit)}, expected a unit of length, such as mm")
        tree["nodes"] = {node: _with_unit(point, unit) for node, point in tree["nodes"].items()}
        return tree

    @pydantic.model_validator(mode="after")
    def _check(self) -> Structure:
        self._check_names()
        self._check_pairs()
        self._check_nodes()
        self._check_bodies()
        self._check_tensions()
        self._check_actuated()
        for node in self.masses:
            self._check_node(f"masses.{node}", node)
        if self.contacts != "all":
            for place, node in enumerate(self.contacts):
                self._check_node(f"contacts[{place}]", node)
        if len(self.offsets) not in (0, self.body_count):
            problem = f"found {len(self.offsets)} items, expected none or {self.body_count}"
            refuse("offsets", f"{problem}, one for each body")
        return self

    def _check_names(self) -> None:
        for key in ("nodes", "struts", "cables", "actuated"):
            for name in getattr(self, key):
                # Blanks separate the names of a cable, dots those of a key, commas keys.
                if name in ("", TAG) or any(c.isspace() or c in ".," for c in name):
                    expected = "expected one without blanks, dots and commas"
                    refuse(f"{key}.{name}", f"found the name '{name}', {expected}")

    def _check_node(self, key: str, node: str) -> None:
        if node not in self.nodes:
            refuse(key, f"found unknown node '{node}'; {hint(node, self.nodes)}")

    def _check_pairs(self) -> None:
        keys: dict[frozenset[str], str] = {}
        for member in (*self.all_struts, *self.all_cables):
            first, second = member.nodes
            self._check_node(member.key, first)
            self._check_node(member.key, second)
            if first == second:
                refuse(member.key, f"found '{first}' twice, expected two nodes")
            earlier = keys.setdefault(frozenset(member.nodes), member.key)
            if earlier != member.key:
                problem = f"found '{first}' and '{second}' as in {earlier}"
                refuse(member.key, f"{problem}, expected each pair of nodes once")
        if len(self.all_cables) > MOST_CABLES:
            refuse("cables", f"found {len(self.all_cables)} cables, expected at most {MOST_CABLES}")

    def _check_nodes(self) -> None:
        if len(self.nodes) > MOST_NODES:
            refuse("nodes", f"found {len(self.nodes)} nodes, expected at most {MOST_NODES}")
        for node in self.nodes:
            if node not in self.body_of_node:
                refuse(f"nodes.{node}", "is on no strut, expected a node of a strut")
        for strut in self.all_struts:
            if self._length(strut) == 0.0:
                refuse(strut.key, "is a strut of length 0, expected nodes at two places")
        least = LEAST_DISTANCE * self.size
        p_WN = np.array(list(self.nodes.values()))
        distances = np.linalg.norm(p_WN[:, None] - p_WN, axis=2)
        np.fill_diagonal(distances, np.inf)
        if distances.min() < least:
            names = list(self.nodes)
            first, second = divmod(int(distances.argmin()), len(names))
            problem = f"found the place of '{names[first]}', too"
            expected = f"expected nodes at least {least:.3g} m apart"
            refuse(f"nodes.{names[second]}", f"{problem}, {expected}")

    def _check_bodies(self) -> None:
        if len(self.bodies) > MOST_BODIES:
            refuse("struts", f"found {len(self.bodies)} bodies, expected at most {MOST_BODIES}")
        for cable in self.all_cables:
            first, second = (self.body_of_node[node] for node in cable.nodes)
            if first == second:
                problem = f"joins the body '{self.body_names[first]}' to itself"
                refuse(cable.key, f"{problem}, expected nodes of two bodies")
        joined = _components(member.nodes for member in (*self.all_struts, *self.all_cables))
        if len(joined) > 1:
            apart = self.body_names[self.body_of_node[joined[1][0]]]
            first_body = self.body_names[0]
            problem = f"no cables lead from the body '{apart}' to '{first_body}'"
            refuse("cables", f"{problem}, expected all bodies to be joined")

    def _check_tensions(self) -> None:
        for cable, free_length in zip(self.all_cables, self.free_lengths, strict=True):
            if free_length < 0.0:
                group = self.cables[cable.group]
                most = f"at most {self._length(cable) * group.stiffness:.4g} N"
                problem = f"found {group.tension} N, expected {most} for '{cable.name}'"
                refuse(f"cables.{cable.group}.tension", f"{problem}: its stiffness times length")

    def _check_actuated(self) -> None:
        numbers = self._cable_numbers
        oscillators: dict[int, str] = {}
        for oscillator, names in self.actuated.items():
            for place, name in enumerate(names):
                key = f"actuated.{oscillator}[{place}]"
                if name not in numbers:
                    refuse(key, f"found unknown cable '{name}'; {hint(name, numbers)}")
                if numbers[name] in oscillators:
                    problem = f"found '{name}', which '{oscillators[numbers[name]]}' drives"
                    refuse(key, f"{problem}, expected each cable once")
                oscillators[numbers[name]] = oscillator


Robot = Annotated[Tetrahedra | Structure, Kinds()]
"""The tagged kinds of robots; without a tag it is the first.

All have `gravity`, `offsets` (one for each body), `body_count`, `oscillator_count`, `slack`,
`size`, `lacking` (metrics), `layout()` and `following()`.
"""


def _with_unit(point: Any, unit: str) -> Any:
    """The coordinates of a point as texts with a unit, where they are bare numbers."""
    if not isinstance(point, list):
        return point
    return [f"{x!r} {unit}" if type(x) in (int, float) else x for x in point]


def _members(key: str, groups: Mapping[str, StrutGroup | CableGroup]) -> Iterator[Member]:
    for name, group in groups.items():
        for place, (first, second) in enumerate(group.pairs):
            yield Member(f"{key}.{name}.pairs[{place}]", name, (first, second))


def _components(pairs: Iterable[tuple[str, str]]) -> tuple[tuple[str, ...], ...]:
    """The connected components of a graph, they and their nodes in the order of its edges."""
    component: dict[str, list[str]] = {}
    nodes: dict[str, None] = {}
    for pair in pairs:
        first, second = (component.setdefault(node, [node]) for node in pair)
        nodes.update(dict.fromkeys(pair))
        if first is not second:
            first.extend(second)
            component.update(dict.fromkeys(second, first))
    ordered: dict[int, list[str]] = {}
    for node in nodes:
        ordered.setdefault(id(component[node]), []).append(node)
    return tuple(tuple(members) for members in ordered.values())
