"""The robot as a Meshcat scene: what is drawn, how it moves, the floor and the camera."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.geometry import Box, Cylinder, Meshcat, MeshcatCone, Rgba, Sphere
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from tetra_drake.physics.cable import PASSIVE
from tetra_drake.robot.bodies import strut_pose
from tetra_drake.robot.structure import NODES, STRUTS, TIP, Structure
from tetra_drake.scenario.units import INCH, POUND_FORCE

if TYPE_CHECKING:
    import xarray

COLOURS = {
    "actuated": "#d55e00",
    "outer": "#56b4e9",
    "inner": "#009e73",
    "normal": "#0072b2",
    "friction": "#cc79a7",
    "trace": "#222222",
    "forward": "#444444",
    "odd": "#5d6672",
    "even": "#b4bbc3",
    "floor": "#f2f1ec",
    "inch": "#d3d2cb",
    "six_inches": "#8f8e87",
}
"""Colours of what is drawn (those of cables and forces are Okabe and Ito's, for colour-blind
people); neighbouring tetrahedra alternate between odd and even."""

CABLE_RADIUS, HAIRLINE = 0.0003, 0.0001
"""Drawn radius of a cable: m per N of tension, and the least, in m."""

ARROW_LENGTH = 30.0 * INCH / POUND_FORCE
"""Length of a force's arrow in m per N: 6 in are 0.2 lbf."""

ARROW_WIDTH = 0.06
"""Length in m above which an arrow grows no thicker."""

HIDDEN = 1e-6
"""Drawn force in N where there is none: a scale of 0 would make matrices singular."""

FORWARD_LENGTH = 6.0 * INCH
"""Length of the arrow on the floor that shows the direction of travel."""

FIELD_OF_VIEW, ASPECT = 35.0, 1.7
"""Of the camera: degrees top to bottom, and the width to height of a window it is placed for."""

VIEW = -0.35, 1.0, -0.4
"""Direction in which the camera looks: from the robot's right and front, down on it."""


@dataclass(frozen=True)
class Motion:
    """Motion of the object at a path of the scene over some frames."""

    path: str
    positions: np.ndarray
    """(frames, 3) in m."""
    quaternions: np.ndarray | None = None
    """(frames, 4), w first; None for an object that keeps the axes of World."""
    scales: np.ndarray | None = None
    """(frames, 3); None for an object that keeps its size."""

    def matrix(self, frame: int) -> np.ndarray:
        """(4, 4): the transformation, with scaling, of the object in one frame."""
        matrix = np.eye(4)
        if self.quaternions is not None:
            matrix[:3, :3] = RotationMatrix(Quaternion(self.quaternions[frame])).matrix()
        if self.scales is not None:
            matrix[:3, :3] *= self.scales[frame]
        matrix[:3, 3] = self.positions[frame]
        return matrix


def add_robot(meshcat: Meshcat, structure: Structure) -> None:
    """Adds the objects that motions() moves: tetrahedra, cables, and arrows for forces."""
    for i, body in enumerate(structure.bodies):
        _add_tetrahedron(meshcat, structure, f"/robot/{body}", rgba("even" if i % 2 else "odd"))
    for cable, name in zip(structure.cables, structure.cable_names, strict=True):
        path = _cable_path(cable, name)
        meshcat.SetObject(path, Cylinder(1.0, 1.0), rgba(path.split("/")[2]))
    for node in structure.contacts:
        for kind in ("normal", "friction"):
            path = f"/forces/{kind}/{structure.node_names[node]}"
            _add_unit_arrow(meshcat, path, rgba(kind))


def motions(structure: Structure, frames: xarray.Dataset) -> Iterator[Motion]:
    """Motions of all objects over `frames`, samples of a trajectory."""
    yield from _tetrahedron_motions(structure, frames)
    yield from _cable_motions(structure, frames)
    yield from _force_motions(structure, frames)


def aligning_quaternions(directions: np.ndarray) -> np.ndarray:
    """Unit quaternions (..., 4), w first, that turn the z axis to `directions` (..., 3).

    By the shortest arc, so that a direction that moves smoothly turns smoothly. A zero
    direction, and straight down, where that arc is not unique, get some rotation.
    """
    length = np.linalg.norm(directions, axis=-1)
    x, y, z = np.moveaxis(directions, -1, 0)
    q = np.stack([length + z, -y, x, np.zeros_like(x)], axis=-1)
    q[length == 0.0] = (1.0, 0.0, 0.0, 0.0)
    norm = np.linalg.norm(q, axis=-1, keepdims=True)
    down = norm[..., 0] <= 1e-9 * length
    q[down], norm[down] = (0.0, 1.0, 0.0, 0.0), 1.0
    return q / norm


def set_surroundings(meshcat: Meshcat, structure: Structure, points: np.ndarray) -> None:
    """Sets floor, light and camera for a robot whose nodes stay around `points` (..., 3), in m."""
    corners = floor_corners(points)
    height = -structure.node_radius
    _add_floor(meshcat, corners, height=height)
    for unused in ("/Grid", "/Axes"):
        meshcat.SetProperty(unused, "visible", False)
    meshcat.SetProperty("/Background/<object>", "top_color", [0.86, 0.9, 0.95])
    meshcat.SetProperty("/Background/<object>", "bottom_color", [1.0, 1.0, 1.0])
    meshcat.SetProperty("/Lights/AmbientLight/<object>", "intensity", 0.9)
    meshcat.SetProperty("/Cameras/default/rotated/<object>", "fov", FIELD_OF_VIEW)
    (x, y), (X, Y) = corners * INCH
    _add_unit_arrow(meshcat, "/floor/forward", rgba("forward"))
    start = np.array([[(x + X - FORWARD_LENGTH) / 2, y + INCH, height]])
    size = np.full((1, 3), FORWARD_LENGTH)
    forward = Motion("/floor/forward", start, aligning_quaternions(np.eye(3)[:1]), size)
    meshcat.SetTransform(forward.path, forward.matrix(0))
    floor = [(a, b, height) for a in (x, X) for b in (y, Y)]
    seen = np.vstack([points.reshape(-1, 3), floor])
    target = (seen.min(axis=0) + seen.max(axis=0)) / 2
    meshcat.SetCameraPose(camera_position(seen, target), target)


def floor_corners(points: np.ndarray) -> np.ndarray:
    """Least and greatest x, y (2, 2) of the floor, in whole inches around `points` (..., 3)."""
    margin = 2
    x_y = points.reshape(-1, 3)[:, :2] / INCH
    low, high = np.floor(x_y.min(axis=0)) - margin, np.ceil(x_y.max(axis=0)) + margin
    return np.array([low, high], dtype=int)


def camera_position(points: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Position from which a camera aimed at `target` (3,) sees all `points` (points, 3)."""
    forward = np.array(VIEW) / np.linalg.norm(VIEW)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    offset = points - target
    slope = np.tan(np.deg2rad(FIELD_OF_VIEW) / 2)
    for_width = np.abs(offset @ right) / (ASPECT * slope) - offset @ forward
    for_height = np.abs(offset @ up) / slope - offset @ forward
    margin = 1.05
    return target - margin * max(for_width.max(), for_height.max()) * forward


def rgba(name: str) -> Rgba:
    """One of COLOURS, opaque."""
    red, green, blue = (value / 255 for value in bytes.fromhex(COLOURS[name][1:]))
    return Rgba(red, green, blue, 1.0)


def _add_tetrahedron(meshcat: Meshcat, structure: Structure, path: str, colour: Rgba) -> None:
    for a, b in STRUTS:
        strut = f"{path}/strut_{NODES[a]}_{NODES[b]}"
        length = float(np.linalg.norm(structure.p_BN[b] - structure.p_BN[a]))
        meshcat.SetObject(strut, Cylinder(structure.strut_radius, length), colour)
        meshcat.SetTransform(strut, strut_pose(structure, (a, b)))
    for name, p_BNi in zip(NODES, structure.p_BN, strict=True):
        meshcat.SetObject(f"{path}/{name}", Sphere(structure.node_radius), colour)
        meshcat.SetTransform(f"{path}/{name}", RigidTransform(p_BNi))


def _cable_path(cable: np.void, name: str) -> str:
    """Path of a cable in the scene, in one folder per kind."""
    if cable["signal"] != PASSIVE:
        kind = "actuated"
    else:
        kind = "inner" if cable["node_a"] % len(NODES) == TIP else "outer"
    return f"/cables/{kind}/{name}"


def _add_unit_arrow(meshcat: Meshcat, path: str, colour: Rgba) -> None:
    """An arrow 1 m long from the origin of `path` along its z axis."""
    head, shaft_radius, head_radius = 0.25, 0.025, 0.07
    meshcat.SetObject(f"{path}/shaft", Cylinder(shaft_radius, 1.0 - head), colour)
    meshcat.SetTransform(f"{path}/shaft", RigidTransform([0.0, 0.0, (1.0 - head) / 2]))
    meshcat.SetObject(f"{path}/head", MeshcatCone(head, head_radius, head_radius), colour)
    # The cone's own tip is at its origin, and it opens along its z axis.
    meshcat.SetTransform(
        f"{path}/head", RigidTransform(RollPitchYaw(np.pi, 0.0, 0.0), [0.0, 0.0, 1.0])
    )


def _tetrahedron_motions(structure: Structure, frames: xarray.Dataset) -> Iterator[Motion]:
    q_WB = frames["q_WB"].values
    q_WB = q_WB / np.linalg.norm(q_WB, axis=-1, keepdims=True)
    for i, body in enumerate(structure.bodies):
        yield Motion(f"/robot/{body}", frames["p_WB"].values[:, i], q_WB[:, i])


def _cable_motions(structure: Structure, frames: xarray.Dataset) -> Iterator[Motion]:
    """Unit cylinders scaled to reach from node to node, with radii proportional to tension."""
    p_WN = frames["p_WN"].values.reshape(frames.sizes["time"], -1, 3)
    radius = (CABLE_RADIUS * frames["tension"].values).clip(min=HAIRLINE)
    for c, (cable, name) in enumerate(zip(structure.cables, structure.cable_names, strict=True)):
        p_WA, p_WB = p_WN[:, cable["node_a"]], p_WN[:, cable["node_b"]]
        length = np.linalg.norm(p_WB - p_WA, axis=1)
        yield Motion(
            _cable_path(cable, name),
            (p_WA + p_WB) / 2,
            aligning_quaternions(p_WB - p_WA),
            np.column_stack([radius[:, c], radius[:, c], length]),
        )


def _force_motions(structure: Structure, frames: xarray.Dataset) -> Iterator[Motion]:
    """Unit arrows on the contact nodes, scaled to the forces there."""
    p_WN = frames["p_WN"].values.reshape(frames.sizes["time"], -1, 3)
    normal, friction = frames["normal_force"].values, frames["friction_force"].values
    for c, node in enumerate(structure.contacts):
        name = structure.node_names[node]
        yield Motion(f"/forces/normal/{name}", p_WN[:, node], None, _arrow_scales(normal[:, c]))
        force = np.append(friction[:, c], np.zeros((len(friction), 1)), axis=1)
        size = np.linalg.norm(force, axis=1)
        quaternions = aligning_quaternions(force)
        yield Motion(f"/forces/friction/{name}", p_WN[:, node], quaternions, _arrow_scales(size))


def _arrow_scales(sizes: np.ndarray) -> np.ndarray:
    """Scales (frames, 3) of the unit arrow for forces of these sizes (frames,), in N."""
    length = ARROW_LENGTH * sizes.clip(min=HIDDEN)
    width = length.clip(max=ARROW_WIDTH)
    return np.column_stack([width, width, length])


def _add_floor(meshcat: Meshcat, corners: np.ndarray, *, height: float) -> None:
    """A slab with its top at z = height (m), and on it a grid of inches."""
    low, high = corners
    thickness, lift = 0.002, 0.0002  # lines float a little, else the slab shows through them
    (width, depth), middle = (high - low) * INCH, (high + low) / 2 * INCH
    meshcat.SetObject("/floor/slab", Box(width, depth, thickness), rgba("floor"))
    meshcat.SetTransform("/floor/slab", RigidTransform([*middle, height - thickness / 2]))
    lines: dict[str, list[np.ndarray]] = {"inch": [], "six_inches": []}
    for axis in (0, 1):
        for inch in range(low[axis], high[axis] + 1):
            line = corners.copy()
            line[:, axis] = inch
            lines["six_inches" if inch % 6 == 0 else "inch"].append(line)
    for rank, (kind, some) in enumerate(lines.items(), start=1):
        level = np.full((1, len(some)), height + rank * lift)
        start, end = (np.vstack([np.array(some)[:, i].T * INCH, level]) for i in (0, 1))
        meshcat.SetLineSegments(f"/floor/{kind}", start, end, rgba=rgba(kind))
