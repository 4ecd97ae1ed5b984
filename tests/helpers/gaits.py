"""Gaits with other numbers."""

import dataclasses
from typing import Any

from tetra_drake.robot.gait import Gait


def with_values(gait: Gait, *, turn: float | None = None, **values: Any) -> Gait:
    """A copy of a gait with other parameters, and another turn if one is given."""
    turn = gait.turn if turn is None else turn
    return dataclasses.replace(gait, parameters={**gait.parameters, **values}, turn=turn)
