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


def side_of(cables: Sequence[str]) -> str:
    """The side of the robot, of SIDES, on which all cables of a group are; "" if there is none."""
    for side in SIDES:
        if all(cable.endswith(side) for cable in cables):
            return side
    return ""


def mirrored(cables: Sequence[str]) -> list[str]:
    """The cables of a junction on the other side of the robot, by their names."""
    left, right = SIDES
    images = []
    for cable in cables:
        if cable.endswith(left):
            images.append(cable.replace(left, right))
        else:
            images.append(cable.replace(right, left))
    return images
