"""Row of nested tetrahedra of the thesis (section 2.1): settings, nodes and cables."""

from __future__ import annotations

import itertools
import math
from typing import Annotated, ClassVar, Literal, get_args

import numpy as np
from pydantic import Field, ValidationInfo, field_validator, model_validator

from tetra_drake.laws.cable import CableLaw, elastic_tension
from tetra_drake.scenario.blueprint import Blueprint
from tetra_drake.scenario.robot_settings import RobotSettings
from tetra_drake.settings.quantities import (
    Damping,
    Density,
    Length,
    Mass,
    Stiffness,
    quantity,
)
from tetra_drake.settings.refusals import refuse
from tetra_drake.settings.section import Section, Tree, Varied

NODES = ("bottom_left", "bottom_right", "top", "tip")
"""Names of the nodes of a tetrahedron. The first three form the base triangle."""

BOTTOM_LEFT, BOTTOM_RIGHT, TOP, TIP = range(4)

STRUTS = tuple((i, j) for i in range(4) for j in range(i + 1, 4))
"""Indices of the two nodes of each strut of a tetrahedron."""

CableName = Literal[
    "outer bottom_left",
    "outer bottom_right",
    "outer top",
    "inner bottom_left",
    "inner bottom_right",
    "inner top",
]
"""Names of the cables of a junction, from one tetrahedron to the next. Outer cables join base nodes
with the same name. Inner cables join the tip to base nodes."""

CABLES: tuple[str, ...] = get_args(CableName)


def tetrahedron_nodes(strut_length: float) -> np.ndarray:
    """Positions p_BN (4, 3) of a tetrahedron's nodes, in m. The base triangle is vertical, the tip
    points forward, and the origin is the centre of mass."""
    circumradius = strut_length / math.sqrt(3.0)
    height = strut_length * math.sqrt(2.0 / 3.0)
    x, z = -height / 4, -circumradius / 2
    base = [[x, strut_length / 2, z], [x, -strut_length / 2, z], [x, 0.0, circumradius]]
    return np.array([*base, [3 * height / 4, 0.0, 0.0]])


class RowCables(Section):
    """The cables of a row of tetrahedra (Table 3 of the thesis)."""

    damping: Damping = Field(ge=0)
    """Damping of a cable: tension per rate of its length."""

    outer_stiffness: Annotated[Stiffness, Varied()] = Field(gt=0)
    """Stiffness of outer cables, which join base nodes of one name."""
    inner_stiffness: Annotated[Stiffness, Varied()] = Field(gt=0)
    """Stiffness of inner cables, from a tip to base nodes."""
    free_length: Length = Field(ge=0)
    """Length without tension."""
    slack: bool
    """True if cables go slack; otherwise they also push (Eq. 6)."""

    def law(self, cable: str) -> CableLaw:
        """Constants (SI) of the force law of one cable of a junction, such as "outer top"."""
        stiffness = self.outer_stiffness if cable.startswith("outer") else self.inner_stiffness
        return CableLaw(stiffness, self.damping, self.free_length)


Spacing = Annotated[float, *quantity("m", balanced=0.0)]


class Tetrahedra(RobotSettings):
    """Row of nested tetrahedra with its initial positions (thesis section 2.1, appendix C.1)."""

    unit: ClassVar[None] = None
    """Unit of bare coordinates in a file; this robot has no coordinates."""
    lacking = ()

    tetrahedra: int = Field(ge=2, le=200)
    """Number of tetrahedra; T1 is the rearmost."""
    strut_length: Length = Field(gt=0)
    """Length of a strut from node to node."""
    strut_diameter: Length = Field(gt=0)
    """Diameter of a strut."""
    node_diameter: Length = Field(gt=0)
    """Diameter of the sphere at a node."""
    density: Density = Field(gt=0)
    """Density of struts and spheres."""
    cables: RowCables
    spacing: Annotated[Spacing, Varied()] = Field(ge=0)
    """Distance between base triangles at t = 0. `balanced` (or 0): where the cables balance; also
    where a file changes its base's strut length, or cables' stiffness or free length."""
    payload: list[Annotated[Mass, Field(ge=0)]] = Field(default=[])
    """Point mass at the centre of each tetrahedron, such as its motors."""
    contacts: Literal["thesis", "all"] = "thesis"
    """Nodes that the ground can touch: `thesis`, the bottom nodes and the foremost tip, or
    `all`."""
    actuation: list[Annotated[list[CableName], Field(min_length=1)]] = Field(
        default=[["outer bottom_left", "outer bottom_right"]], min_length=1
    )
    """Groups of a junction's cables that share an oscillator."""

    @property
    def size(self) -> float:
        """Spacing of the tetrahedra (m); the unit of `disturbances.start`."""
        return self.spacing

    def blueprint(self) -> Blueprint:
        """The robot on flat ground.

        Base triangles are vertical, with two nodes at height 0. The base of T1 is at x = 0. Tips
        point forward (+x) into the next tetrahedron.
        """
        n, junctions = self.tetrahedra, self.tetrahedra - 1
        bodies = tuple(f"T{i + 1}" for i in range(n))
        p_FN = tetrahedron_nodes(self.strut_length)
        x, _, z = p_FN[BOTTOM_LEFT]
        bottom = [4 * i + node for i in range(n) for node in (BOTTOM_LEFT, BOTTOM_RIGHT)]
        thesis = [*bottom, 4 * (n - 1) + TIP]
        struts = [(4 * i + a, 4 * i + b) for i in range(n) for a, b in STRUTS]
        names = [f"{rear}-{front}" for rear, front in itertools.pairwise(bodies)]
        ends = []
        for cable in CABLES:
            role, name = cable.split()
            front = NODES.index(name)
            ends.append([front if role == "outer" else TIP, 4 + front])
        several = len(self.actuation) > 1
        labels = [f" {' + '.join(group)}" if several else "" for group in self.actuation]
        driven = [[CABLES.index(cable) for cable in group] for group in self.actuation]
        first_cables = range(0, len(CABLES) * junctions, len(CABLES))
        return Blueprint(
            bodies=bodies,
            node_names=tuple(f"{body} {node}" for body in bodies for node in NODES),
            first_node=4 * np.arange(n + 1),
            p_WF=np.array([[i * self.spacing - x, 0.0, -z] for i in range(n)]),
            p_FN=np.tile(p_FN, (n, 1)),
            struts=np.array(struts),
            strut_keys=("strut_length",) * len(struts),
            strut_radius=np.full(len(struts), self.strut_diameter / 2),
            strut_stiffness=np.full(len(struts), math.inf),
            strut_density=np.full(len(struts), self.density),
            node_radius=np.full(4 * n, self.node_diameter / 2),
            contact_radius=np.zeros(4 * n),  # the thesis's ground acts on the centres of nodes
            node_density=np.full(4 * n, self.density),
            node_mass=np.zeros(4 * n),
            node_load=np.zeros((4 * n, 3)),
            anchor_stiffness=np.zeros((4 * n, 3)),
            anchor_damping=np.zeros((4 * n, 3)),
            payload=np.array(self.payload or [0.0] * n),
            offsets=np.array(self.offsets or np.zeros((n, 3))),
            start=self.start,
            cable_names=tuple(f"{name} {cable}" for name in names for cable in CABLES),
            cable_groups=tuple(cable.split()[0] for cable in CABLES) * junctions,
            cable_keys=("cables",) * (len(CABLES) * junctions),
            cable_ends=np.vstack([np.add(ends, 4 * junction) for junction in range(junctions)]),
            cable_laws=tuple(self.cables.law(cable) for cable in CABLES) * junctions,
            slack=self.cables.slack,
            oscillators=tuple(name + label for name in names for label in labels),
            groups=tuple(tuple(i + k for k in group) for i in first_cables for group in driven),
            contacts=np.array(thesis if self.contacts == "thesis" else range(4 * n)),
            markers=np.array(bottom),
            followed="bottom nodes",
            points_ahead=True,
            feet=len(thesis),
            settles=False,
        )

    def implied_changes(self, base: Section, changes: Tree) -> Tree:
        """Further changes that follow from `changes`, which made this robot from the robot `base`:
        {"spacing": "balanced"} if strut length or cables differ and `changes` has no spacing;
        otherwise none."""
        if not isinstance(base, Tetrahedra) or "spacing" in changes:
            return {}
        deciding = []  # strut length, and all constants of cables at rest
        for robot in (self, base):
            laws = [robot.cables.law(cable) for cable in ("outer top", "inner top")]
            deciding.append([robot.strut_length, *(law._replace(damping=0.0) for law in laws)])
        return {"spacing": "balanced"} if deciding[0] != deciding[1] else {}

    @field_validator("spacing")
    @classmethod
    def _balance(cls, spacing: float, info: ValidationInfo) -> float:
        """The given spacing (m) or, if it is 0, the spacing s at which the cables of a junction
        balance along x.

        Three outer cables of length s pull two tetrahedra together. Three inner cables, from a tip
        at distance h to base nodes at distance s and radius R, push them apart if s < h. The weight
        is neglected: twice the density moves T1 by less than 0.003 in. Refuses cables that balance
        at no spacing.
        """
        if spacing > 0.0 or not {"strut_length", "cables"} <= info.data.keys():
            return spacing
        strut_length, cables = info.data["strut_length"], info.data["cables"]
        height, radius = strut_length * math.sqrt(2.0 / 3.0), strut_length / math.sqrt(3.0)
        outer, inner = cables.law("outer top"), cables.law("inner top")

        def pull(s: float) -> float:
            length = math.hypot(radius, height - s)
            apart = elastic_tension(length - inner.free_length, inner) * (height - s) / length
            return elastic_tension(s - outer.free_length, outer) - apart

        near, far = 0.0, height + cables.free_length
        if pull(near) >= 0.0:
            refuse("", "the cables balance at no spacing; give one")
        for _ in range(100):  # enough halvings for double precision
            middle = 0.5 * (near + far)
            if pull(middle) > 0.0:
                far = middle
            else:
                near = middle
        return far

    @model_validator(mode="after")
    def _check_actuation(self) -> Tetrahedra:
        cables = [cable for group in self.actuation for cable in group]
        for cable in cables:
            if cables.count(cable) > 1:
                refuse("actuation", f"found '{cable}' twice, expected each cable once at most")
        return self
