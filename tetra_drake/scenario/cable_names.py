"""The names of a junction's cables, and their sides."""

from collections.abc import Sequence
from typing import Literal, get_args

Cable = Literal[
    "outer bottom_left",
    "outer bottom_right",
    "outer top",
    "inner bottom_left",
    "inner bottom_right",
    "inner top",
]
"""A cable of a junction, from one tetrahedron to the next: outer ones join base nodes of the same
name, inner ones join the tip to base nodes."""

CABLES: tuple[str, ...] = get_args(Cable)

SIDES = ("left", "right")
"""Endings of the names of cables on one side of the robot."""


def mirrored(cables: Sequence[str]) -> list[str]:
    """The cables of a junction on the other side of the robot, by their names."""
    swap = dict(zip(SIDES, reversed(SIDES), strict=True))
    return ["_".join(swap.get(part, part) for part in cable.split("_")) for cable in cables]
