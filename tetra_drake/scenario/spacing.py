"""The spacing at which the cables between two tetrahedra balance."""

import math

from tetra_drake.scenario.settings import CableSection, RobotSection


def balanced_spacing(robot: RobotSection, cables: CableSection) -> float:
    """The spacing (m) at which the cables of a junction balance along x.

    Three outer cables of length s pull two tetrahedra together. Three inner ones, from a tip at
    height h to base nodes at s along and R across, push them apart while s < h. Raises ValueError
    if there is no such spacing. The weight does not count: twice the density moves T1 by less than
    0.003 in.
    """
    height = robot.strut_length * math.sqrt(2.0 / 3.0)
    radius = robot.strut_length / math.sqrt(3.0)

    def pull(s: float) -> float:
        length = math.hypot(radius, height - s)
        inner = cables.inner_stiffness * (length - cables.free_length) * (height - s) / length
        return cables.outer_stiffness * (s - cables.free_length) - inner

    near, far = 0.0, height + cables.free_length
    if pull(near) >= 0.0:
        raise ValueError("the cables balance at no spacing; give one")
    middle = 0.5 * (near + far)
    while near < middle < far:
        if pull(middle) > 0.0:
            far = middle
        else:
            near = middle
        middle = 0.5 * (near + far)
    return far


def deciding_numbers(robot: RobotSection, cables: CableSection) -> tuple[float, ...]:
    """The numbers on which the balanced spacing depends."""
    return (
        robot.strut_length,
        cables.outer_stiffness,
        cables.inner_stiffness,
        cables.free_length,
    )
