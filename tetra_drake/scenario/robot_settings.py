"""Base class for the settings of a robot, of any kind."""

from __future__ import annotations

from typing import ClassVar

import pydantic

from tetra_drake.scenario.blueprint import Blueprint
from tetra_drake.scenario.tolerances import split_tolerances
from tetra_drake.settings.section import Section, Tree

ROW = "row of tetrahedra"
"""Property that metrics of the thesis's robot need."""


class RobotSettings(Section):
    """Base class for the settings of a robot.

    All kinds have the settings `gravity`, `offsets` (one for each body) and `tolerances`, and
    `unit`, which is the unit of bare coordinates in a file, or None.
    """

    lacking: ClassVar[tuple[str, ...]] = (ROW,)
    """Properties that some metrics need and this robot does not have; see scenario.metrics."""

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
