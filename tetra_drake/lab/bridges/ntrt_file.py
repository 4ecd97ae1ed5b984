"""Sections of the YAML files of NTRT, the NASA Tensegrity Robotics Toolkit."""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar

import pydantic
from pydantic import Field

from tetra_drake.scenario.robot_structure import Pair
from tetra_drake.settings.quantities import Keyed
from tetra_drake.settings.refusals import hint, refuse
from tetra_drake.settings.section import Section
from tetra_drake.settings.units import LARGEST

Number = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Point = Annotated[list[Number], Field(min_length=3, max_length=3)]
Positive = Annotated[float, Field(gt=0, le=LARGEST)]
NotNegative = Annotated[float, Field(ge=0, le=LARGEST)]


class Rotation(Section):
    """A rotation of a substructure about a point, the centre of its nodes if not given."""

    axis: Point
    """A vector of any length but 0."""
    angle: Number
    """Angle in degrees."""
    reference: Point | None = None


class Substructure(Section):
    """Part of a structure that another file describes, or several equal parts: the key a/b/c makes
    three of them.

    An entry without a path rotates, scales and moves a part that another entry has added. That part
    may be nested.
    """

    path: str | None = None
    rotation: Rotation | None = None
    scale: Positive = 1.0
    offset: Point = Field(default=[0.0, 0.0, 0.0])
    """Displacement from each of several equal parts to the next."""
    translation: Point = Field(default=[0.0, 0.0, 0.0])


class RigidParameters(Section):
    """Parameters of a rod, box or sphere, with NTRT's defaults."""

    density: NotNegative = 1.0


class RoundParameters(RigidParameters):
    """Parameters of a rod or a sphere."""

    radius: Positive = 0.5


class BoxParameters(RigidParameters):
    """Parameters of a box along the line between two nodes."""

    width: Positive = 1.0
    """Half of the width, as NTRT takes it."""
    height: Positive = 1.0
    """Half of the height."""

    @property
    def radius(self) -> float:
        """Radius of the round rod that replaces the box, in the file's unit of length. Its
        cross-section has the box's area, 4 width height, as both are halves in NTRT."""
        return math.sqrt(4.0 * self.width * self.height / math.pi)


class CableParameters(Section):
    """Parameters of a cable, with NTRT's defaults."""

    density: ClassVar[float] = 0.0
    stiffness: Positive = 1000.0
    damping: NotNegative = 10.0
    pretension: NotNegative = 0.0


class KinematicCableParameters(CableParameters):
    """Parameters of a cable with a motor."""

    radius: Positive = 1.0
    """Radius of the spool, which is not used."""


def _with(parameters: type[Section], *without_effect: str) -> type[Section]:
    """Parameters that a file may also give, but without effect: a scenario has its own friction,
    ground and actuators. Their type is Any."""
    fields: Any = {name: (Any, None) for names in without_effect for name in names.split()}
    return pydantic.create_model(parameters.__name__, __base__=parameters, **fields)


_OF_CONTACT = "friction roll_friction restitution"
_OF_CABLE = "rotation history max_tension target_velocity min_actual_length min_rest_length"
_ROUND, _BOX = _with(RoundParameters, _OF_CONTACT), _with(BoxParameters, _OF_CONTACT)
_DIRECT = _with(CableParameters, _OF_CABLE, "moveCablePointAToEdge moveCablePointBToEdge")
_MOTOR = _with(KinematicCableParameters, _OF_CABLE, "motor_friction motor_inertia back_drivable")

CLASSES: dict[str, tuple[str, type[Section], str]] = {
    "tgRodInfo": ("struts", _ROUND, "rod"),
    "tgBoxInfo": ("struts", _BOX, "box"),
    "tgSphereInfo": ("spheres", _ROUND, "sphere"),
    "tgBasicActuatorInfo": ("cables", _DIRECT, "string"),
    "tgBasicContactCableInfo": ("cables", _DIRECT, ""),
    "tgKinematicActuatorInfo": ("cables", _MOTOR, ""),
    "tgKinematicContactCableInfo": ("cables", _MOTOR, ""),
}
"""NTRT's builders by class: group in a structure file, parameters, and tag for which the builder is
the default ("" for none)."""


class Builder(Section):
    """NTRT's rule that makes rods, boxes, cables or spheres: their class and parameters. It applies
    to pairs or nodes with certain tags."""

    made_as: str = Field(alias="class")
    parameters: Any = Field(default=None, validate_default=True)

    @pydantic.field_validator("made_as")
    @classmethod
    def _check_class(cls, name: str) -> str:
        if name not in CLASSES:
            refuse("", f"found '{name}'; {hint(name, CLASSES)}")
        return name

    @pydantic.field_validator("parameters")
    @classmethod
    def _read_parameters(cls, given: Any, info: pydantic.ValidationInfo) -> Any:
        if "made_as" not in info.data:
            return given
        return CLASSES[info.data["made_as"]][1].from_tree(given, "")

    @property
    def kind(self) -> str:
        """What it makes, by the key in a structure file: "struts", "spheres" or "cables"."""
        return CLASSES[self.made_as][0]

    @property
    def ignored(self) -> list[str]:
        """Names of the given parameters that have no effect."""
        fields, given = type(self.parameters).model_fields, self.parameters.model_fields_set
        return [name for name, one in fields.items() if one.annotation is Any and name in given]


class NtrtFile(Section):
    """Content of a YAML structure file of NTRT, in NTRT's axes and unit of length."""

    nodes: Keyed[str, Point] = Field(default={})
    """Nodes. A key is the tags of its node, separated by blanks."""
    pair_groups: Keyed[str, list[Pair]] = Field(default={})
    """Lists of pairs of nodes. A key is the tags of its pairs, separated by blanks."""
    builders: Keyed[str, Builder] = Field(default={})
    """Builders. A key is the tags that a pair or a node must have, separated by blanks."""
    substructures: Keyed[str, Substructure] = Field(default={})
    bond_groups: Keyed[str, Keyed[str, list[Pair]]] = Field(default={})
    """Lists of pairs of nodes, by their tags and the bond of two parts (outer key and inner key, in
    either order)."""
