"""Structures: robots of any shape, as data about nodes, struts, cables and oscillators.

Struts of a structure that share a node are one rigid body, and so are the parts of an entry of
`bodies`. Cables and joints join bodies. Coordinates are in the world frame (x forward, y left, z
up), near a static equilibrium. FORMAT.md describes the format of the files.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import operator
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
import pydantic
from pydantic import Field

from tetra_drake.laws.cable import CableLaw, Curve, elastic_stretch, elastic_tension
from tetra_drake.laws.model import WORLD
from tetra_drake.scenario.blueprint import LONGEST, Blueprint, GivenInertia, cable_numbers
from tetra_drake.scenario.robot_settings import RobotSettings
from tetra_drake.scenario.structure_graph import (
    Member,
    Pair,
    components,
    members,
    nodes_of,
    struts_by_name,
    unused_name,
)
from tetra_drake.scenario.tolerances import check_tolerances
from tetra_drake.settings.plugins import origin
from tetra_drake.settings.quantities import (
    THREE,
    Damping,
    Density,
    ForceQuantity,
    InertiaQuantity,
    Keyed,
    Length,
    Mass,
    Stiffness,
    Time,
    Torque,
    quantity,
)
from tetra_drake.settings.refusals import check_known, described, refuse
from tetra_drake.settings.section import (
    Section,
    Varied,
    mapped,
    parts_of,
    tree_value,
)
from tetra_drake.settings.units import quantity_to_si

MOST_NODES, MOST_PAIRS = 1000, 2000

LEAST_MOMENT = 1e-10
"""Least principal moment of inertia of a body, as a share of the greatest. The thinnest strut has
about this share."""

ROUNDED = 1e-12
"""Relative error of the moments of a flat body that counts as a rounding error."""


STRING_TIME = 1e-3
"""Ratio (s) of damping to stiffness of strings, as of anchors and joints."""


def _check_name(name: object) -> object:
    """Checks the name of a node, group or oscillator. Blanks, dots, brackets and commas are
    refused: they separate the parts of cable names, the parts of keys, and keys."""
    if not isinstance(name, str):
        refuse("", f"found the name {name}, expected a text, such as n{name}")
    if not name or re.search(r"[\s.,\[\]]", name) or not name.isprintable():
        refuse("", f"found the name '{name}', expected some without blanks, dots, commas, brackets")
    return name


Name = Annotated[str, pydantic.BeforeValidator(_check_name)]
BareLength = Annotated[Length, Field(json_schema_extra={"if": False})]
"""A length that needs no unit where the structure has one."""
Coordinates = Annotated[list[BareLength], THREE]
CablePath = Annotated[list[str], Field(min_length=2, max_length=MOST_NODES)]
AnchorAxes = Annotated[
    Literal["x", "y", "z", "xy", "xz", "yz", "xyz"],
    pydantic.BeforeValidator(lambda axes: "".join(sorted(axes)) if isinstance(axes, str) else axes),
    pydantic.WithJsonSchema(
        {"type": "string", "pattern": r"^(?!.*(.).*\1)[xyz]{1,3}$", "format": "some of x, y, z"}
    ),
]


class StrutGroup(Section):
    """Struts with the same constants: solid cylinders with a sphere of the same density at each
    end."""

    pairs: Annotated[list[Pair], Field(min_length=1, max_length=MOST_PAIRS)]
    """The nodes that each strut joins."""
    diameter: Length = Field(gt=0)
    """Diameter of a strut."""
    density: Density = Field(ge=0)
    """Density of struts and their spheres; 0 only where other parts of the body have mass."""
    node_diameter: Length = Field(ge=0)
    """Diameter of the spheres; 0 for none. A node's first strut in the file counts."""
    contact_radius: Length | None = Field(default=None, ge=0)
    """Radius of the sphere about each end that touches the ground; 0 for points. By default the
    sphere's, else the strut's; 0 where an anchor holds along z."""
    axial_stiffness: Stiffness | None = Field(default=None, gt=0)
    """Axial force per shortening, E A / l; none for rigid struts. Without load a strut is as long
    as in the file. It counts at rest and in frequencies, without the inertia of elongation: the
    first two frequencies are at most 0.75 % too high if it is 17 times as stiff as its cable, 12 %
    if as stiff. In motion a strut is rigid."""


class SphereGroup(Section):
    """Equal solid spheres at nodes. They replace the spheres of struts at these nodes. A sphere at
    a node without struts is a body of its own."""

    nodes: list[str] = Field(min_length=1)
    """Nodes at the centres of the spheres."""
    diameter: Length = Field(gt=0)
    """Diameter of a sphere."""
    density: Density = Field(ge=0)
    """Density of a sphere; 0 only where other parts of the body have mass."""
    contact_radius: Length | None = Field(default=None, ge=0)
    """Radius that touches the ground; by default its own, or 0 where an anchor holds along z."""


class CurveTable(Section):
    """Measured elastic tension of a spring: straight between its points, from 0 N without stretch,
    and on with the last slope."""

    stretch: list[Annotated[Length, Field(gt=0)]] = Field(min_length=1, max_length=50)
    """Stretches of the points, ascending."""
    force: list[Annotated[ForceQuantity, Field(gt=0)]] = Field(min_length=1, max_length=50)
    """Tension at each stretch, without the initial tension; ascending."""

    @pydantic.model_validator(mode="after")
    def _check(self) -> CurveTable:
        if len(self.force) != len(self.stretch):
            refuse("force", f"found {len(self.force)} items, expected {len(self.stretch)}")
        for name in ("stretch", "force"):
            if any(after <= before for before, after in itertools.pairwise(getattr(self, name))):
                refuse(name, f"found {getattr(self, name)}, expected ascending numbers")
        return self


class CableGroup(Section):
    """Cables, springs or strings with the same constants. They never push."""

    damping: Damping | None = Field(default=None, ge=0)
    """Damping of a cable: tension per rate of its length. For a string the default is 1 ms times
    its stiffness."""
    pairs: Annotated[list[CablePath], Field(min_length=1, max_length=MOST_PAIRS)]
    """The nodes of each cable. [a, b, c] runs over a ring at b."""
    mu: float = Field(default=0.0, ge=0, le=2, exclude_if=operator.not_)
    """Coefficient of friction at rings: over an angle theta, tensions have the ratio exp(mu theta)
    in slip. The tension that is shown is the mean along the cable. What friction holds creeps, up
    to about 1 mm/s. A winch is at the path's last node."""
    stiffness: Annotated[Stiffness | None, Varied()] = Field(default=None, gt=0)
    """Tension per elongation. Only a string or a curve needs none."""
    string: bool = Field(default=False, exclude_if=operator.not_)
    """True for strings, which hardly stretch. Without a stiffness they get the default of
    `anchor_stiffness`."""
    initial_tension: ForceQuantity = Field(default=0.0, ge=0, exclude_if=operator.not_)
    """Tension F0 from which on the coils of a spring part: T = F0 + k x. Below, they are 1000 times
    as stiff."""
    quadratic: Annotated[float, *quantity("N/m^2")] = Field(
        default=0.0, ge=0, exclude_if=operator.not_
    )
    """Coefficient a of a spring that hardens, T = F0 + k x + a x² + b x³."""
    cubic: Annotated[float, *quantity("N/m^3")] = Field(default=0.0, ge=0, exclude_if=operator.not_)
    """Coefficient b; see `quadratic`."""
    curve: CurveTable | None = Field(default=None, exclude_if=operator.not_)
    """Table of stretch and tension, in place of a stiffness."""
    max_tension: ForceQuantity | None = Field(default=None, gt=0, exclude_if=operator.not_)
    """Greatest tension that a cable bears. A larger one is told."""
    max_stretch: Length | None = Field(default=None, gt=0, exclude_if=operator.not_)
    """Greatest stretch of a cable's spring. A tension above its tension there is told."""
    free_length: Length | None = Field(default=None, ge=0)
    """Length without tension. A group has this or a tension."""
    tension: ForceQuantity | None = Field(default=None, ge=0)
    """Tension at the given coordinates of the nodes."""
    factors: Keyed[
        Literal["stiffness", "damping", "free_length", "tension"],
        list[Annotated[float, Field(gt=0)]],
    ] = Field(default={}, exclude_if=operator.not_)
    """Factors of a number for each cable, in the order of `pairs`: `stiffness: [1, 0.98, 1.01]`."""

    @pydantic.model_validator(mode="after")
    def _check(self) -> CableGroup:
        if (self.free_length is None) == (self.tension is None):
            found = "neither" if self.tension is None else "both"
            refuse("free_length", f"found {found}, expected one of free_length and tension")
        if self.curve and (self.stiffness or self.quadratic or self.cubic or self.string):
            refuse("curve", "found another law beside it, expected the curve alone")
        if self.string and (self.initial_tension or self.quadratic or self.cubic):
            refuse("string", "found a law of a spring beside it, expected stiffness at most")
        if self.mu and all(len(path) == 2 for path in self.pairs):
            refuse("mu", "found no ring in pairs, expected a path such as [a, b, c]")
        needed = {"stiffness": not (self.curve or self.string), "damping": not self.string}
        needed |= {"free_length": self.string and self.stiffness is None}
        for key, is_needed in needed.items():
            if is_needed and getattr(self, key) is None:
                refuse(key, "is missing; give it")
        for name, factors in self.factors.items():
            if len(factors) != len(self.pairs) or getattr(self, name) is None:
                found = f"found {len(factors)} factors of {name}"
                refuse(f"factors.{name}", f"{found}, expected {len(self.pairs)} of a given number")
        return self

    def law(self, distance: float, place: int, *, firm: float) -> CableLaw:
        """Constants (SI) of a cable's force law. `distance` (m) is the distance of its nodes in the
        file; it gives the free length for a `tension`. `place` is the cable's index in `pairs`,
        `firm` (N/m) the stiffness of strings that give none."""
        own: dict[str, float] = {
            name: values[place] * getattr(self, name) for name, values in self.factors.items()
        }
        group = self.model_copy(update=own) if own else self
        stiffness = group.stiffness or firm
        table = [*zip(self.curve.stretch, self.curve.force, strict=True)] if self.curve else []
        if table:
            stiffness = table[-1][1] / table[-1][0]
        more = {name: getattr(self, name) for name in ("initial_tension", "quadratic", "cubic")}
        curve = Curve.of_spring(stiffness, table=table, **more)
        damping = STRING_TIME * stiffness if group.damping is None else group.damping
        law = CableLaw(stiffness, damping, group.free_length or 0.0, mu=self.mu, curve=curve)
        if group.tension is None:
            return law
        return law._replace(free_length=distance - elastic_stretch(group.tension, law))


class BallJoint(Section):
    """Ball joint: a spring and a damper hold nodes of two bodies together along all axes."""

    nodes: Pair
    """Nodes of two bodies at one place."""
    stiffness: Stiffness | None = Field(default=None, gt=0)
    """Force per distance of the two nodes; by default `joint_stiffness`."""
    time_constant: Time = Field(default=1e-3, ge=0)
    """Ratio of damping to stiffness. Below 1 ms stiff joints vibrate, and steps are short."""
    friction: Torque = Field(default=0.0, ge=0, exclude_if=operator.not_)
    """Torque limit of dry friction. What it holds creeps, with up to about 0.01 rad/s."""


class JoinedBody(Section):
    """Struts and nodes that are one rigid body, though they share no node. Its mass, centre and
    inertia may be given; what is not given follows from its parts."""

    struts: list[str] = Field(default=[])
    """Groups of struts, such as cage, or single struts, such as cage a b."""
    nodes: list[str] = Field(default=[])
    """Further nodes of the body, which need no strut."""
    mass: Mass | None = Field(default=None, gt=0)
    """Mass of the whole body, in place of its parts'."""
    centre: Coordinates | None = None
    """Centre of mass [x, y, z] where the nodes are as in the file."""
    inertia: Annotated[list[InertiaQuantity], Field(min_length=3, max_length=6)] | None = None
    """Moments of inertia [xx, yy, zz], or also the matrix's products xy, xz, yz (xy is the integral
    of -x y dm), about the centre of mass, along the file's axes. By default the parts' inertia in
    proportion to the mass."""

    @pydantic.model_validator(mode="after")
    def _check(self) -> JoinedBody:
        if not self.struts and not self.nodes:
            refuse("struts", "found neither struts nor nodes, expected some of them")
        if self.inertia is None:
            return self
        if len(self.inertia) not in (3, 6):
            refuse("inertia", f"found {len(self.inertia)} items, expected 3 or 6")
        xx, yy, zz, xy, xz, yz = (*self.inertia, 0.0, 0.0, 0.0)[:6]
        moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).tolist()
        least, middle, greatest = moments
        if least < LEAST_MOMENT * greatest or greatest > (1.0 + ROUNDED) * (least + middle):
            found = f"found the principal moments {', '.join(f'{m:.6g}' for m in moments)} kg*m^2"
            expected = "expected positive ones, each at most the sum of the other two"
            refuse("inertia", f"{found}, which no rigid body has; {expected}")
        return self

    @property
    def given(self) -> GivenInertia:
        """Mass, centre and inertia as the blueprint of a robot has them."""
        centre = None if self.centre is None else np.array(self.centre)
        inertia = None if self.inertia is None else np.array([*self.inertia, 0.0, 0.0, 0.0][:6])
        return GivenInertia(self.mass, centre, inertia)


class StructureFile(RobotSettings):
    """A tensegrity: nodes, struts, cables and the oscillators that actuate cables."""

    tag: ClassVar[str] = "Structure"
    keys_of_files: ClassVar = {"file": "Name or file of a structure; the other keys change it."}

    format: Literal[1] = Field(default=1, exclude=True)
    """Version of the format of the file."""
    nodes: Keyed[Name, Coordinates] = Field(max_length=MOST_NODES)
    """Coordinates [x, y, z], near an equilibrium. A node that nothing names is left out."""
    unit: str | None = None
    """Unit of coordinates that are bare numbers, such as cm. A robot in mm is shown in mm."""
    struts: Keyed[Name, StrutGroup] = Field(default={})
    cables: Keyed[Name, CableGroup] = Field(default={})
    spheres: Keyed[Name, SphereGroup] = Field(default={})
    joints: Keyed[Name, BallJoint] = Field(default={})
    pinned: list[str] = Field(default=[], exclude=True)
    """Nodes at which ball joints hold struts together; elsewhere struts that share a node are one
    body. Each body but the first gets a copy, n-2, and a joint of this name."""
    joint_stiffness: Stiffness | None = Field(default=None, gt=0, exclude_if=operator.not_)
    """Stiffness of pinned nodes and of joints without one; by default as for anchors."""
    bodies: Keyed[Name, JoinedBody] = Field(default={})
    actuated: Keyed[Name, Annotated[list[str], Field(min_length=1)]] = Field(default={})
    """Cables of each oscillator, such as side a b, nodes in either order."""
    masses: Keyed[str, Annotated[Mass, Field(gt=0)]] = Field(default={})
    """Point masses at nodes, such as motors. One at a node of no strut is a body of its own, such
    as a payload."""
    loads: Keyed[str, Annotated[list[ForceQuantity], THREE]] = Field(default={})
    """Constant forces [x, y, z] on nodes, in the world frame."""
    anchors: Keyed[str, AnchorAxes] = Field(default={})
    """Axes along which the world holds nodes, such as xyz; nodes of struts by a spring and a
    damper."""
    anchor_stiffness: Stiffness | None = Field(default=None, gt=0, exclude_if=operator.not_)
    """Stiffness of anchors along each axis; by default from cables and weight, see FORMAT.md."""
    anchor_time_constant: Time = Field(default=1e-3, ge=0)
    """Ratio of damping to stiffness of an anchor; as for joints."""
    contacts: Literal["all"] | list[str] = "all"
    """Nodes that the ground can touch."""
    ignored: list[str] | None = None
    """Settings of an imported file that have no effect, such as friction."""

    def blueprint(self) -> Blueprint:
        """The robot with its nodes at the positions of the file.

        Bodies and their nodes are in the order of the struts; then come entries of `bodies` without
        struts, and other nodes with a mass or a sphere. Cables are in the order of the pairs of
        bodies, those from fixed nodes first. Cables that run over rings come after all others.
        """
        blueprint = self._blueprint(firm=0.0)
        is_firm = any(group.string and not group.stiffness for group in self.cables.values())
        if not (self.joints or self.anchors or is_firm):
            return blueprint
        return self._blueprint(firm=min(blueprint.firm_stiffness(self.gravity)))

    def _blueprint(self, *, firm: float) -> Blueprint:
        """The blueprint, with the stiffness `firm` (N/m) of anchors, joints and strings that give
        none."""
        bodies, joined = self._nodes_of_bodies(), self._nodes_of_joined()
        first_node = np.append(0, np.cumsum([len(nodes) for nodes in bodies]))
        body_of = {node: body for body, nodes in enumerate(bodies) for node in nodes}
        fixed = [node for node in self.nodes if self.anchors.get(node) == "xyz"]
        body_of |= {node: WORLD for node in fixed if node not in body_of}
        nodes = tuple(body_of)
        number = {node: index for index, node in enumerate(nodes)}
        held = np.array([[axis in self.anchors.get(node, "") for axis in "xyz"] for node in nodes])
        held[first_node[-1] :] = False
        touching = nodes[: first_node[-1]] if self.contacts == "all" else self.contacts
        struts = sorted(members("struts", self.struts), key=lambda strut: body_of[strut.nodes[0]])
        makes = [self.struts[strut.group] for strut in struts]
        ends = [[number[node] for node in strut.nodes] for strut in struts]
        cables, anchors = self._cables_of(number, body_of, firm), self.anchor_stiffness or firm
        numbers = cable_numbers(cables["cable_names"])

        return Blueprint(
            bodies=self._names_of_bodies(bodies, nodes),
            node_names=nodes,
            first_node=first_node,
            p_WF=np.zeros((len(bodies), 3)),
            p_FN=np.array([self.nodes[node] for node in nodes]),
            struts=np.array(ends, dtype=int).reshape(-1, 2),
            strut_keys=tuple(strut.key for strut in struts),
            strut_radius=np.array([make.diameter / 2 for make in makes]),
            strut_density=np.array([make.density for make in makes]),
            strut_stiffness=np.array([make.axial_stiffness or math.inf for make in makes]),
            **self._spheres(number, held),
            node_mass=np.array([self.masses.get(node, 0.0) for node in nodes]),
            node_load=np.array([self.loads.get(node, [0.0, 0.0, 0.0]) for node in nodes]),
            anchor_stiffness=anchors * held,
            anchor_damping=anchors * (self.anchor_time_constant * held),
            payload=np.zeros(len(bodies)),
            offsets=np.array(self.offsets or np.zeros((len(bodies), 3))),
            start=self.start,
            **cables,
            **self._joints_of(number, body_of, firm),
            given_inertia={
                body_of[joined[key][0]]: body.given for key, body in self.bodies.items()
            },
            slack=True,
            contacts=np.array(sorted({number[node] for node in touching}), dtype=int),
            oscillators=tuple(self.actuated),
            groups=tuple(  # unknown cables are refused by _check_actuated()
                tuple(numbers[name] for name in names if name in numbers)
                for names in self.actuated.values()
            ),
        )

    def _cables_of(
        self, number: Mapping[str, int], body_of: Mapping[str, int], firm: float
    ) -> dict[str, Any]:
        """Fields of the blueprint for the cables, each from the body with the lower index. Cables
        within a body of `bodies` are left out. `number` and `body_of` have the index of each node
        and of its body. `firm` (N/m) is the stiffness of strings that give none."""
        rigid = [{body_of[nodes[0]]} for nodes in self._nodes_of_joined().values()]
        found: list[tuple[bool, list[int], Member]] = []
        for cable in members("cables", self.cables):
            bodies = [body_of[node] for node in cable.nodes]
            if {*bodies} not in rigid:
                found.append((len(bodies) > 2, sorted([bodies[0], bodies[-1]]), cable))
        cables = [cable for *_, cable in sorted(found, key=lambda one: one[:2])]
        laws, paths, limits = [], [], []
        for cable in cables:
            is_backward = body_of[cable.nodes[0]] > body_of[cable.nodes[-1]]
            is_backward &= not self.cables[cable.group].mu  # a winch is at the last node
            path = cable.nodes[::-1] if is_backward else cable.nodes
            places = [self.nodes[node] for node in path]
            length = sum(itertools.starmap(math.dist, itertools.pairwise(places)))
            group, place_in_group = self.cables[cable.group], parts_of(cable.key)[-1]
            laws.append(group.law(length, int(place_in_group), firm=firm))
            limits.append(group.max_tension or math.inf)
            if group.max_stretch:
                most = elastic_tension(group.max_stretch, laws[-1])
                limits[-1] = min(limits[-1], most)
            paths.append([number[node] for node in path])
        ends = [[path[0], path[-1]] for path in paths]
        return {
            "cable_names": tuple(cable.names[0] for cable in cables),
            "cable_groups": tuple(cable.group for cable in cables),
            "cable_keys": tuple(cable.key for cable in cables),
            "cable_ends": np.array(ends, dtype=int).reshape(-1, 2),
            "cable_laws": tuple(laws),
            "cable_limits": np.array(limits),
            "cable_rings": {i: tuple(path[1:-1]) for i, path in enumerate(paths) if len(path) > 2},
        }

    def _joints_of(
        self, number: Mapping[str, int], body_of: Mapping[str, int], firm: float
    ) -> dict[str, Any]:
        """Fields of the blueprint for the joints, each from the body with the lower index. `number`
        and `body_of` have the index of each node and of its body. `firm` (N/m) is the stiffness of
        joints that give none."""
        joints, usual = self.joints.values(), self.joint_stiffness or firm
        stiffness = np.array([joint.stiffness or usual for joint in joints])
        ends = [sorted(joint.nodes, key=body_of.__getitem__) for joint in joints]
        pairs = [[number[first], number[second]] for first, second in ends]
        return {
            "joints": np.array(pairs, dtype=int).reshape(-1, 2),
            "joint_keys": tuple(f"joints.{name}" for name in self.joints),
            "joint_stiffness": stiffness,
            "joint_damping": stiffness * [joint.time_constant for joint in joints],
            "joint_friction": np.array([joint.friction for joint in joints]),
        }

    def _spheres(self, number: Mapping[str, int], held: np.ndarray) -> dict[str, Any]:
        """Fields of the blueprint for the spheres at the nodes. A node has the sphere of its first
        strut in the file, unless it has one of its own. `number` has the index of each node by
        name; `held` (nodes, 3) is True along the axes of its anchor. Nodes that joints hold
        together are held together."""
        spheres: list[tuple[list[str], StrutGroup | SphereGroup, float, float]] = []
        for bar in reversed(self.struts.values()):
            ends = [node for pair in bar.pairs for node in pair]
            spheres.append((ends, bar, bar.node_diameter, bar.node_diameter or bar.diameter))
        for own in self.spheres.values():
            spheres.append((own.nodes, own, own.diameter, own.diameter))

        is_held = {name: bool(held[node, 2]) for name, node in number.items()}
        for group in components(joint.nodes for joint in self.joints.values()):
            is_held |= dict.fromkeys(group, any(is_held[node] for node in group))
        made = np.zeros((3, len(number)))
        for names, make, diameter, foot in spheres:
            for name in names:
                radius = make.contact_radius
                if radius is None:
                    radius = 0.0 if is_held[name] else foot / 2
                made[:, number[name]] = diameter / 2, make.density, radius
        return dict(zip(["node_radius", "node_density", "contact_radius"], made, strict=True))

    def _nodes_of_bodies(self) -> list[list[str]]:
        """Names of the nodes of each rigid body. Struts that share a node are one body, and so are
        the parts of an entry of `bodies`. A node with a mass or sphere and without struts is a body
        of its own, unless it is fixed."""
        ends = (strut.nodes for strut in members("struts", self.struts))
        bodies = components([*ends, *self._nodes_of_joined().values()])
        of_struts = {node for nodes in bodies for node in nodes}
        with_sphere = [node for group in self.spheres.values() for node in group.nodes]
        for node in dict.fromkeys([*self.masses, *with_sphere]):
            if node not in of_struts and self.anchors.get(node) != "xyz":
                bodies.append([node])
        return bodies

    def _nodes_of_joined(self) -> dict[str, list[str]]:
        """Names of the nodes that each entry of `bodies` joins."""
        named = struts_by_name(members("struts", self.struts))
        return {
            name: [node for strut in body.struts for part in named[strut] for node in part.nodes]
            + body.nodes
            for name, body in self.bodies.items()
        }

    def _names_of_bodies(self, bodies: list[list[str]], nodes: Sequence[str]) -> tuple[str, ...]:
        """Name of each body: its key in `bodies`; the group of struts that has exactly its nodes;
        the part of a structure of NTRT that has them, such as "vertebra1"; or else the names of its
        nodes."""
        names: dict[frozenset[str], str] = {}
        for part in {node.rpartition("/")[0] for node in nodes} - {""}:
            names[frozenset(node for node in nodes if node.startswith(f"{part}/"))] = part
        for name, group in self.struts.items():
            names[frozenset(node for pair in group.pairs for node in pair)] = name
        for name, (node, *_) in self._nodes_of_joined().items():
            names |= {frozenset(body): name for body in bodies if node in body}
        return tuple(names.get(frozenset(body), " ".join(body)) for body in bodies)

    @pydantic.model_validator(mode="before")
    @classmethod
    def _prepare(cls, tree: Any) -> Any:
        """Checks the unit of a structure file before its fields are read, and completes them.

        Nodes get the unit of the key `unit` where their coordinates are bare numbers. Afterwards
        `unit` is "mm" or None: a robot in mm is shown in mm, for others Scenario.units chooses the
        unit by size.
        """
        unit = tree.get("unit") if isinstance(tree, dict) else None
        if unit is None:
            return tree
        try:
            quantity_to_si(f"1 {unit}", "m")
        except ValueError:
            refuse("unit", f"found {described(unit)}, expected a unit of length, such as mm")

        def with_unit(x: Any) -> Any:
            return f"{x!r} {unit}" if type(x) in (int, float) else x

        tree = tree_value(tree) | {"unit": "mm" if unit == "mm" else None}
        bodies = tree.get("bodies")
        placed = [(tree, "nodes")]
        placed += [(body, "centre") for body in bodies.values()] if isinstance(bodies, dict) else []
        for section, key in placed:
            if isinstance(section, dict) and key in section:
                section[key] = mapped(section[key], with_unit)
        return tree

    def _replace_pinned(self) -> None:
        """Puts joints in place of the pinned nodes, in this structure itself.

        Struts that share a pinned node are one body there only if they also share another node, or
        if `bodies` joins them. The body of the first strut at the node keeps it. Each other one
        gets a copy of it, named "l-2", "l-3" and so on for the node l, and a joint with the name of
        the copy. Refuses a pinned node that no two bodies share.
        """
        struts = [*members("struts", self.struts)]
        named, index = struts_by_name(struts), {strut.key: i for i, strut in enumerate(struts)}
        parts = [pair for group in self.struts.values() for pair in group.pairs]
        parts += [body.nodes for body in self.bodies.values()]
        welded: list[list[str | int]] = [
            [part, *(node for node in nodes if node not in self.pinned)]
            for part, nodes in enumerate(parts)
        ]
        for own, body in zip(welded[len(struts) :], self.bodies.values(), strict=True):
            own += [index[strut.key] for name in body.struts for strut in named.get(name, ())]
        body_of = {part: i for i, body in enumerate(components(welded)) for part in body}

        for place, node in enumerate(self.pinned):
            check_known(f"pinned[{place}]", "node", node, self.nodes)
            here: dict[int, list[list[str]]] = {}
            for part, nodes in enumerate(parts):
                if node in nodes:
                    here.setdefault(body_of[part], []).append(nodes)
            if len(here) < 2:
                expected = "expected a node that struts of two bodies share"
                refuse(f"pinned[{place}]", f"found '{node}', {expected}")
            for of_body in [*here.values()][1:]:
                copy = unused_name(node, self.nodes | self.joints)
                self.nodes[copy] = self.nodes[node]
                self.joints[copy] = BallJoint(nodes=[node, copy])
                for nodes in of_body:
                    nodes[:] = [copy if one == node else one for one in nodes]

        renamed = dict[str, str]()
        for old, new in zip(struts, members("struts", self.struts), strict=True):
            renamed |= dict.fromkeys(old.names, new.names[0])
        for body in self.bodies.values():
            body.struts[:] = [renamed.get(name, name) for name in body.struts]
        self.pinned.clear()

    @pydantic.model_validator(mode="after")
    def _check(self) -> Self:
        """Replaces `pinned` by joints. Refuses unknown names, members that are there twice, nodes
        that hang on nothing, and two entries for one body. Then checks what holds for any robot,
        see Blueprint.check()."""
        if self.pinned:
            self._replace_pinned()
        self._check_names()
        self._check_members()
        self._check_nodes()
        for node, place in self.nodes.items():
            if max(map(abs, place)) > LONGEST:
                expected = f"expected coordinates of at most {LONGEST:g} m"
                refuse(f"nodes.{node}", f"found {place}, {expected}")
        blueprint = self.blueprint()
        self._check_joined(blueprint)
        blueprint.check()
        self._check_actuated(blueprint.cable_names)
        return check_tolerances(self)

    def _check_names(self) -> None:
        """Refuses nodes and struts that do not exist."""
        named = [(member.key, node) for member in self._members for node in member.nodes]
        named += [(f"anchors.{node}", node) for node in self.anchors]
        named += [*nodes_of("joints", self.joints), *nodes_of("bodies", self.bodies)]
        for key, node in (*named, *self._named_as_moving):
            check_known(key, "node", node, self.nodes)
        struts = struts_by_name(members("struts", self.struts))
        for name, body in self.bodies.items():
            for i, strut in enumerate(body.struts):
                check_known(f"bodies.{name}.struts[{i}]", "strut", strut, struts)

    @property
    def _members(self) -> list[Member]:
        return [*members("struts", self.struts), *members("cables", self.cables)]

    @property
    def _named_as_moving(self) -> list[tuple[str, str]]:
        """Keys and names of the nodes that only a body can have."""
        moving = [(f"masses.{node}", node) for node in self.masses]
        moving += nodes_of("spheres", self.spheres)
        moving += [(f"loads.{node}", node) for node in self.loads]
        if self.contacts != "all":
            moving += [(f"contacts[{i}]", node) for i, node in enumerate(self.contacts)]
        return moving

    def _check_members(self) -> None:
        """Refuses struts and cables of length 0, and those that are there twice."""
        keys: dict[object, str] = {}
        for key, group_name, nodes in self._members:
            if any(self.nodes[a] == self.nodes[b] for a, b in itertools.pairwise(nodes)):
                refuse(key, "has length 0, expected nodes at two places")
            node, count = Counter(nodes).most_common(1)[0]
            if count > 1:
                refuse(key, f"found '{node}' {count} times, expected each node once")
            is_cable, path = key.startswith("cables."), min(nodes, nodes[::-1])
            earlier = keys.setdefault((group_name, path) if is_cable else path, key)
            if earlier != key:
                where = " in a group of cables" if is_cable else ""
                refuse(key, f"found the nodes of {earlier}, expected each pair once{where}")

    def _check_nodes(self) -> None:
        """Refuses nodes that hang on nothing, and fixed nodes with a mass, sphere, load or
        contact."""
        joined = {node: None for member in self._members for node in member.nodes}
        joined |= {node: None for joint in self.joints.values() for node in joint.nodes}
        bodies = self._nodes_of_bodies()
        of_bodies = {node for nodes in bodies for node in nodes}
        for node in joined | self.anchors:
            if node not in of_bodies and self.anchors.get(node) != "xyz":
                expected = "a node of a strut, an anchor along xyz, a mass or a sphere"
                refuse(f"nodes.{node}", f"is on no strut, expected {expected}")
        for key, node in self._named_as_moving:
            if node not in of_bodies:
                what = "fixed" if node in self.anchors else "unused"
                refuse(key, f"found the {what} node '{node}', expected one that can move")
        if not bodies:
            refuse("nodes", "none can move, expected struts, masses or spheres")
        for node, *others in bodies:
            if not others and node not in joined:
                refuse(f"nodes.{node}", "is on no strut and no cable, expected a cable to it")

    def _check_joined(self, blueprint: Blueprint) -> None:
        """Refuses two entries of `bodies` for one body, and two bodies of one name."""
        body_of = dict(zip(blueprint.node_names, blueprint.body_of_node, strict=True))
        for name, (node, *_) in self._nodes_of_joined().items():
            if body_of[node] != name:
                problem = f"shares a node with bodies.{name}, so that they are one body"
                refuse(f"bodies.{body_of[node]}", f"{problem}, expected one entry for it")
        (name, count), *_ = Counter(blueprint.bodies).most_common(1)
        if count > 1:
            key = f"bodies.{name}" if name in self.bodies else f"nodes.{name}"
            refuse(key, f"found {count} bodies of this name, expected another name for one of them")

    def _check_actuated(self, cable_names: Sequence[str]) -> None:
        """Raises InputError if `actuated` names a cable that is not among `cable_names`, the names
        of all cables, or gives a cable to a second oscillator."""
        numbers, drivers = cable_numbers(cable_names), dict[int, str]()
        for oscillator, names in self.actuated.items():
            for i, name in enumerate(names):
                key = f"actuated.{oscillator}[{i}]"
                check_known(key, "cable", name, numbers)
                cable = numbers[name]
                if cable in drivers:
                    found = f"found '{cable_names[cable]}', which '{drivers[cable]}' drives"
                    refuse(key, f"{found}, expected it once")
                drivers[cable] = oscillator


class ParametricRobot(RobotSettings):
    """Base class for the settings of a robot of a plug-in: numbers from which a structure is
    made."""

    unit: ClassVar[None] = None

    def structure(self) -> StructureFile:
        """The structure for these settings. Its gravity and tolerances are not used."""
        raise NotImplementedError

    def blueprint(self) -> Blueprint:
        """The robot with its nodes at the positions of the structure."""
        structure = self.structure()
        if not isinstance(structure, StructureFile):
            refuse("", f"{origin(self)}: structure() gave {structure!r:.40}, expected a Structure")
        made = structure.blueprint()
        moved = np.array(self.offsets or made.offsets)
        return dataclasses.replace(made, offsets=moved, start=self.start or made.start)
