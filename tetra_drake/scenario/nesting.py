"""The nested tetrahedra of the thesis (section 2.1): names and places of nodes and cables."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np

from tetra_drake.scenario.layout import Layout

NODES = ("bottom_left", "bottom_right", "top", "tip")
"""The nodes of a tetrahedron; the first three form the base triangle."""

BOTTOM_LEFT, BOTTOM_RIGHT, TOP, TIP = range(4)

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


def tetrahedron_nodes(strut_length: float) -> np.ndarray:
    """p_BN (4, 3) in m: the base triangle is vertical, the tip points forward, and the origin is
    the centre of mass."""
    circumradius = strut_length / math.sqrt(3.0)
    height = strut_length * math.sqrt(2.0 / 3.0)
    x, z = -height / 4, -circumradius / 2
    base = [[x, strut_length / 2, z], [x, -strut_length / 2, z], [x, 0.0, circumradius]]
    return np.array([*base, [3 * height / 4, 0.0, 0.0]])


def cable_nodes(junction: int, cable: str) -> tuple[int, int]:
    """The indices of the nodes that a cable of a junction joins; 4 nodes per tetrahedron."""
    role, name = cable.split()
    place = NODES.index(name)
    rear = place if role == "outer" else TIP
    return 4 * junction + rear, 4 * (junction + 1) + place


def row_layout(
    *, tetrahedra: int, strut_length: float, spacing: float, groups: Sequence[Sequence[str]]
) -> Layout:
    """The layout of a row on flat ground; each junction has the same groups of driven cables."""
    forward = spacing * np.arange(tetrahedra)[:, np.newaxis, np.newaxis] * [1.0, 0.0, 0.0]
    p_WN = (forward + tetrahedron_nodes(strut_length)).reshape(-1, 3)
    cables = [(junction, cable) for junction in range(tetrahedra - 1) for cable in CABLES]
    nodes = np.array([cable_nodes(*cable) for cable in cables])
    oscillators, driven = [], []
    for junction in range(tetrahedra - 1):
        name = f"T{junction + 1}-T{junction + 2}"
        for group in groups:
            oscillators.append(f"{name} {' + '.join(group)}" if len(groups) > 1 else name)
            driven.append(tuple(cables.index((junction, cable)) for cable in group))
    return Layout(
        cable_names=tuple(f"T{i + 1}-T{i + 2} {cable}" for i, cable in cables),
        ends=p_WN[nodes],
        bodies=nodes // len(NODES),
        oscillators=tuple(oscillators),
        groups=tuple(driven),
    )
