"""Base class for the settings of a robot, of any kind."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import pydantic

from tetra_drake.scenario.blueprint import Blueprint
from tetra_drake.scenario.tolerances import split_tolerances
from tetra_drake.settings.section import Kinds, Section, Tree

ROW = "row of tetrahedra"
"""Property that metrics of the thesis's robot need."""


class RobotSettings(Section):
    """Base class for the settings of a robot.

    All kinds have the settings `gravity`, `offsets` (one for each body), `start` and `tolerances`,
    and `unit`, which is the unit of bare coordinates in a file, or None.
    """

    lacking: ClassVar[tuple[str, ...]] = (ROW,)
    """Properties that some metrics need and this robot does not have; see scenario.metrics."""
    if TYPE_CHECKING:  # fields of the kinds, each at its place in a file
        gravity: Any
        offsets: Any
        start: Any
        tolerances: Any

        @property
        def unit(self) -> str | None: ...

    _split = pydantic.model_validator(mode="before")(split_tolerances)

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
