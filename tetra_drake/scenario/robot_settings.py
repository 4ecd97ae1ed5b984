"""Base class for the settings of a robot, of any kind."""

from __future__ import annotations

import operator
from typing import TYPE_CHECKING, Annotated, ClassVar, Self

import pydantic
from pydantic import Field

from tetra_drake.scenario.blueprint import Blueprint
from tetra_drake.scenario.start import Start
from tetra_drake.scenario.tolerances import Tolerances, check_tolerances, split_tolerances
from tetra_drake.settings.quantities import Acceleration, Position
from tetra_drake.settings.section import Kinds, Section, Tree

ROW = "row of tetrahedra"
"""Property that metrics of the thesis's robot need."""


class RobotSettings(Section):
    """Base class for the settings of a robot. All kinds also have `unit`, which is the unit of bare
    coordinates in a file, or None."""

    lacking: ClassVar[tuple[str, ...]] = (ROW,)
    """Properties that some metrics need and this robot does not have; see scenario.metrics."""
    if TYPE_CHECKING:

        @property
        def unit(self) -> str | None: ...

    gravity: Acceleration = Field(default=9.80665, ge=0)
    """Acceleration of gravity."""
    offsets: list[Position] = Field(default=[])
    """Displacement [x, y, z] of each body at t = 0, but for the axes of its anchors."""
    start: Start | None = Field(default=None, exclude_if=operator.not_)
    """How the robot is turned and moves at t = 0; at rest if there is none."""
    tolerances: Tolerances = Field(default={}, exclude_if=operator.not_)
    """Tolerances of numbers of the robot by key: `cables.side.stiffness: 2 %`, `nodes: 1 mm`; also
    in the text of a number: `200 N/m ± 2 %`. td.predict and td.fit use them."""

    _split = pydantic.model_validator(mode="before")(split_tolerances)

    @pydantic.model_validator(mode="after")
    def _check(self) -> Self:
        self.blueprint().check_sizes()
        return check_tolerances(self)

    def blueprint(self) -> Blueprint:
        """The robot as plain data."""
        raise NotImplementedError

    @property
    def body_count(self) -> int:
        """Number of rigid bodies."""
        return len(self.blueprint().bodies)

    @property
    def size(self) -> float:
        """Length (m) of the shortest strut, or of the shortest cable if there are no struts; the
        unit of `disturbances.start`."""
        return self.blueprint().shortest

    def implied_changes(self, base: Section, changes: Tree) -> Tree:
        """Further changes that follow from `changes` to the robot `base`: none, so the mapping is
        empty. Rows of tetrahedra adapt their spacing."""
        return {}


RobotKind = Annotated[
    RobotSettings,
    Kinds(
        RobotSettings,
        more=[
            "tetra_drake.scenario.robot_tetrahedra:Tetrahedra",
            "tetra_drake.scenario.robot_structure:StructureFile",
        ],
    ),
]
"""Robot of a scenario: a row of tetrahedra or a structure. A mapping without a tag is a
Tetrahedra."""
